"""One search: a planner runs until a condition ends it, and its paths are shortened."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from ompl import base as ob
from ompl import util as ou

import pushplan.core.improve as improve
from pushplan.errors import PlanningError, PushplanError
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

Factory = Callable[[Any], Any]
"""Makes an `ompl.base.Planner` from a space information; its class, as a rule."""


def search(session: Session, make: Factory, box: Box, heading_length: float) -> PushPath | None:
    """Run a planner until the session is finished; return its best path as it is in OMPL's form, None without any.

    A planner whose attribute `optimizing` is true goes on until it is told to stop, and is run once. Another one is
    run again after each of its paths, and cleared after ever more extensions.

    Args:
        session: The search to drive.
        make: What makes the planner.
        box: (xmin, ymin, xmax, ymax) to sample from, m.
        heading_length: Distance that a turn of one radian counts as, m.

    Raises:
        PlanningError: When that cannot be made or is no planner, or it leaves a path that is none.
    """
    ou.setLogLevel(ou.LOG_NONE)  # reseeding prints an error that is none
    ou.RNG.setSeed(session.seed + 1)  # OMPL takes 0 for "no seed"
    word = free_word(session, session.start, session.problem.goal)
    if word is not None:
        session.offer(word)
    # A free word from the start may be all that was wanted: then nothing is posed but what shows a planner's faults.
    if session.finished and _is_of_ours(make):
        return session.best_path
    information, definition = pose_problem(session, box, heading_length)
    planner = _made(make, information)
    if session.finished:
        return session.best_path
    planner.setProblemDefinition(definition)
    planner.setup()
    _run(planner, definition, information)
    if session.best.arcs is None:
        return None
    leave_path(definition, session.best.arcs, planner.getName())
    return push_path(definition)


def _is_of_ours(make: Factory) -> bool:
    """Tell whether what makes a planner is a class of OMPL or of this package.

    To pose the problem and make the planner takes 0.1 ms, a seventh of a question to `Queries` that a word answers.
    """
    return isinstance(make, type) and make.__module__.partition(".")[0] in ("ompl", "pushplan")


def _made(make: Factory, information: PushInformation) -> Any:
    try:
        planner = make(information)
    except PushplanError:
        raise
    except Exception as error:
        raise PlanningError(f"the planner cannot be made: {type(error).__name__}: {error}") from error
    if not isinstance(planner, ob.Planner):
        raise PlanningError(f"a {type(planner).__name__} is no planner; allowed: an ompl.base.Planner")
    return planner


def _run(planner: Any, definition: Any, information: PushInformation) -> None:
    """Run a planner again and again until the session is finished."""
    session, propagator, allowance = information.session, information.propagator, 2_000
    if getattr(planner, "optimizing", False):
        planner.solve(ob.PlannerTerminationCondition(session.settled))
        if definition.hasExactSolution():
            session.take(improve.merged(arcs_to_goal(definition)))
        propagator.note()
        return
    target = allowance
    while not session.finished:
        propagator.bound = session.best.bound
        planner.solve(ob.PlannerTerminationCondition(_until(session, target)))
        if definition.hasExactSolution():
            session.offer(arcs_to_goal(definition))
        definition.clearSolutionPaths()
        if session.finished or session.extensions >= target:
            session.refine()
            propagator.note()
            planner.clear()
            propagator.clear()
            allowance *= 2
            target = session.extensions + allowance
    propagator.bound = math.inf


def _until(session: Session, target: int) -> Callable[[], bool]:
    """Return what tells OMPL, which asks before every extension, that a session is finished or is that far."""
    most = session.budget.iterations
    if most is not None:
        target = min(target, session.extensions + most - session.iterations)

    def over() -> bool:
        if session.extensions < target and session.extensions % 16:  # a look at the clock every 16
            return False
        return session.extensions >= target or session.finished

    return over
