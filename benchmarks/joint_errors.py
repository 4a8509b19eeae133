"""Is the joint robustness of plans correct and tight? An independent search for worse errors.

Run `python benchmarks/joint_errors.py [--plans 100] [--seed 101] [--restarts 50]`. Random problems are planned, and
the packaged scenarios; of each plan `robustness.joint`, rho, is asked. Then combinations of errors are sought that
lose a contact at 0.95 rho: from random points of the scaled box the least margin is descended, number by number
(`descend`). Each is judged by a chain that is built anew from changed objects and asked at every moment. A plan is
right when nothing loses a contact at 0.95 rho, and tight when the combination that rho names, judged likewise, does
at 1.05 rho. Prints a table; exits 1 when a plan is not right.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace

import numpy as np

from pushplan.bench.random_problems import generate
from pushplan.bench.schema import ProblemParameters
from pushplan.errors import PushplanError
from pushplan.geometry.polygon import SHORTEST_CONTACT
from pushplan.geometry.se2 import rotate
from pushplan.mechanics.chain import Chain, PushedObject
from pushplan.mechanics.dynamics import dynamic_margins
from pushplan.mechanics.perturb import Motion, aside_slides, displace
from pushplan.mechanics.support import FeetSupport, Support, UniformSupport
from pushplan.planner import plan
from pushplan.scenario.file import example_names, load_scenario, scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.sim.joint_robustness import ErrorBox, JointErrors
from pushplan.sim.moments import ChainMotion, Moments, thinned
from pushplan.util.arrays import FloatArray


def leaning(obj: PushedObject, shares: FloatArray) -> Support:
    """Return the load of an object shifted along the chain frame's x and y by (2,) shares together."""
    support, axes = obj.support, rotate(-float(obj.pose_chain[2]), np.eye(2))
    if isinstance(support, UniformSupport):
        center = support.center
        for axis, share in zip(axes, shares, strict=True):
            center = center + support.leaning(axis, share).center - support.center
        return UniformSupport(support.outline, center)
    positions, fractions, _ = support.point_loads
    about = (positions - fractions @ positions) @ axes.T
    return FeetSupport(positions, fractions * (1.0 + about / np.abs(about).max(axis=0) @ shares))


def one_off(chain: Chain, index: int, aside: float = 0.0, angle: float = 0.0) -> Motion:
    """Return one object shifted sideways (m) or turned about its contact's midpoint (rad), all others nominal."""
    distances, turns = np.zeros((2, 1, len(chain.objects)))
    distances[0, index], turns[0, index] = aside, angle
    return displace(chain, aside_slides(chain, distances), turns)


def off_by(box: ErrorBox, scale: float, point: FloatArray) -> Chain:
    """Return the chain at a point (n, 6) of the scaled box, contact frictions at their lowest.

    Raises:
        PushplanError: When there is no such chain.
    """
    chain, off = box.chain, scale * point * box.widths
    for k in range(len(chain.objects)):
        moved = one_off(chain, k, aside=float(off[k, 4]))
        if (moved.lengths < SHORTEST_CONTACT).any():
            raise PushplanError("no contact is left")
        chain = moved.applied(chain)
    for k in reversed(range(len(chain.objects))):
        chain = one_off(chain, k, angle=float(off[k, 5])).applied(chain)
    objects = tuple(
        replace(
            there,
            floor_friction=obj.floor_friction * (1.0 + row[0]),
            mass=obj.mass * (1.0 + row[1]),
            support=leaning(obj, row[2:4]),
        )
        for there, obj, row in zip(chain.objects, box.chain.objects, off, strict=True)
    )
    contacts = tuple(
        replace(contact, friction=contact.friction * (1.0 - scale * share))
        for contact, share in zip(chain.contacts, box.contact_friction, strict=True)
    )
    return replace(chain, objects=objects, contacts=contacts)


def least(box: ErrorBox, scale: float, point: FloatArray, moments: Moments) -> float:
    """Return the smallest margin of that chain at all moments; -1 if it is invalid."""
    try:
        return float(dynamic_margins(off_by(box, scale, point), moments.twists, moments.rates).min())
    except PushplanError:
        return -1.0


