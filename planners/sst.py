"""Stable Sparse RRT (Li, Littlefield and Bekris 2016) as an OMPL planner with a compiled core.

Rounds as in their SST*: each begins anew with witnesses closer together and more extensions, so that costs fall
towards the optimum of the sampled arcs; paths are polished, and every further one has to be cheaper.
"""

from __future__ import annotations

from typing import Any

from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from pushplan.arrays import FloatArray
from pushplan.geometry import se2
from pushplan.planners.ompl_poses import bounds, state_at
from pushplan.planners.session import Session
from pushplan.planners.sparse_rounds import SparseRounds

Box = tuple[float, float, float, float]


def search(session: Session, box: Box, heading_length: float) -> None:
    """Run SST until the session is finished."""
    ou.setLogLevel(ou.LOG_NONE)
    information, definition = _pose(session, box)
    planner = StableSparseRRT(information, session, box, heading_length)
    planner.setProblemDefinition(definition)
    planner.setup()
    planner.solve(ob.PlannerTerminationCondition(lambda: session.finished))


class StableSparseRRT(ob.Planner):  # type: ignore[misc]
    """The planner, as OMPL sees it: its solutions are paths of the poses between the arcs."""

    def __init__(self, information: Any, session: Session, box: Box, heading_length: float) -> None:
        super().__init__(information, "SST")
        self._session, self._box, self._heading_length = session, box, heading_length
        self._information = information

    def solve(self, stop: Any) -> Any:
        """Run rounds until `stop` says so; add the best path to the problem definition."""
        session = self._session
        rounds = SparseRounds(session, self._box, self._heading_length)
        while not stop():
            rounds.run_next(stop)
            session.refine()
        if session.best_arcs is None:
            return ob.PlannerStatus(ob.PlannerStatus.TIMEOUT)
        self.getProblemDefinition().addSolutionPath(self._solution(session.best_arcs))
        return ob.PlannerStatus(ob.PlannerStatus.EXACT_SOLUTION)

    def _solution(self, arcs: FloatArray) -> Any:
        pose, path = self._session.start, og.PathGeometric(self._information)
        path.append(state_at(self._information, pose))
        for arc in arcs:
            pose = se2.compose(pose, se2.exp(arc[:3] * arc[3]))
            path.append(state_at(self._information, pose))
        return path


def _pose(session: Session, box: Box) -> tuple[Any, Any]:
    """Return OMPL's space information and problem definition."""
    space = ob.SE2StateSpace()
    space.setBounds(bounds([(box[0], box[2]), (box[1], box[3])]))
    information = ob.SpaceInformation(space)
    information.setStateValidityChecker(lambda state: True)
    information.setup()
    definition = ob.ProblemDefinition(information)
    ends = (state_at(information, pose) for pose in (session.start, session.problem.goal))
    definition.setStartAndGoalStates(*ends)
    return information, definition
