"""Random pushes, and chains that are off in one number: built from changed objects, not by the code under test."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np
from plans_of import timed

from pushplan.bench.random_problems import generate
from pushplan.bench.schema import ProblemParameters
from pushplan.errors import SupportError, TimingError
from pushplan.geometry.polygon import find_touch
from pushplan.geometry.se2 import compose, rotate, transform_points
from pushplan.mechanics.chain import PLATE, Chain, PushedObject
from pushplan.mechanics.dynamics import dynamic_margins
from pushplan.mechanics.support import FeetSupport, PressureMapSupport, Support, UniformSupport
from pushplan.plans.path import PushPath, cost_rate
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray

KINDS = ("contact_friction", "floor_friction", "load", "position", "angle")
PARAMETERS = ProblemParameters(objects=(1, 4), supports=("uniform", "feet"), obstacles=(0, 3))


def random_scenario(seed: int) -> Scenario:
    """Return a random problem on known loads of all kinds; a third is pushed above the floor."""
    scenario = scenario_from_text(generate(PARAMETERS, seed))
    rng = np.random.default_rng([seed, 1])
    objects = tuple(_dressed(rng, obj) for obj in scenario.chain.objects)
    height = float(rng.choice([0.0, 0.0, rng.uniform(0.001, 0.01)]))
    pusher = scenario.chain.pusher
    limits = replace(pusher.limits, contact="dynamic")
    chain = replace(
        scenario.chain, objects=objects, pusher=replace(pusher, contact_height=height, limits=limits)
    )
    stability = replace(scenario.stability, margin=0.05)
    how = str(rng.choice(["exact", "blended"]))
    return replace(scenario, chain=chain, stability=stability, trajectory=how)


def _dressed(rng: np.random.Generator, obj: PushedObject) -> PushedObject:
    """Return the object, every other one on a plane or map of pressure in place of an even one."""
    if not isinstance(obj.support, UniformSupport) or rng.random() < 0.5:
        return obj
    size = np.ptp(obj.outline, axis=0)
    center = obj.support.center + rng.uniform(-0.04, 0.04, 2) * size
    if rng.random() < 0.5:
        return replace(obj, support=UniformSupport(obj.outline, center))
    points = obj.support.center + rng.uniform(-0.35, 0.35, (12, 2)) * size
    return replace(obj, support=PressureMapSupport(points, rng.dirichlet(np.full(12, 8.0))))


def random_trajectory(scenario: Scenario, seed: int) -> Trajectory | None:
    """Return a random stable motion of the scenario's chain, None where there is hardly any."""
    rng = np.random.default_rng([seed, 2])
    free = replace(scenario, obstacles=(), workspace=None)
    try:
        stable = free.stable_set()
        twists = _stable_twists(rng, free, stable)
        if not len(twists):
            return None
        lengths = rng.uniform(0.05, 0.5, len(twists))
        return timed(free, PushPath(np.zeros(3), twists, lengths))
    except (SupportError, TimingError):
        return None


def _stable_twists(rng: np.random.Generator, scenario: Scenario, stable: StableSet) -> FloatArray:
    length = scenario.chain.characteristic_length
    drawn = np.column_stack([np.ones(600), rng.normal(0.0, 0.3, 600), rng.normal(0.0, 0.6, 600) / length])
    kept = drawn[stable.margin(drawn) > 1.02 * scenario.required_margin][: int(rng.integers(1, 6))]
    return kept / cost_rate(kept)[:, None]


def perturbed(chain: Chain, kind: str, size: float) -> Iterator[Chain | None]:
    """Yield every chain that is off by `size` in one number; None where there is no such chain."""
    if kind == "contact_friction":
        yield replace(chain, contacts=tuple(replace(c, friction=c.friction * size) for c in chain.contacts))
        return
    axes = (0, 1) if kind == "load" else (0,)
    for i, sense, axis in product(range(len(chain.objects)), (1.0, -1.0), axes):
        try:
            if kind == "floor_friction":
                friction = chain.objects[i].floor_friction * (1.0 + sense * size)
                yield _with_object(chain, i, replace(chain.objects[i], floor_friction=friction))
            elif kind == "load":
                support = _leaning(chain.objects[i], axis, sense * size)
                yield _with_object(chain, i, replace(chain.objects[i], support=support))
            elif kind == "position":
                yield _aside(chain, i, sense * size)
            else:
                yield _turned(chain, i, sense * size)
        except SupportError:
            yield None