def descend(errors: JointErrors, scale: float, restarts: int, rng: np.random.Generator, steps: int = 3) -> float:
    """Return the least margin that is found in the scaled box from random points.

    At each point one of the conditions with the least to spare is chosen by lot. The sign of its change with each
    number, by differences over a tenth of the box, says the corner to go to; so often as `steps` says. What is found
    there is judged by chains that are built anew.
    """
    box, moments = errors.box, errors.motion.moments
    found, shape = np.inf, box.widths.shape
    for _ in range(restarts):
        point = rng.uniform(-1.0, 1.0, shape)
        values = errors.values(np.array([scale]), point[None], None)[0] / errors.motion.nominal.reshape(
            len(moments.twists), -1
        )
        moment, row = np.unravel_index(rng.choice(values.argsort(axis=None)[:64]), values.shape)
        for _ in range(steps):
            step = 0.1 * np.eye(point.size).reshape(-1, *shape)
            points = np.clip(np.concatenate([point + step, point - step]), -1.0, 1.0)
            ahead, back = errors.values(np.full(len(points), scale), points, np.array([moment]))[:, 0, row].reshape(
                2, *shape
            )
            point = np.where(ahead > back, -1.0, np.where(ahead < back, 1.0, point))
        found = min(found, least(box, scale, point, moments))
        if found <= 0.0:
            break
    return found


def problems(count: int, seed: int) -> list[tuple[str, Scenario]]:
    """Return the packaged scenarios and `count` random ones of one to three objects with known loads."""
    found = [(name, load_scenario(name)) for name in sorted(example_names())]
    for k in range(count):
        parameters = ProblemParameters(objects=(1 + k % 3, 1 + k % 3))
        found.append((f"random {k}", scenario_from_text(generate(parameters, seed + k))))
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--plans", type=int, default=100, help="random problems")
    parser.add_argument("--seed", type=int, default=101)
    parser.add_argument("--restarts", type=int, default=50)
    asked = parser.parse_args()
    right = tight = count = 0
    rhos, seconds, wrong = [], [], []
    for name, scenario in problems(asked.plans, asked.seed):
        made = plan(scenario, seed=1, first=True, iterations=20_000, time_limit=20.0)
        push = next((segment for segment in made.segments if segment.pushes), None)
        if push is None or push.load is None or len([s for s in made.segments if s.pushes]) > 1:
            continue
        begun = time.process_time()
        stated = made.robustness
        seconds.append(time.process_time() - begun)
        if stated is None or not stated.joint:
            continue
        trajectory, box = push.contact_trajectory, ErrorBox.of(push.load)
        moments = thinned(trajectory.directions, trajectory.rates_at(trajectory.t), box.chain.characteristic_length)
        errors = JointErrors(ChainMotion(box.chain, moments), box)
        rho, corner = errors.worst()
        assert abs(rho / stated.joint - 1.0) < 1e-5
        rng = np.random.default_rng([asked.seed, count])
        count += 1
        rhos.append(rho)
        holds = descend(errors, 0.95 * rho, asked.restarts, rng) > 0.0
        lost = least(box, 1.05 * rho, corner, moments) <= 0.0
        right, tight = right + holds, tight + lost
        if not holds or not lost:
            wrong.append(
                f"{name}: rho {rho:.3f}" + ("" if holds else ", not right") + ("" if lost else ", not tight")
            )
        print(f"{count} plans, {right} right, {tight} tight", end="\r", file=sys.stderr, flush=True)
    print("| plans | right | tight | rho: median, least, most | CPU s: median |\n|---|---|---|---|---|")
    print(
        f"| {count} | {right} | {tight} | {np.median(rhos):.2f}, {min(rhos):.2f}, {max(rhos):.2f} "
        f"| {np.median(seconds):.3f} |"
    )
    print(*wrong, sep="\n")
    return int(right < count)


if __name__ == "__main__":
    raise SystemExit(main())
