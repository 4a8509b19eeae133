"""Lower bounds of cost and time: the highest bound from straight travel, turns and detours."""

from __future__ import annotations

import math

import numpy as np

from pushplan.core.problem import remaining
from pushplan.geometry import se2
from pushplan.planners.infeasible.turn_bound import Price, turn_bound
from pushplan.planners.infeasible.ways import Disc, disc_at, largest_disc, way_around
from pushplan.plans.path import TURN_WEIGHT
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray


def lower_bound(scenario: Scenario, segments: FloatArray, most: float = math.inf) -> float:
    """Return a lower bound (m) of the cost of any path that keeps the clearance.

    Args:
        scenario: The problem.
        segments: (k, 6) stable twists that the pusher can make; see `controls`.
        most: Cost of a known path, m. Only cheaper paths are considered.
    """
    start, goal = scenario.start, scenario.goal.pose_chain
    turn = abs(float(se2.wrap_angle(goal[2] - start[2])))
    bounds = [remaining(start, goal)]
    for disc in _discs(scenario):
        rest = (TURN_WEIGHT - float(np.linalg.norm(disc.center))) * turn
        bounds.append(way_around(scenario, disc, most - rest) + rest)
    return float(max(*bounds, turn_bound(start, goal, segments, most)))


def time_bound(scenario: Scenario, segments: FloatArray, duration: float = math.inf) -> float:
    """Return a lower bound (s) of the time of any path from rest to rest; see `lower_bound`.

    It uses the limits of speed and acceleration, but ignores the jerk and the contacts' limits with inertia.

    Args:
        scenario: The problem.
        segments: (k, 6) stable twists that the pusher can make; see `controls`.
        duration: Duration of a known motion, s.
    """
    limits = scenario.chain.pusher.limits
    speed, turning = (max(limits.both(name)) for name in ("speed", "angular_speed"))
    gain, spin = (max(limits.both(name)) for name in ("acceleration", "angular_acceleration"))
    start, goal = scenario.start, scenario.goal.pose_chain
    around = way_around(scenario, disc_at(scenario.chain.bodies, np.zeros(2)), math.inf)
    # The share of the top speed, max(|v| / speed, |omega| / turning), changes at most at this rate.
    rate = max(gain / speed, spin / turning)
    price, most = Price(speed / turning, 0.0), speed * max(duration - 1.0 / rate, 1.0 / rate)
    bend = max(around, turn_bound(start, goal, segments, most, price))
    return max(
        _from_rest_to_rest(bend, speed, rate * speed),
        _from_rest_to_rest(around, speed, gain),
        _from_rest_to_rest(abs(float(se2.wrap_angle(goal[2] - start[2]))), turning, spin),
    )


def _from_rest_to_rest(length: float, speed: float, gain: float) -> float:
    """Return the least time (s) over a length with a top speed and an acceleration."""
    return length / speed + speed / gain if length >= speed**2 / gain else 2.0 * math.sqrt(length / gain)


def _discs(scenario: Scenario) -> list[Disc]:
    """Return discs around the chain frame's origin and around the largest disc's centre, or a point towards it."""
    chain = scenario.chain
    center = largest_disc(chain.bodies).center
    near = center * min(1.0, TURN_WEIGHT / max(float(np.linalg.norm(center)), 1e-12))
    return [disc_at(chain.bodies, point) for point in (np.zeros(2), near)]
