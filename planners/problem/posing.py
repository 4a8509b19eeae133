"""From a scenario and a stable set to the arrays of the compiled search."""

from __future__ import annotations

import math

import numpy as np

from pushplan.names import CLEARANCE_ROOM
from pushplan.planners.collision.scene import build_scene
from pushplan.planners.collision.separation import Scene, separation
from pushplan.planners.problem.controls import MARGIN_FLOOR, control_segments, steering_families
from pushplan.planners.problem.prices import make_prices
from pushplan.planners.problem.problem import Problem
from pushplan.scenario import CircleObstacle, Scenario
from pushplan.stable_sets.stable_set import StableSet

SLACK = 2e-4
"""Distance beyond the clearance, m, that the poses looked at have, so that those between can be proven to keep it."""

ROUNDING = 1e-9
"""Start and goal may fail by rounding to have the distance they have, m."""

LONGEST_SHARE = 0.3
"""Longest arc sampled, as a share of the sampling box's diagonal."""

Box = tuple[float, float, float, float]


def build_problem(scenario: Scenario, stable: StableSet) -> Problem:
    """Return the compiled problem.

    Raises:
        EmptyStableSetError: When no twist is stable for the pusher's drive.
    """
    drive = scenario.chain.pusher.drive
    margin = scenario.required_margin + MARGIN_FLOOR
    xmin, ymin, xmax, ymax = sampling_box(scenario)
    segments = control_segments(stable, drive, margin)
    return Problem(
        scenario_scene(scenario),
        segments,
        steering_families(segments),
        np.array(scenario.goal.pose_chain, dtype=np.float64),
        LONGEST_SHARE * math.hypot(xmax - xmin, ymax - ymin),
        make_prices(scenario, stable, segments),
    )


def scenario_scene(scenario: Scenario) -> Scene:
    """Return what moves and what stands still in a scenario.

    The poses looked at have `SLACK` more than the scenario's clearance, or what start and goal have if that is less;
    those between have the clearance, less `CLEARANCE_ROOM` at most where start and goal leave no room to prove it.
    """
    circles = [(*o.center, o.radius) for o in scenario.obstacles if isinstance(o, CircleObstacle)]
    polygons = [o.outline for o in scenario.obstacles if not isinstance(o, CircleObstacle)]
    wanted = scenario.clearance + SLACK
    scene = build_scene(scenario.chain, polygons, circles, _walls(scenario), wanted)
    ends = (scenario.start, scenario.goal.pose_chain)
    gaps = [separation(scene, pose[0], pose[1], pose[2], wanted) for pose in ends]
    looked_at = max(min(gaps), scenario.clearance) - ROUNDING
    return scene._replace(clearance=looked_at, kept=min(scenario.clearance, looked_at - CLEARANCE_ROOM))


def _walls(scenario: Scenario) -> Box:
    area = scenario.workspace
    if area is None:
        return (-math.inf, -math.inf, math.inf, math.inf)
    return (area.xmin, area.ymin, area.xmax, area.ymax)


def sampling_box(scenario: Scenario) -> Box:
    """Return (xmin, ymin, xmax, ymax) to sample from: the workspace, or around everything with room to turn."""
    if scenario.workspace is not None:
        return _walls(scenario)
    points = [np.array([scenario.start[:2], scenario.goal.pose_chain[:2]])]
    for obstacle in scenario.obstacles:
        if isinstance(obstacle, CircleObstacle):
            points.append(obstacle.center + obstacle.radius * np.array([[-1.0, -1.0], [1.0, 1.0]]))
        else:
            points.append(obstacle.outline)
    corners = np.concatenate(points)
    room = 4.0 * body_reach(scenario) + 0.25 * float(np.ptp(corners, axis=0).max())
    low, high = corners.min(axis=0) - room, corners.max(axis=0) + room
    return (float(low[0]), float(low[1]), float(high[0]), float(high[1]))


def body_reach(scenario: Scenario) -> float:
    """Return the distance from the chain frame's origin to the farthest point of all that moves, m."""
    return scenario.chain.reach
