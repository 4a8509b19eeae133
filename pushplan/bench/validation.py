"""What executions are judged by: contacts, margins, goal and collisions, whatever the planner claims."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import shapely

from pushplan.geometry.se2 import rotate
from pushplan.mechanics.body import BodyKind
from pushplan.planners.validation.clearance import Room, densify, find_collision
from pushplan.plans.execution import Execution
from pushplan.plans.result import PlanResult
from pushplan.scenario.model import CircleObstacle, Scenario
from pushplan.util.arrays import FloatArray
from pushplan.util.names import AUTO

CLEARANCE_SPACING = 0.01
"""No point of a body moves farther than this between two poses at which the clearance is measured, m."""

COARSE = 16
"""Every so many of these poses is looked at first, for a bound on the distance."""


def with_kept_margin(scenario: Scenario, result: PlanResult) -> Scenario:
    """Return a scenario that asks for the margin that a plan says it kept, unless it states a number itself."""
    if scenario.stability.margin != AUTO or result.margin is None:
        return scenario
    return scenario.with_margin(result.margin)


def validation_error(scenario: Scenario, execution: Execution) -> str:
    """Return why an execution does not solve a scenario, whose margin is a number, empty if it does."""
    if execution.loss is not None:
        loss = execution.loss
        return f"contact {loss.contact} is lost after {loss.time:.3f} s with a margin of {loss.margin:.3g}"
    if execution.min_margin <= scenario.required_margin:
        return f"the smallest margin is {execution.min_margin:.3g}; it must be above {scenario.required_margin:g}"
    if scenario.chain.pusher.limits.contact == "dynamic":
        smallest = execution.min_dynamic_margin
        if smallest is None:
            return "nobody looked at the margins with inertia"
        if smallest <= 0.0:
            return f"the smallest margin with inertia is {smallest:.3g}; it must be above 0"
    (position, angle), goal = execution.goal_error, scenario.goal
    if not (position <= goal.position_tolerance and angle <= goal.angle_tolerance):
        return f"the goal is missed by {position:.2g} m and {angle:.2g} rad"
    for poses, bodies in _moving(scenario, execution):
        hit = find_collision(scenario, poses, Room.of(scenario).only(bodies))
        if hit is not None:
            other = "a wall of the workspace" if hit.obstacle is None else f"obstacle {hit.obstacle}"
            return f"{hit.body} meets {other} with the chain frame at {hit.pose}"
    return ""


def _moving(scenario: Scenario, execution: Execution) -> Iterator[tuple[FloatArray, tuple[int, ...]]]:
    """Yield poses (m, 3) and the indices of the bodies that move with them: robot and objects may move apart."""
    bodies = scenario.chain.bodies
    objects = tuple(i for i, body in enumerate(bodies) if body.kind is BodyKind.OBJECT)
    if execution.loads is None:
        yield execution.poses, tuple(range(len(bodies)))
    else:
        yield execution.poses, tuple(i for i in range(len(bodies)) if i not in objects)
        yield execution.loads, objects


def clearance(scenario: Scenario, execution: Execution) -> float | None:
    """Return the smallest distance (m) of the moving bodies from obstacles and walls in an execution.

    None where there is nothing to keep clear of. Measured at poses `CLEARANCE_SPACING` apart, so the true one may be
    smaller by half of that at most.
    """
    reach, found = scenario.chain.reach, [np.inf]
    obstacles = shapely.STRtree(
        [
            shapely.Point(one.center).buffer(one.radius, quad_segs=64)
            if isinstance(one, CircleObstacle)
            else shapely.Polygon(one.outline)
            for one in scenario.obstacles
        ]
    )
    for poses, bodies in _moving(scenario, execution):
        some = densify(_thinned(poses, reach), reach, CLEARANCE_SPACING)
        for i in bodies:
            corners = some[:, None, :2] + rotate(some[:, 2:3], scenario.chain.bodies[i].outline[None])
            found.append(_distance(obstacles, shapely.polygons(corners)))
            if (area := scenario.workspace) is not None:
                walls = corners - [area.xmin, area.ymin], [area.xmax, area.ymax] - corners
                found.append(max(0.0, float(min(side.min() for side in walls))))
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


def _distance(obstacles: shapely.STRtree, bodies: object) -> float:
    """Return the smallest distance between obstacles and placed bodies, infinity without obstacles."""
    if not len(obstacles):
        return np.inf
    bodies = np.asarray(bodies)
    _, some = obstacles.query_nearest(bodies[::COARSE], return_distance=True, all_matches=False)
    smallest = float(some.min())
    if smallest > 0.0:  # with a bound, the search passes over most of the other poses quickly
        _, rest = obstacles.query_nearest(
            bodies, max_distance=smallest, return_distance=True, all_matches=False
        )
        smallest = float(min(rest.min(initial=smallest), smallest))
    return smallest
