"""Pushes above the floor, planned with uncertainty, in MuJoCo with six degrees of freedom: does every contact hold?

Run `python benchmarks/heights.py [--worlds 6] [--step 5] [--seed 1]` (extra `physics`); prints every figure next to
what is wanted and exits 1 if one is missed. A cube of 10 cm is pushed at heights from 0 to 55 mm and above, with
frictions and load known to 20 %; so is a pair of cubes, whose contact is at another height, and a tower that most
heights would tip. What is planned is carried out at full speed in worlds that differ by what the scenario says is not
known. The model shares no code with the package: free boxes on 36 feet each that only push, so that they lift where
they lift, and on every contact two small spheres at its height, which carry vertical friction, too. That it sees
losses is told by plans that believe in pushes at the floor and in their numbers.
"""

from __future__ import annotations

import argparse
import re
import sys
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

import pushplan
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.builders import box, build_scenario, plate
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray

FLOOR, PLATE, BETWEEN, SHARE = 0.3, 0.5, 0.4, 0.2
"""Coefficients of friction, and the share by which these and loads are off."""

GOALS = ([0.5, 0.35, 1.2], [0.8, -0.3, -0.5])
FEET, FOOT = 6, 0.002
"""Feet along a side, and radius of a sphere, m."""

SOFT, SPRING, DAMPER, DRAG = 1e-3, 8000.0, 50.0, 0.1
"""Impedance of the feet, their stiffness and damping, and the damping of their friction. The engine's convex friction
lifts a foot that slides on a hard floor, and it hops. So the floor is soft, but stiff against sliding (`impratio`):
the cube sinks in by 0.04 mm."""

HEAVY = 1e6
"""Mass of the plate, kg, which no contact moves."""

LIMITS = np.array([1.0, 0.5, 0.3, 2.0])
"""How far a contact that holds may slide and open (mm), turn and tilt (deg) in an engine of soft contacts."""


@dataclass(frozen=True)
class Case:
    """What is pushed, and whether the plan knows the heights, and that its numbers are uncertain.

    Attributes:
        name: Of the boxes.
        side: Of their square base, m.
        top: Their height, m.
        heights: Least and largest height of every contact, m.
        knowing: See above.
    """

    name: str
    side: float
    top: float
    heights: tuple[tuple[float, float], ...]
    knowing: bool = True

    def scenario(self, goal: list[float]) -> Scenario:
        """Return the problem with a goal."""
        names = ["near", "far"][: len(self.heights)]
        objects = [box(name, self.side, self.side, 1.0) for name in names]
        pairs = [["pusher", "near"], names]
        more: dict[str, Any] = {"contacts": {"friction": BETWEEN}, "stability": {"margin": 0.01}}
        if self.knowing:
            objects = [{**one, "height": self.top} for one in objects]
            between = [{"objects": pairs[k], "height": list(span)} for k, span in enumerate(self.heights)]
            shares = dict.fromkeys(("contact_friction", "floor_friction", "load"), SHARE)
            more = {"contacts": {"friction": BETWEEN, "between": between}, "uncertainty": shares}
        area = {"x": [-1.0, 2.0], "y": [-1.5, 1.5]}
        pusher = plate(0.2, PLATE)
        return build_scenario(self.name, objects, pusher, goal, floor_friction=FLOOR, workspace=area, **more)


@dataclass(frozen=True)
class World:
    """Unknown values of a scenario: frictions, heights of contacts (n,) and offsets of the masses (n, 2), m."""

    floor: float
    contact: float
    heights: FloatArray
    off: FloatArray

    @classmethod
    def drawn(cls, case: Case, rng: np.random.Generator) -> World:
        """Return a world, every other one at interval ends; a load shift of 20 % moves the mass by side / 20."""
        n, spans = len(case.heights), np.array(case.heights)
        one = rng.uniform(-1.0, 1.0, 2 + 3 * n)
        one = np.sign(one) if rng.random() < 0.5 else one
        heights = spans.mean(axis=1) + 0.5 * one[2 : 2 + n] * np.ptp(spans, axis=1)
        off = 0.25 * SHARE * case.side * one[2 + n :].reshape(n, 2)
        return cls(FLOOR * (1.0 + SHARE * one[0]), 1.0 + SHARE * one[1], heights, off)


