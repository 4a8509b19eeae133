"""One search: a planner runs, turn after turn, until a condition ends it, and its paths are shortened."""

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
from pushplan.util.naming import code_of_others, is_of_others

Factory = Callable[[Any], Any]
"""Makes an `ompl.base.Planner` from a space information; its class, as a rule."""


class Search:
    """A planner that is run turn after turn, until its session is finished.

    A planner whose attribute `optimizing` is true goes on, in each turn, until it is told to stop. Another one is run
    again after each of its paths, and cleared after ever more extensions.

    Args:
        session: The search to drive.
        make: What makes the planner.
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
        """Go on until the session is finished or its turn is over; return its best path, None without any.

        The path is as it is in OMPL's form where a planner was needed to find it.

        Raises:
            PlanningError: If the planner is none, or it leaves a path that is none.
            ExtensionError: If a user's planner raises anything else.
        """
        level = ou.getLogLevel()
        ou.setLogLevel(ou.LOG_NONE)  # reseeding prints an error that is none
        try:
            with code_of_others("planner", self._make):
                return self._run()
        finally:
            ou.setLogLevel(level)

    def _run(self) -> PushPath | None:
        session = self.session
        if self._planner is None:
            ou.RNG.setSeed(session.seed + 1)  # OMPL takes 0 for "no seed"
            word = free_word(session, session.start, session.problem.goal)
            if word is not None:
                session.offer(word)
            # A free word from the start may be all that was wanted: then nothing is posed, which takes 0.1 ms, a
            # seventh of a question to a `Planner`, but for what shows the faults of a user's planner.
            if session.finished and isinstance(self._make, type) and not is_of_others(self._make):
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
        raise PlanningError(f"a {type(planner).__name__} is no planner; allowed: an ompl.base.Planner")
    return planner


def _until(session: Session, target: int) -> Callable[[], bool]:
    """Return what tells OMPL, which asks before every extension, that a session is finished or is that far."""
    most = session.budget.iterations
    if most is not None:
        target = min(target, session.extensions + most - session.iterations)

    def over() -> bool:
        if session.extensions < target and session.extensions % 16:  # a look at the clock every 16
            return False
        return session.extensions >= target or session.over()

    return over
