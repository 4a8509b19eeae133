"""Laws of mechanics: pushes are invariant to mirror images, masses and sizes."""

from dataclasses import astuple
from typing import Any

import numpy as np
import pytest
from conftest import there

import pushplan.core.slip as slip
from pushplan.geometry import se2
from pushplan.planner import plan
from pushplan.planners.timing.blending import time_segments
from pushplan.plans.load import Load
from pushplan.plans.path import PushPath, cost_rate
from pushplan.plans.segment import Segment
from pushplan.scenario.builders import build_scenario, plate, polygon
from pushplan.scenario.model import Scenario
from pushplan.sim.kinematic import execute
from pushplan.sim.robustness import least_robustness
from pushplan.slip.simulator import SlipSimulator
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray

STATED: tuple[dict[str, Any], ...] = (
    {},
    {"uncertainty": {"contact_friction": 0.1, "floor_friction": 0.2}},
    {"uncertainty": {"floor_friction": 0.2}, "stability": {"set": "stable"}},
)


def _scenario(seed: int, size: float = 1.0, side: float = 1.0, mass: float = 1.0, notch: float = 0.0) -> Scenario:
    """Return two or three random polygons in a row, with a notch in their rear, m; times scale with the root of
    lengths because gravity is fixed.
    """
    rng, time, objects = np.random.default_rng(seed), size**0.5, []
    for k in range(2 + seed % 2):
        a, b, c = rng.uniform(0.06, 0.12, 3)
        corners = [[0.0, -a], [b, -c], [b, a], [0.0, c]]
        if notch:
            corners += [[0.0, 0.3 * c], [notch, 0.1 * c], [0.0, -0.4 * a]]
        outline = np.array(corners) * [size, side * size]
        weight, aside = mass * rng.uniform(0.5, 3.0), side * size * rng.uniform(-0.02, 0.02)
        objects.append(polygon(f"object {k}", outline, weight, offset=aside))
    turns = np.sort([-0.5 * side, side]) / time
    limits = {"speed": 0.2 * time, "acceleration": 0.5, "jerk": 5.0 / time, "angular_speed": turns}
    limits |= {"angular_acceleration": 2.0 / size, "angular_jerk": 20.0 / time**3}
    pusher = plate(0.3 * size, 0.6, thickness=0.03 * size, limits=limits)
    goal, stated = (size, 0.7 * size * side, 0.9 * side), STATED[seed % len(STATED)]
    return build_scenario(
        "law", objects, pusher, goal, floor_friction=0.3, contact_friction=0.6, trajectory="exact", **stated
    )


def _numbers(scenario: Scenario, path: PushPath, margin: float, size: float = 1.0, mass: float = 1.0) -> FloatArray:
    """Return the numbers of a path without the factors of lengths and masses."""
    push = Segment.push(Load.of(scenario), path, scenario.poses, margin)
    pushes = time_segments(scenario, (push,), 100.0 / size**0.5)
    friction, floor, load, position, angle, _ = astuple(least_robustness(pushes))
    force = there(execute(scenario, pushes, scenario.stability.set).max_force())
    alone = [friction, floor, load, position / size, angle]
    return np.array([pushes[0].duration / size**0.5, there(pushes[0].min_margin), force / mass, *alone])


@pytest.mark.parametrize("factors", [(1.0, -1.0, 1.0), (1.0, 1.0, 3.0), (4.0, 1.0, 1.0), (0.25, -1.0, 0.1)])
@pytest.mark.parametrize("seed", [0, 1, 4, 11])
def test_pushes_are_invariant_to_mirror_mass_and_size(seed: int, factors: tuple[float, float, float]) -> None:
    size, side, mass = factors
    scenario, other = _scenario(seed), _scenario(seed, *factors)
    scale = size * np.array([1.0, side, side / size])
    twists = np.random.default_rng(seed).normal((1.0, 0.0, 0.0), (0.2, 0.5, 2.0), (200, 3))
    margins = [one.stable_set().contact_margins(v) for one, v in ((scenario, twists), (other, twists * scale))]
    np.testing.assert_allclose(margins[1], margins[0], atol=1e-8)

    found = plan(scenario, first=True, iterations=20_000, time_limit=60.0)
    path, margin = there(found.path), there(found.margin)
    moved = path.twists * path.lengths[:, None] * scale
    seen = PushPath(path.start * scale, moved / cost_rate(moved)[:, None], cost_rate(moved))
    told = _numbers(scenario, path, margin), _numbers(other, seen, margin, size, mass)
    np.testing.assert_allclose(told[1], told[0], rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_slip_is_invariant_to_mirror_and_position(seed: int) -> None:
    """Objects with two prongs, pushed beyond their cones and past their edges."""
    rng, start = np.random.default_rng(seed), np.array([0.3, -0.2, 1.0])
    twist, seen = rng.normal((1.0, 0.0, 0.0), (0.1, 1.0, 8.0)), []
    for side in (1.0, -1.0):
        mirror, begin = np.array([1.0, side, side]), start if side > 0.0 else np.zeros(3)
        world = World.from_chain(_scenario(seed, side=side, notch=0.02).chain, begin)
        trace = SlipSimulator(world).follow(np.tile(1e-3 * twist * mirror, (200, 1)))
        poses = se2.relative(begin, trace.poses) * mirror
        forces = np.stack([trace.forces[..., :2].sum(axis=2), side * trace.forces[..., 2]])
        seen.append((poses, forces, trace.wrenches * mirror))
    for one, other, tolerance in zip(*seen, (1e-4, 0.05, 0.05), strict=True):
        np.testing.assert_allclose(other, one, atol=tolerance)
    assert (trace.modes == slip.STICK).mean() < 0.8
    assert (forces[0] > 0.0).mean() > 0.3  # contacts are pressed