def model_of(case: Case, world: World, dt: float) -> Any:
    """Return the engine's model; only declared pairs can touch."""
    spec = mujoco.MjSpec()
    option = spec.option
    option.timestep, option.cone, option.impratio = dt, mujoco.mjtCone.mjCONE_ELLIPTIC, 1e4
    option.iterations, option.ls_iterations, option.tolerance = 100, 200, 1e-16 / HEAVY
    sphere, block = mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_BOX
    standing = {"solref": [-SPRING, -DAMPER], "solreffriction": [-1e-9, -DRAG], "solimp": [SOFT, SOFT, 1e-3, 0.5, 2]}
    touching = {"solref": [2.5 * dt, 1.0], "solimp": [0.99, 0.99, 1e-3, 0.5, 2]}

    def geom(body: Any, name: str, kind: Any, size: list[float], at: list[float]) -> None:
        body.add_geom(name=name, type=kind, size=size, pos=at, contype=0, conaffinity=0, mass=0.0)

    def pair(one: str, other: str, friction: float, settings: dict[str, list[float]]) -> None:
        both = [friction, friction, 0.0, 0.0, 0.0]
        spec.add_pair(geomname1=one, geomname2=other, condim=3, friction=both, **settings)

    geom(spec.worldbody, "floor", mujoco.mjtGeom.mjGEOM_PLANE, [0.0, 0.0, 1.0], [0.0, 0.0, 0.0])
    pushing = spec.worldbody.add_body(name="plate")
    for joint, axis in (("x", [1, 0, 0]), ("y", [0, 1, 0])):
        pushing.add_joint(name=joint, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    pushing.add_joint(name="turn", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1])
    pushing.mass, pushing.inertia, pushing.explicitinertial = HEAVY, [HEAVY] * 3, 1
    half, front = 0.5 * case.side, 0.0
    places = (np.arange(FEET) + 0.5) * case.side / FEET - half
    tall = (case.side**2 + case.top**2) / 12.0
    for k, height in enumerate(world.heights):
        body = spec.worldbody.add_body(name=f"box{k}", pos=[(k + 0.5) * case.side, 0.0, 0.0])
        body.add_freejoint()
        body.mass, body.inertia, body.explicitinertial = 1.0, [tall, tall, case.side**2 / 6.0], 1
        body.ipos = [*world.off[k], 0.5 * case.top]
        geom(body, f"box{k}", block, [half, half, 0.5 * case.top], [0.0, 0.0, 0.5 * case.top])
        for i, (x, y) in enumerate((x, y) for x in places for y in places):
            geom(body, f"foot{k}-{i}", sphere, [FOOT, 0.0, 0.0], [x, y, FOOT])
            pair(f"foot{k}-{i}", "floor", world.floor, standing)
        for side in (-1, 1):
            at = [front - FOOT, side * (half - FOOT), max(float(height), FOOT)]
            geom(pushing, f"touch{k}{side}", sphere, [FOOT, 0.0, 0.0], at)
            pair(f"touch{k}{side}", f"box{k}", world.contact * (BETWEEN if k else PLATE), touching)
        pushing, front = body, half
    return spec.compile()


def carried_out(case: Case, world: World, motion: Trajectory, dt: float = 1e-3) -> FloatArray:
    """Return the largest slide and opening (mm), turn and tilt (deg), (4,), in a world."""
    model = model_of(case, world, dt)
    data = mujoco.MjData(model)
    settle = int(0.2 / dt)
    t = np.maximum(np.arange(settle + int(motion.duration / dt)) - settle, 0) * dt
    poses = motion.poses_at(t)
    poses[:, 2] = np.unwrap(poses[:, 2])
    speeds = np.gradient(poses, dt, axis=0)
    looks = []
    for i in range(len(t)):
        data.qpos[:3], data.qvel[:3] = poses[i], speeds[i]
        mujoco.mj_step(model, data)
        if i >= settle and i % 20 == 0:
            looks.append([_seen(data, k) for k in range(len(case.heights))])
    seen = np.array(looks)
    if not np.isfinite(seen).all():
        raise RuntimeError("the engine lost its balance")
    away = np.abs(seen[..., :3] - seen[0, :, :3]).max(axis=(0, 1))
    return np.array([1e3 * away[1], 1e3 * away[0], np.degrees(away[2]), np.degrees(seen[..., 3].max())])


