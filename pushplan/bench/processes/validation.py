"""What executions and plans are judged by: collision, margins and goal, whatever the planner claims."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import shapely

from pushplan.geometry.se2 import pose_error, rotate
from pushplan.mechanics.body import BodyKind
from pushplan.planners.validation.clearance import Room, densify, find_collision
from pushplan.plans.execution import Execution
from pushplan.plans.result import PlanResult
from pushplan.scenario.model import CircleObstacle, Obstacle, Scenario
from pushplan.util.arrays import FloatArray
from pushplan.util.names import AUTO

EXACT = 1e-6
"""Goal error (m, rad) of a motion that reaches its goal exactly."""

PATH_SPACING = 0.002
"""Cost between the poses of a path that are checked, m."""

CLEARANCE_SPACING = 0.01
"""No point of a body moves farther than this between two poses at which the clearance is measured, m."""


COARSE = 16
"""Every so many of these poses is looked at first, for a bound."""


def flaw(scenario: Scenario, execution: Execution) -> str:
    """Return why an execution does not solve a scenario, whose margin is a number, empty if it does."""
    if execution.loss is not None:
        loss = execution.loss
        return f"contact {loss.contact} is lost after {loss.time:.3f} s with a margin of {loss.margin:.3g}"
    return (
        _low_margin(scenario, execution.min_margin)
        or _slips_with_inertia(scenario, execution)
        or _missed_goal(scenario, execution.goal_error)
        or next(filter(None, (_collision(scenario, *moving) for moving in _moving(scenario, execution))), "")
    )


def _moving(scenario: Scenario, execution: Execution) -> Iterator[tuple[FloatArray, tuple[int, ...]]]:
    """Yield poses (m, 3) and the indices of the bodies that move with them: objects may go ways of their own."""
    bodies = scenario.chain.bodies
    objects = tuple(i for i, body in enumerate(bodies) if body.kind is BodyKind.OBJECT)
    if execution.loads is None:
        yield execution.poses, tuple(range(len(bodies)))
    else:
        yield execution.poses, tuple(i for i in range(len(bodies)) if i not in objects)
        yield execution.loads, objects


def plan_flaw(scenario: Scenario, result: PlanResult) -> str:
    """Return why a plan does not solve a scenario, empty if it does: from its path and trajectory as they stand."""
    path, trajectory = result.path, result.trajectory
    if path is None or trajectory is None:
        return result.reason
    scenario = with_kept_margin(scenario, result)
    margins = scenario.stable_set(result.stable_set).margin(path.twists)
    fault = _low_margin(scenario, float(margins.min(initial=1.0)))
    for poses in (path.sampled(PATH_SPACING), trajectory.poses):
        fault = fault or _missed_goal(scenario, pose_error(poses[-1], scenario.goal.pose_chain))
        fault = fault or _collision(scenario, poses, tuple(range(len(scenario.chain.bodies))))
    return fault


def exactly(scenario: Scenario) -> Scenario:
    """Return a scenario whose goal counts as reached only within `EXACT`."""
    return replace(scenario, goal=replace(scenario.goal, position_tolerance=EXACT, angle_tolerance=EXACT))


def with_kept_margin(scenario: Scenario, result: PlanResult) -> Scenario:
    """Return a scenario that asks for the margin that a plan says it kept, unless it states a number itself."""
    if scenario.stability.margin != AUTO or result.margin is None:
        return scenario
    return scenario.with_margin(result.margin)


def _slips_with_inertia(scenario: Scenario, execution: Execution) -> str:
    """Return why a contact is not known to hold with inertia; nothing where the scenario leaves inertia out."""
    if scenario.chain.pusher.limits.contact != "dynamic":
        return ""
    smallest = execution.min_dynamic_margin
    if smallest is None:
        return "nobody looked at the margins with inertia"
    return "" if smallest > 0.0 else f"the smallest margin with inertia is {smallest:.3g}; it must be above 0"


def _low_margin(scenario: Scenario, margin: float) -> str:
    if margin > scenario.required_margin:
        return ""
    return f"the smallest margin is {margin:.3g}; it must be above {scenario.required_margin:g}"


def _missed_goal(scenario: Scenario, error: tuple[float, float]) -> str:
    (position, angle), goal = error, scenario.goal
    if position <= goal.position_tolerance and angle <= goal.angle_tolerance:
        return ""
    return f"the goal is missed by {position:.2g} m and {angle:.2g} rad"


def _collision(scenario: Scenario, poses: FloatArray, bodies: tuple[int, ...]) -> str:
    hit = find_collision(scenario, poses, Room.of(scenario).only(bodies))
    if hit is None:
        return ""
    other = "a wall of the workspace" if hit.obstacle is None else f"obstacle {hit.obstacle}"
    return f"{hit.body} meets {other} with the chain frame at {hit.pose}"


def clearance(scenario: Scenario, execution: Execution) -> float | None:
    """Return the smallest distance (m) of the moving bodies from obstacles and walls in an execution.

    None where there is nothing to keep clear of. Measured at poses `CLEARANCE_SPACING` apart, so the true one may be
    smaller by half of that at most.
    """
    reach, found = scenario.chain.reach, [np.inf]
    for poses, bodies in _moving(scenario, execution):
        some = densify(_thinned(poses, reach), reach, CLEARANCE_SPACING)
        for outline in (scenario.chain.bodies[i].outline for i in bodies):
            found += [_to_obstacles(scenario, outline, some), _to_walls(scenario, outline, some)]
    smallest = min(found)
    return None if smallest == np.inf else smallest


def _thinned(poses: FloatArray, reach: float) -> FloatArray:
    """Leave out poses that are nearer to the last one kept than the spacing."""
    steps = np.abs(np.diff(poses, axis=0))
    travel = np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]) + reach * steps[:, 2])])
    bins = np.floor(travel / CLEARANCE_SPACING)
    kept = np.concatenate([[True], bins[1:] > bins[:-1]])
    kept[-1] = True
    return np.asarray(poses[kept])


def _placed(outline: FloatArray, poses: FloatArray) -> FloatArray:
    """Return the corners (m, v, 2) of an outline at poses (m, 3)."""
    corners: FloatArray = poses[:, None, :2] + rotate(poses[:, 2:3], outline[None])
    return corners


def _to_obstacles(scenario: Scenario, outline: FloatArray, poses: FloatArray) -> float:
    if not scenario.obstacles:
        return np.inf
    tree = shapely.STRtree([_standing(obstacle) for obstacle in scenario.obstacles])
    bodies = np.asarray(shapely.polygons(_placed(outline, poses)))
    _, some = tree.query_nearest(bodies[::COARSE], return_distance=True, all_matches=False)
    smallest = float(some.min())
    if smallest > 0.0:  # with a bound, the search passes over most of the other poses quickly
        _, rest = tree.query_nearest(bodies, max_distance=smallest, return_distance=True, all_matches=False)
        smallest = float(min(rest.min(initial=smallest), smallest))
    return smallest


def _standing(obstacle: Obstacle) -> shapely.Polygon:
    if isinstance(obstacle, CircleObstacle):
        return shapely.Point(obstacle.center).buffer(obstacle.radius, quad_segs=64)
    return shapely.Polygon(obstacle.outline)


def _to_walls(scenario: Scenario, outline: FloatArray, poses: FloatArray) -> float:
    area = scenario.workspace
    if area is None:
        return np.inf
    corners = _placed(outline, poses)
    low = corners - [area.xmin, area.ymin]
    high = [area.xmax, area.ymax] - corners
    return max(float(min(low.min(), high.min())), 0.0)
