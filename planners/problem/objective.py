"""What an arc costs under the scenario's `planner.cost`, as a table over the directions of twists.

- `travel`: its length, and `planner.arc_price` for each arc.
- `time`: how long the pusher takes from rest to rest; for a blended trajectory, at full speed, and a share of the
  time to reach it; and for each arc what `planner.arc_price` takes at the pusher's top speed.
- `margin`: its length times 1 + weight (1 - m / m_best), m being the twist's margin and m_best the largest there is.
"""

from __future__ import annotations

import numpy as np

from pushplan.core.problem import MARGIN, PASSING, REST_TO_REST, TRAVEL, Objective
from pushplan.mechanics.sphere import angles_of, twists_at
from pushplan.planners.timing.arc_limits import Bounds, arc_limits, contact_limits_of, motion_bounds
from pushplan.plans.path import cost_rate
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray

GRIDS = {"margin": 129, "time": 33}
"""Longitudes and latitudes of the table; fewer where an entry takes longer."""


def travel_objective(per_arc: float) -> Objective:
    """Return the objective of travel: length counts, and `per_arc` (m) for each arc."""
    return Objective(TRAVEL, per_arc, 1.0, 1.0, np.array([0.0, 1.0, 0.0, 1.0]), np.zeros((2, 2, 3)))


def make_objective(scenario: Scenario, stable: StableSet, segments: FloatArray) -> Objective:
    """Return the objective that a scenario asks for.

    Args:
        scenario: States `planner.cost`, `planner.weight` and how the path will be timed.
        stable: The set of the plan.
        segments: (k, 6) controls; the table covers them.
    """
    cost = scenario.planner.cost
    if cost == "travel":
        return travel_objective(scenario.planner.arc_price)
    length = scenario.chain.characteristic_length
    box, twists = _grid(segments, length, GRIDS[cost])
    table = np.zeros((*twists.shape[:2], 3))
    if cost == "margin":
        margins = stable.margin(twists.reshape(-1, 3)).reshape(twists.shape[:2])
        table[..., 0] = 1.0 + scenario.planner.weight * (1.0 - margins / margins.max())
        per_arc = scenario.planner.arc_price * (1.0 + scenario.planner.weight)
        return Objective(MARGIN, per_arc, float(table[..., 0].min()), length, box, table)
    bounds = motion_bounds(scenario, stable)
    table[:] = _speeds(twists.reshape(-1, 3), bounds).reshape(table.shape)
    blended = scenario.trajectory == "blended"
    per_arc = scenario.planner.arc_price / scenario.chain.pusher.limits.both("speed")[1]
    return Objective(
        PASSING if blended else REST_TO_REST, per_arc, 1.0 / float(table[..., 0].max()), length, box, table
    )


def _grid(segments: FloatArray, length: float, count: int) -> tuple[FloatArray, FloatArray]:
    """Angles (4,) around all controls, and twists (n, n, 3) between them, scaled to a cost rate of 1."""
    longitude, latitude = angles_of(segments.reshape(-1, 3), length)
    pad = 1e-3
    box = np.array([longitude.min() - pad, longitude.max() + pad, latitude.min() - pad, latitude.max() + pad])
    longitudes, latitudes = (np.linspace(low, high, count) for low, high in box.reshape(2, 2))
    twists = twists_at(longitudes[:, None], latitudes, length)
    return box, twists / cost_rate(twists)[..., None]


def _speeds(twists: FloatArray, bounds: Bounds) -> FloatArray:
    """Largest s', s'' and s''' (k, 3) along twists (k, 3)."""
    length = np.full(len(twists), 0.3)  # of a typical arc, m
    found, able = contact_limits_of(twists, length, bounds)
    free = arc_limits(twists, bounds.limits)
    # Where the contacts leave no room for inertia, a hundredth of what the pusher can do.
    speed = np.where(able, found.speed, 0.01 * free.speed)
    slower = np.minimum(found.acceleration, found.deceleration)
    return np.stack([speed, np.where(able, slower, 0.01 * free.acceleration), found.jerk], axis=1)
