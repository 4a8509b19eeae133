"""What an arc costs under the scenario's `planner.cost`, as a table over the directions of twists.

- `travel`: its length, and `planner.arc_price` for each arc.
- `time`: how long the pusher takes from rest to rest; for a blended trajectory, at full speed, and a share of the
  time to reach it; and for each arc what `planner.arc_price` takes at the pusher's top speed.
- `margin`: its length times 1 + weight (1 - m / m_best), m being the twist's margin and m_best the largest there is.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pushplan.compiled import no_refcount
from pushplan.compiled.scratch import scratch
from pushplan.mechanics.sphere import angles_of, twists_at
from pushplan.planners.timing.arc_limits import Bounds, arc_limits, contact_limits_of, motion_bounds
from pushplan.plans.path import cost_rate
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray

TRAVEL, MARGIN, REST_TO_REST, PASSING = 0, 1, 2, 3
"""Kinds of objectives."""

GAIN = 1e-9
"""What is better by less, in the unit of the objective (m or s), is taken for rounding; not tuned."""

GRIDS = {"margin": 129, "time": 33}
"""Longitudes and latitudes of the table; fewer where an entry takes longer."""


class Objective(NamedTuple):
    """What paths are ranked by; the table holds, for twists scaled to a cost rate of 1, what the kind needs.

    Attributes:
        kind: `TRAVEL` (no table), `MARGIN` (rate), `REST_TO_REST` or `PASSING` (top s', s'' and s''').
        per_arc: Value of an arc beside its length.
        lowest: Smallest value of a metre of arc.
        length: Characteristic length of the twist sphere, m.
        box: (4,) first and last longitude, first and last latitude of the table, rad.
        table: (n, n, 3) by longitude and latitude.
    """

    kind: int
    per_arc: float
    lowest: float
    length: float
    box: FloatArray
    table: FloatArray


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


@no_refcount
def _look_up(objective: Objective, vx: float, vy: float, omega: float, found: FloatArray) -> None:
    """Fill `found` (3,) with the table's values for a twist, interpolated."""
    n = objective.table.shape[0]
    box = objective.box
    u = (math.atan2(vy, vx) - box[0]) / (box[1] - box[0]) * (n - 1)
    w = (math.atan2(objective.length * omega, math.hypot(vx, vy)) - box[2]) / (box[3] - box[2]) * (n - 1)
    i, j = min(max(int(u), 0), n - 2), min(max(int(w), 0), n - 2)
    a, b = min(max(u - i, 0.0), 1.0), min(max(w - j, 0.0), 1.0)
    for k in range(3):
        low = (1.0 - b) * objective.table[i, j, k] + b * objective.table[i, j + 1, k]
        high = (1.0 - b) * objective.table[i + 1, j, k] + b * objective.table[i + 1, j + 1, k]
        found[k] = (1.0 - a) * low + a * high


@no_refcount
def rest_to_rest_time(length: float, speed: float, acceleration: float, jerk: float) -> float:
    """Return the shortest time (s) over a length from rest to rest with bounds on three derivatives."""
    if speed * jerk >= acceleration * acceleration:
        rise = speed / acceleration + acceleration / jerk
    else:
        rise = 2.0 * math.sqrt(speed / jerk)
    if length >= speed * rise:
        return length / speed + rise
    ramp = acceleration / jerk
    if length >= 2.0 * ramp * ramp * acceleration:  # the acceleration is reached, the speed is not
        peak = 0.5 * acceleration * (math.sqrt(ramp * ramp + 4.0 * length / acceleration) - ramp)
        return float(2.0 * (peak / acceleration + ramp))
    return float(4.0 * (0.5 * length / jerk) ** (1.0 / 3.0))


@no_refcount
def arc_value(objective: Objective, vx: float, vy: float, omega: float, length: float) -> float:
    """Return the value of an arc of a twist scaled to a cost rate of 1."""
    if objective.kind == TRAVEL:
        return length + objective.per_arc
    found = scratch(1, 3)[0]
    _look_up(objective, vx, vy, omega, found)
    if objective.kind == MARGIN:
        return float(length * found[0] + objective.per_arc)
    if objective.kind == REST_TO_REST:
        return float(rest_to_rest_time(length, found[0], found[1], found[2]) + objective.per_arc)
    # A blended corner costs 2 % of the time from rest to full speed.
    step = found[0] / found[1] + found[1] / found[2]
    return float(length / found[0] + 0.02 * step + objective.per_arc)
