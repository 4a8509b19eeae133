"""A push problem as OMPL's users know it: state and control space, propagator, checks, start, goal region.

States are poses of the chain frame, SE(2), a turn weighted by the body's reach. Controls are three coordinates in
[0, 1] that chart the stable set (`chart`); one unit of time is one arc.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ompl import base as ob
from ompl import control as oc
from pushplan.errors import PlanningError
from pushplan.planners.improve.session import Session
from pushplan.planners.ompl.propagator import Propagator, wrapped
from pushplan.planners.problem.posing import Box
from pushplan.planners.problem.steering import MAX_WORDS, connect
from pushplan.util.arrays import FloatArray


class PushInformation(oc.SpaceInformation):  # type: ignore[misc]
    """OMPL's space information of a push problem, and what the project's own planners need beyond it.

    Attributes:
        session: The search that it serves.
        box: (xmin, ymin, xmax, ymax) to sample from, m.
        heading_length: Metres that a turn of one radian counts as.
        propagator: Of its arcs.
    """

    def __init__(self, session: Session, box: Box, heading_length: float) -> None:
        space = ob.SE2StateSpace()
        space.setBounds(bounds([(box[0], box[2]), (box[1], box[3])]))
        space.setSubspaceWeight(1, heading_length)
        # Cells in which EST and KPIECE1 count nodes: 40 along the diagonal.
        side = math.hypot(box[2] - box[0], box[3] - box[1]) / 40
        plane = space.getSubspace(0)
        cells = ob.RealVectorOrthogonalProjectionEvaluator(plane, [side, side], [0, 1])
        space.registerDefaultProjection(ob.SubspaceProjectionEvaluator(space, 0, cells))
        controls = oc.RealVectorControlSpace(space, 3)
        controls.setBounds(bounds([(0.0, 1.0)] * 3))
        super().__init__(space, controls)
        self.session, self.box, self.heading_length = session, box, heading_length
        self.propagator = Propagator(session)
        self.setStatePropagator(self.propagator.propagate)
        self.setStateValidityChecker(self.propagator.free)
        self.setMotionValidator(FreeWords(self, session))
        self.setPropagationStepSize(1.0)
        self.setMinMaxControlDuration(1, 1)
        self.setup()

    def admit(self, twist: FloatArray) -> None:
        """Take a stable twist (3,) that may lie between the segments into the chart, as a segment of its own."""
        problem = self.session.problem
        segments = np.vstack([problem.segments, np.tile(twist, 2)])
        self.session.problem = problem._replace(segments=segments)
        self.propagator.take_problem()


class FreeWords(ob.MotionValidator):  # type: ignore[misc]
    """Says of two states whether a free word of stable arcs leads from one to the other."""

    def __init__(self, information: Any, session: Session) -> None:
        super().__init__(information)
        self._session = session

    def checkMotion(self, first: Any, second: Any) -> bool:  # noqa: N802 OMPL's name
        """Return whether there is one."""
        return free_word(self._session, pose_of(first), pose_of(second)) is not None


class WordGoal(ob.GoalSampleableRegion):  # type: ignore[misc]
    """The poses from which a free word of stable arcs leads exactly to the goal; its samples are the goal itself."""

    def __init__(self, information: PushInformation) -> None:
        super().__init__(information)
        self.setThreshold(1e-12)  # OMPL asks for less than that
        self._distance = information.propagator.distance_to_goal
        goal = information.session.problem.goal
        self._goal = (float(goal[0]), float(goal[1]), wrapped(float(goal[2])))

    def sampleGoal(self, state: Any) -> None:  # noqa: N802 OMPL's name
        """Put a state at the goal."""
        x, y, yaw = self._goal
        state.setX(x)
        state.setY(y)
        state.setYaw(yaw)

    def maxSampleCount(self) -> int:  # noqa: N802 OMPL's name
        """Return how many different samples there are."""
        return 1

    def distanceGoal(self, state: Any) -> float:  # noqa: N802 OMPL's name
        """Return 0 in the region, elsewhere the cost of the cheapest word to the goal, m."""
        return self._distance(state)


def pose_problem(session: Session, box: Box, heading_length: float) -> tuple[PushInformation, Any]:
    """Return OMPL's space information and problem definition of a search.

    Args:
        session: The search.
        box: (xmin, ymin, xmax, ymax) that OMPL draws its samples from, m.
        heading_length: Distance that a turn of one radian counts as, m.
    """
    information = PushInformation(session, box, heading_length)
    definition = ob.ProblemDefinition(information)
    definition.addStartState(state_at(information, session.start))
    definition.setGoal(WordGoal(information))
    return information, definition


def free_word(session: Session, begin: FloatArray, end: FloatArray) -> FloatArray | None:
    """Return the arcs (3, 4) of the cheapest free word between two poses (3,), None where all are blocked."""
    problem, arcs = session.problem, np.zeros((3, 4))
    cost, _ = connect(problem.scene, problem.families, begin, end, math.inf, MAX_WORDS, arcs)
    return arcs if cost < math.inf else None


def information_of(definition: Any) -> PushInformation:
    """Return the space information of a push problem's definition.

    Raises:
        PlanningError: When it is that of another problem.
    """
    information = definition.getSpaceInformation()
    if not isinstance(information, PushInformation):
        raise PlanningError("the problem definition is none of a push; allowed: one from pushplan.ompl.pose")
    return information


def bounds(ranges: Sequence[tuple[float, float]]) -> Any:
    """Return OMPL's bounds from the lowest and highest value of each coordinate."""
    made = ob.RealVectorBounds(len(ranges))
    for i, (low, high) in enumerate(ranges):
        made.setLow(i, low)
        made.setHigh(i, high)
    return made


def state_at(information: Any, pose: FloatArray) -> Any:
    """Return a state at a pose (3,), its angle wrapped; the space's states are those of SE(2)."""
    state = information.allocState()
    state.setX(float(pose[0]))
    state.setY(float(pose[1]))
    state.setYaw(wrapped(float(pose[2])))
    return state


def pose_of(state: Any) -> FloatArray:
    """Return the pose (3,) of a state."""
    return np.array([state.getX(), state.getY(), state.getYaw()])
