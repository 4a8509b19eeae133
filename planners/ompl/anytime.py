"""What the project's own planners have in common: they improve a path until they are told to stop."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

from ompl import base as ob
from pushplan.planners.ompl.posing import PushInformation, information_of
from pushplan.planners.ompl.solution import leave_path


class AnytimePlanner(ob.Planner):  # type: ignore[misc]
    """A planner with a compiled core, as OMPL sees it: its solution is the best path of the search.

    Attributes:
        name: What OMPL calls it.
        optimizing: It goes on until it is told to stop; see `search`.
    """

    name: str
    optimizing = True

    def __init__(self, information: PushInformation) -> None:
        super().__init__(information, self.name)

    def solve(self, stop: Any) -> Any:
        """Improve the best path until `stop` says so; leave it in the problem definition."""
        definition = self.getProblemDefinition()
        information = information_of(definition)
        session = information.session
        session.stop = stop
        try:
            if not stop():
                self.improve(information)
        finally:
            session.stop = session.settled  # OMPL's condition does not outlive the call
        if session.best.arcs is None:
            return ob.PlannerStatus(ob.PlannerStatus.TIMEOUT)
        leave_path(definition, session.best.arcs, self.name)
        return ob.PlannerStatus(ob.PlannerStatus.EXACT_SOLUTION)

    @abstractmethod
    def improve(self, information: PushInformation) -> None:
        """Offer paths to the session until it is finished."""
