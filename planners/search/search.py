"""One search: a planner runs in turns until a stopping condition holds, and its paths are shortened."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from ompl import base as ob
from ompl import util as ou

import pushplan.core.improve as improve
from pushplan.errors import PlanningError
from pushplan.planners.problem import Box
from pushplan.planners.search.form import (
    PushInformation,
    arcs_to_goal,
    free_word,
    leave_path,
    pose_problem,
    push_path,
)
from pushplan.planners.search.session import Session
from pushplan.plans.path import PushPath
from pushplan.util.naming import is_user_code, user_code

Factory = Callable[[Any], Any]
"""Builds an `ompl.base.Planner` from a space information; usually the planner's class."""


class Search:
    """A planner that runs in turns until its session is finished.

    A planner whose attribute `optimizing` is true runs to the end of each turn. Any other planner runs again after
    each of its paths, and is cleared after a growing number of extensions.

    Args:
        session: Session of the search.
        make: Factory of the planner.
        box: (xmin, ymin, xmax, ymax) to sample from, m.
        heading_length: Distance that a turn of one radian counts as, m.
    """

    def __init__(self, session: Session, make: Factory, box: Box, heading_length: float) -> None:
        self.session = session
        self._make, self._box, self._heading_length = make, box, heading_length
        self._planner: Any = None
        self._information: Any = None
        self._definition: Any = None
        self._allowance = self._target = 2_000

    def run(self) -> PushPath | None:
        """Run until the session is finished or its turn is over. Return its best path; None if there is none.

        If a planner was needed, the path is converted to OMPL's form and back.

        Raises:
            PlanningError: If the factory returns no planner, or the planner returns an invalid path.
            ExtensionError: If a user's planner raises another error.
        """
        level = ou.getLogLevel()
        ou.setLogLevel(ou.LOG_NONE)  # reseeding prints an error message without a cause
        try:
            with user_code("planner", self._make):
                return self._run()
        finally:
            ou.setLogLevel(level)

    def _run(self) -> PushPath | None:
        session = self.session
        if self._planner is None:
            ou.RNG.setSeed(session.seed + 1)  # OMPL treats 0 as "no seed"
            word = free_word(session, session.start, session.problem.goal)
            if word is not None:
                session.offer(word)
            # If a free steering path from the start is enough, skip OMPL: this saves 0.1 ms, a seventh of a `Planner`
            # query. A user's planner is always built, so that its errors show.
            if session.finished and isinstance(self._make, type) and not is_user_code(self._make):
                return session.best_path
            self._information, self._definition = pose_problem(session, self._box, self._heading_length)
            self._planner = _made(self._make, self._information)
            self._planner.setProblemDefinition(self._definition)
            self._planner.setup()
        if session.finished:
            return session.best_path
        if getattr(self._planner, "optimizing", False):
            self._go_on()
        else:
            self._run_again_and_again()
        if session.best.arcs is None:
            return None
        leave_path(self._definition, session.best.arcs, self._planner.getName())
        return push_path(self._definition)

    def _go_on(self) -> None:
        self._planner.solve(ob.PlannerTerminationCondition(self.session.over))
        if self._definition.hasExactSolution():
            self.session.take(improve.merged(arcs_to_goal(self._definition)))
        self._information.propagator.note()

    def _run_again_and_again(self) -> None:
        session, propagator = self.session, self._information.propagator
        while not session.over():
            propagator.bound = session.best.bound
            self._planner.solve(ob.PlannerTerminationCondition(_until(session, self._target)))
            if self._definition.hasExactSolution():
                session.offer(arcs_to_goal(self._definition))
            self._definition.clearSolutionPaths()
            if session.finished or session.extensions >= self._target:
                session.refine()
                propagator.note()
                self._planner.clear()
                propagator.clear()
                self._allowance *= 2
                self._target = session.extensions + self._allowance
        propagator.bound = math.inf


def _made(make: Factory, information: PushInformation) -> Any:
    planner = make(information)
    if not isinstance(planner, ob.Planner):
        raise PlanningError(f"a {type(planner).__name__} is not a planner; allowed: an ompl.base.Planner")
    return planner


def _until(session: Session, target: int) -> Callable[[], bool]:
    """Return OMPL's stopping condition: the session is finished or has made `target` extensions."""
    most = session.budget.iterations
    if most is not None:
        target = min(target, session.extensions + most - session.iterations)

    def over() -> bool:
        if session.extensions < target and session.extensions % 16:  # check the clock at every 16th
            return False
        return session.extensions >= target or session.over()

    return over