def least_margin(chain: Chain | None, trajectory: Trajectory) -> float:
    """Return the least margin with inertia along the trajectory's samples; -1 for no chain, or a lifted load."""
    if chain is None:
        return -1.0
    try:
        rates = trajectory.rates_at(trajectory.t)
        return float(dynamic_margins(chain, trajectory.directions, rates).min())
    except SupportError:
        return -1.0


def least_at(chain: Chain, trajectory: Trajectory, kind: str, size: float) -> float:
    """Return the least margin of all chains that are off by `size` in one number."""
    return min(least_margin(other, trajectory) for other in perturbed(chain, kind, size))


def _with_object(chain: Chain, i: int, obj: PushedObject) -> Chain:
    return replace(chain, objects=(*chain.objects[:i], obj, *chain.objects[i + 1 :]))


def _leaning(obj: PushedObject, axis: int, share: float) -> Support:
    """Return the support with its load leaning along the chain frame's x or y."""
    e = rotate(-obj.pose_chain[2], np.eye(2)[axis])
    support = obj.support
    if isinstance(support, UniformSupport):
        along = (support.outline - support.moments.centroid) @ e
        shift = share * support.moments.second @ e / support.moments.area / np.abs(along).max()
        return UniformSupport(support.outline, support.center + shift)
    if isinstance(support, FeetSupport):
        assert support.fractions is not None
        return FeetSupport(support.positions, _shifted(support.positions, support.fractions, e, share))
    assert isinstance(support, PressureMapSupport)
    return PressureMapSupport(support.points, _shifted(support.points, support.fractions, e, share))


def _shifted(points: FloatArray, loads: FloatArray, e: FloatArray, share: float) -> FloatArray:
    along = (points - loads @ points) @ e
    return np.asarray(loads * (1.0 + share * along / np.abs(along).max()))


def _aside(chain: Chain, i: int, distance: float) -> Chain | None:
    """Move one object along its contact; the contacts are found anew from the outlines."""
    shift = distance * chain.contacts[i].tangent
    obj = chain.objects[i]
    moved = _with_object(chain, i, replace(obj, pose_chain=obj.pose_chain + np.append(shift, 0.0)))
    contacts = list(chain.contacts)
    for k, contact in enumerate(contacts):
        if i in (contact.pushed, contact.pusher):
            by = contact.pusher
            pushing = chain.pusher.outline if by == PLATE else moved.objects[by].outline_chain
            touch = find_touch(pushing, moved.objects[k].outline_chain)
            if touch is None or not len(touch):
                return None
            same = [s for s in touch if (s[1] - s[0]) @ contact.tangent > 0.0]
            contacts[k] = replace(contact, right=same[0][0], left=same[0][1])
    return replace(moved, contacts=tuple(contacts))


def _turned(chain: Chain, i: int, angle: float) -> Chain:
    """Turn one object and all that it carries about the middle of its contact, which stays."""
    middle = 0.5 * (chain.contacts[i].right + chain.contacts[i].left)
    motion = np.append(middle - rotate(angle, middle), angle)
    carried = {i}
    objects, contacts = list(chain.objects), list(chain.contacts)
    for k, contact in enumerate(contacts):
        if contact.pusher in carried:
            carried.add(k)
            right, left = (transform_points(motion, end) for end in (contact.right, contact.left))
            contacts[k] = replace(contact, right=right, left=left)
        if k in carried:
            objects[k] = replace(objects[k], pose_chain=compose(motion, objects[k].pose_chain))
    return replace(chain, objects=tuple(objects), contacts=tuple(contacts))


def pushable(scenario: Scenario) -> bool:
    """Tell whether the chain can be pushed straight ahead with the margin asked for, no part of it lifting."""
    try:
        return float(scenario.stable_set().margin([[1.0, 0.0, 0.0]])[0]) > scenario.required_margin
    except SupportError:
        return False
