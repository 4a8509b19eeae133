"""What executions are judged by: contacts, margins, goal and collisions, whatever the planner claims."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import shapely

from pushplan.geometry.se2 import compose, inverse, rotate
from pushplan.planners.clearance import densify
from pushplan.planners.validator import Validator
from pushplan.plans.execution import Execution
from pushplan.plans.plan import Plan
from pushplan.scenario.model import CircleObstacle, Scenario
from pushplan.util.arrays import FloatArray
from pushplan.util.names import AUTO

CLEARANCE_SPACING = 0.01
"""No point of a body moves farther than this between two poses at which the clearance is measured, m."""

COARSE = 16
"""Every so many of these poses is looked at first, for a bound on the distance."""


def validation_error(plan: Plan, execution: Execution) -> str:
    """Return why an execution does not solve what was asked, empty if it does.

    Args:
        plan: What was planned, with the margin that it says it kept.
        execution: Of it.
    """
    scenario = plan.scenario
    stated = scenario.stability.margin
    required = max(plan.margin or 0.0, 0.0 if stated == AUTO else stated)  # a plan may not lower what is stated
    if execution.min_margin is not None and execution.min_margin <= required:
        return f"the smallest margin is {execution.min_margin:.3g}; it must be above {required:g}"
    if scenario.pusher.limits.contact == "dynamic":
        smallest = execution.min_dynamic_margin
        if smallest is None:
            return "nobody looked at the margins with inertia"
        if smallest <= 0.0:
            return f"the smallest margin with inertia is {smallest:.3g}; it must be above 0"
    position, angle = execution.goal_error
    goals = [goal for task in scenario.tasks for goal in task.goals]
    allowed = min(goal.position_tolerance for goal in goals), min(goal.angle_tolerance for goal in goals)
    if not (position <= allowed[0] and angle <= allowed[1]):
        return f"the goal is missed by {position:.2g} m and {angle:.2g} rad"
    return Validator(scenario).flaw(plan.segments, execution, plan.stable_set)


def _moving(scenario: Scenario, execution: Execution) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield the poses (m, 3) of each body that moves, and its outline (v, 2) in that frame."""
    chain = scenario.tasks[0].chain
    robot = compose(execution.poses, inverse(chain.pusher.plate_pose))
    for body in chain.carried:
        yield robot, body.outline
    objects = {obj.name: obj for task in scenario.tasks for obj in task.chain.objects}
    for k, name in enumerate(execution.names):
        yield execution.objects[:, k], objects[name].outline


def clearance(scenario: Scenario, execution: Execution) -> float | None:
    """Return the smallest distance (m) of the moving bodies from obstacles and walls in an execution.

    None where there is nothing to keep clear of. Measured at poses `CLEARANCE_SPACING` apart, so the true one may be
    smaller by half of that at most.
    """
    found = [np.inf]
    obstacles = shapely.STRtree(
        [
            shapely.Point(one.center).buffer(one.radius, quad_segs=64)
            if isinstance(one, CircleObstacle)
            else shapely.Polygon(one.outline)
            for one in scenario.obstacles
        ]
    )
    for poses, outline in _moving(scenario, execution):
        reach = float(np.linalg.norm(outline, axis=1).max())
        some = densify(_thinned(poses, reach), reach, CLEARANCE_SPACING)
        corners = some[:, None, :2] + rotate(some[:, 2:3], outline[None])
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
        _, rest = obstacles.query_nearest(bodies, max_distance=smallest, return_distance=True, all_matches=False)
        smallest = float(min(rest.min(initial=smallest), smallest))
    return smallest
