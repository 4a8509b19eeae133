"""Laws of mechanics: seen in a mirror, of other masses, or of another size, a push is the same push."""

from dataclasses import astuple
from typing import Any

import numpy as np
import pytest
from conftest import there

import pushplan
from pushplan.planners.planner import plan
from pushplan.planners.timing.segments import time_segments
from pushplan.plans.load import Load
from pushplan.plans.path import PushPath, cost_rate
from pushplan.plans.segment import Segment
from pushplan.scenario.model import Scenario
from pushplan.sim.kinematic import execute
from pushplan.sim.robustness import least_robustness
from pushplan.util.arrays import FloatArray

CHANGES = {
    "mirror": (1.0, -1.0, 1.0),
    "masses": (1.0, 1.0, 3.0),
    "size": (4.0, 1.0, 1.0),
    "smaller": (0.25, 1.0, 1.0),
}
"""Factors of lengths, of what is on the left, and of masses."""

STATED: tuple[dict[str, Any], ...] = (
    {},
    {"uncertainty": {"contact_friction": 0.1, "floor_friction": 0.2}},
    {"uncertainty": {"floor_friction": 0.2}, "stability": {"set": "stable"}},
)


def _scenario(seed: int, size: float = 1.0, side: float = 1.0, mass: float = 1.0) -> Scenario:
    """Two or three random polygons in a row; times grow with the root of lengths, for weight stays as it is."""
    rng, time = np.random.default_rng(seed), size**0.5
    objects = [
        {
            "name": f"object {k}",
            "shape": {"polygon": np.array([[0.0, -a], [b, -c], [b, a], [0.0, c]]) * [size, side * size]},
            "mass": mass * rng.uniform(0.5, 3.0),
            "offset": side * size * rng.uniform(-0.02, 0.02),
        }
        for k in range(2 + seed % 2)
        for a, b, c in [rng.uniform(0.06, 0.12, 3)]
    ]
    ahead = {"speed": 0.2 * time, "acceleration": 0.5, "jerk": 5.0 / time}
    turning = {"angular_speed": 1.0 / time, "angular_acceleration": 2.0 / size, "angular_jerk": 20.0 / time**3}
    document = {
        "format": "pushplan/1",
        "floor": {"friction": 0.3},
        "objects": objects,
        "contacts": {"friction": 0.6},
        "pusher": {"width": 0.3 * size, "thickness": 0.03 * size, "friction": 0.6, "limits": {**ahead, **turning}},
        "goal": [1.0 * size, 0.7 * size * side, 0.9 * side],
        "trajectory": "exact",
        **STATED[seed % len(STATED)],
    }
    return pushplan.scenario_from_document(document)


def _numbers(scenario: Scenario, path: PushPath, margin: float, factors: tuple[float, float, float]) -> FloatArray:
    """What a path comes to, freed from what the factors change."""
    size, _, mass = factors
    push = Segment.push(Load.of(scenario), path, scenario.poses, margin)
    pushes = time_segments(scenario, (push,), 100.0 / size**0.5)
    friction, floor, load, position, angle, _ = astuple(least_robustness(pushes))
    force = there(execute(scenario, pushes, scenario.stability.set).max_force())
    alone = [friction, floor, load, position / size, angle]
    return np.array([pushes[0].duration / size**0.5, there(pushes[0].min_margin), force / mass, *alone])


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("seed", [0, 1, 2, 3, 4, 11])
def test_a_push_keeps_what_does_not_depend_on_how_it_is_seen(seed: int, change: str) -> None:
    size, side, _ = factors = CHANGES[change]
    scenario, other = _scenario(seed), _scenario(seed, *factors)
    scale = size * np.array([1.0, side, side / size])
    twists = np.random.default_rng(seed).normal((1.0, 0.0, 0.0), (0.2, 0.5, 2.0), (200, 3))
    margins = [one.stable_set().contact_margins(v) for one, v in ((scenario, twists), (other, twists * scale))]
    np.testing.assert_allclose(margins[1], margins[0], atol=1e-8)

    found = plan(scenario, first=True, iterations=20_000, time_limit=60.0)
    path, margin = there(found.path), there(found.margin)
    moved = path.twists * path.lengths[:, None] * scale
    seen = PushPath(path.start * scale, moved / cost_rate(moved)[:, None], cost_rate(moved))
    told = [_numbers(scenario, path, margin, CHANGES["mirror"]), _numbers(other, seen, margin, factors)]
    np.testing.assert_allclose(told[1], told[0], rtol=1e-4, atol=1e-6)