def _seen(data: Any, k: int) -> list[float]:
    """Return x, y and heading of a box in the frame of its pusher, and its tilt, rad."""
    own, pushing = data.body(f"box{k}"), data.body(f"box{k - 1}" if k else "plate")
    turned, base = own.xmat.reshape(3, 3), pushing.xmat.reshape(3, 3)
    x, y, _ = base.T @ (own.xpos - pushing.xpos)
    across = base.T @ turned
    tilt = np.arccos(np.clip(turned[2, 2], -1.0, 1.0))
    return [float(x), float(y), float(np.arctan2(across[1, 0], across[0, 0])), float(tilt)]


def tried(case: Case, worlds: int, seed: int) -> tuple[int, int, str]:
    """Return the number of runs that held, of all runs, and the largest values; or 0, 0 and the reason without a
    plan.
    """
    rng = np.random.default_rng(seed)
    found = []
    for goal in GOALS:
        try:
            plan = pushplan.plan(case.scenario(goal), seed=seed, time_limit=20.0, iterations=300)
        except pushplan.PushplanError as refused:
            return 0, 0, str(refused)
        if plan.trajectory is None:
            return 0, 0, f"no plan: {plan.reason}"
        found += [carried_out(case, World.drawn(case, rng), plan.trajectory) for _ in range(worlds)]
    slid, opened, turned, tilted = np.max(found, axis=0)
    text = f"slid {slid:.2f} mm, opened {opened:.2f} mm, turned {turned:.2f} deg, tilted {tilted:.2f} deg at most"
    return sum((most <= LIMITS).all() for most in found), len(found), text


def main() -> int:
    from random_chains import tell

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", type=int, default=6, help="for each of two plans at each height")
    parser.add_argument("--step", type=float, default=5.0, help="between heights, mm")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    levels = 1e-3 * np.arange(0.0, 55.0 + 1e-9, given.step)
    cases = [Case("cube", 0.1, 0.1, ((h, h),)) for h in (*levels, 0.07, 0.09, 0.11)]
    cases += [Case("cube", 0.1, 0.1, ((h - 0.01, h + 0.01),)) for h in levels[2::4]]
    cases += [Case("two cubes", 0.1, 0.1, ((h, h), (0.0, 0.02))) for h in levels[::4]]
    cases += [Case("tower", 0.06, 0.3, ((h, h),)) for h in (0.02, 0.04, 0.06, 0.08, 0.1)]
    blind = [Case("cube", 0.1, 0.1, ((0.055, 0.055),), False), Case("tower", 0.06, 0.3, ((0.1, 0.1),), False)]
    planned = held = runs = refused = lost = 0
    for case in (*cases, *blind):
        good, count, text = tried(case, given.worlds, given.seed)
        at = " to ".join(f"{1e3 * h:.0f}" for h in dict.fromkeys(case.heights[0]))
        what = f"{good} of {count} held" if count else "refused"
        believed = "" if case.knowing else ", believed at the floor"
        print(f"{case.name} at {at} mm{believed}: {what}; {text}", flush=True)
        if not case.knowing:
            lost += count - good
            continue
        held, runs = held + good, runs + count
        refused += not count and re.search(r"up to [\d.]+ mm", text) is not None
        planned += case in cases[: len(levels)] and count > 0
    sound = tell("heights up to 55 mm that are planned", planned, ">=", len(levels))
    sound &= tell("runs in which every contact held, share", held / max(runs, 1), ">=", 1.0)
    sound &= tell("refusals with the height that is possible", refused, ">=", 4)
    return 0 if sound & tell("runs of plans for the floor that are lost", lost, ">=", 1) else 1


if __name__ == "__main__":
    sys.exit(main())
