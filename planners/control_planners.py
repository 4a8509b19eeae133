"""OMPL's control planners (RRT, EST, KPIECE1) on the stable set, propagated with exact connections.

OMPL sees a metric embedding of the poses, (x, y, r cos theta, r sin theta), and one more coordinate of
negligible length that carries the row of the tree's node; costs, arcs and exact poses live in the session's
own compiled tree. One call of the propagator covers a whole arc, swept for collisions, and tries the exact
connection from its end.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from ompl import base as ob
from ompl import control as oc
from ompl import util as ou

from pushplan.planners.ompl_poses import bounds
from pushplan.planners.session import Session

ROW_SCALE = 1e-12
"""Length (m) in the embedding of one row of the tree: too small to matter for nearest neighbours."""

OUTSIDE = 1e9
"""First coordinate that marks a state as invalid."""

FIRST_RESTART = 2_000
"""Extensions before the first restart of a tree; doubled at each further one."""

LOOK = 16
"""Extensions between two looks at the clock, as long as there is no new path."""

Box = tuple[float, float, float, float]


def search(session: Session, box: Box, heading_length: float, make: Callable[[Any], Any]) -> None:
    """Run an OMPL control planner until the session is finished, restarting it on a doubling schedule.

    Args:
        session: The search to drive.
        box: (xmin, ymin, xmax, ymax) that OMPL draws its samples from, m.
        heading_length: r of the embedding: the distance that a turn of one radian counts as, m.
        make: Constructor of the planner from a control `SpaceInformation`.
    """
    ou.setLogLevel(ou.LOG_NONE)  # reseeding prints an error that is none
    ou.RNG.setSeed(session.seed + 1)  # OMPL takes 0 for "no seed"
    information, definition = _pose(session, box, heading_length)
    planner = make(information)
    planner.setProblemDefinition(definition)
    planner.setup()
    allowance = FIRST_RESTART
    while not session.finished:
        planner.solve(ob.PlannerTerminationCondition(_until(session, session.extensions + allowance)))
        session.refine()
        planner.clear()
        session.restart()
        allowance *= 2


def _until(session: Session, target: int) -> Callable[[], bool]:
    """Return what tells OMPL, which asks before every extension, that a session is finished or is that far."""
    seen, most = session.best_cost, session.budget.iterations
    if most is not None:
        target = min(target, session.extensions + most - session.iterations)

    def over() -> bool:
        nonlocal seen
        if session.extensions < target and session.extensions % LOOK and session.best_cost == seen:
            return False
        seen = session.best_cost
        return session.extensions >= target or session.finished

    return over


def _pose(session: Session, box: Box, r: float) -> tuple[Any, Any]:
    """Return OMPL's space information and problem definition."""
    space = ob.RealVectorStateSpace(5)
    space.setBounds(bounds([(box[0], box[2]), (box[1], box[3]), (-r, r), (-r, r), (0.0, ROW_SCALE)]))
    diagonal = math.hypot(box[2] - box[0], box[3] - box[1])
    cells = ob.RealVectorOrthogonalProjectionEvaluator(space, [diagonal / 40.0] * 2, [0, 1])
    space.registerDefaultProjection(cells)
    controls = oc.RealVectorControlSpace(space, 3)
    controls.setBounds(bounds([(0.0, 1.0)] * 3))
    information = oc.SpaceInformation(space, controls)
    information.setStatePropagator(_propagator(session, r))
    information.setStateValidityChecker(lambda state: state[0] < OUTSIDE)
    information.setPropagationStepSize(1.0)
    information.setMinMaxControlDuration(1, 1)
    information.setup()
    start, goal = space.allocState(), space.allocState()
    for state, pose in ((start, session.start), (goal, session.problem.goal)):
        state[0:5] = [pose[0], pose[1], r * math.cos(pose[2]), r * math.sin(pose[2]), 0.0]
    definition = ob.ProblemDefinition(information)
    definition.setStartAndGoalStates(start, goal, ROW_SCALE)
    return information, definition


def _propagator(session: Session, r: float) -> Callable[[Any, Any, float, Any], None]:
    """Return the function that OMPL calls for every extension."""
    grow, cos, sin = session.grow, math.cos, math.sin

    def propagate(state: Any, control: Any, duration: float, result: Any) -> None:
        row, x, y, theta = grow(int(state[4] / ROW_SCALE + 0.5), control[0], control[1], control[2])
        if row < 0:
            result[0] = OUTSIDE
            return
        result[0] = x
        result[1] = y
        result[2] = r * cos(theta)
        result[3] = r * sin(theta)
        result[4] = row * ROW_SCALE

    return propagate
