"""Table from the types of task and goal of a scenario to its search.

A new goal type with candidate poses (`TaskGoal.candidates`) needs an entry with the search of `Poses`.
"""

from __future__ import annotations

from collections.abc import Callable

from pushplan.errors import PlanningError
from pushplan.planners.outcome import TaskSearch
from pushplan.planners.problem import Posing
from pushplan.planners.push_search import PushSearch
from pushplan.planners.search.planners import planner_named
from pushplan.plans.load import Load
from pushplan.plans.settings import PlanSettings
from pushplan.scenario.goals import Poses, Row, TaskGoal
from pushplan.scenario.model import Scenario
from pushplan.scenario.task import Push, Task, Transport
from pushplan.util.names import DEFAULT_PLANNER, RANKED_BY

Prepare = Callable[[Scenario, PlanSettings, int], TaskSearch]
"""Builds a search from a scenario, complete settings and a number of meridians (see `Planner`)."""


def _push(scenario: Scenario, settings: PlanSettings, meridians: int) -> TaskSearch:
    return PushSearch(Load.of(scenario), scenario, settings, Posing(meridians=meridians))


def _transport(scenario: Scenario, settings: PlanSettings, _: int) -> TaskSearch:
    _require_own_search(scenario, settings)
    # Imported here and below only when needed, because the imports are slow and a single push needs neither.
    if len(scenario.loads) == 1:
        from pushplan.planners.multi.multi_push import MultiPushSearch

        return MultiPushSearch.of(scenario, settings)
    from pushplan.planners.multi.rearrangement import RearrangementSearch

    return RearrangementSearch.of(scenario, settings)


def _row(scenario: Scenario, settings: PlanSettings, _: int) -> TaskSearch:
    _require_own_search(scenario, settings)
    from pushplan.planners.multi.gathering import GatheringSearch

    return GatheringSearch(scenario, settings)


SEARCHES: dict[tuple[type[Task], type[TaskGoal]], Prepare] = {
    (Push, Poses): _push,
    (Transport, Poses): _transport,
    (Transport, Row): _row,
}


def prepare_search(scenario: Scenario, settings: PlanSettings, meridians: int) -> TaskSearch:
    """Return the search for a scenario.

    Args:
        scenario: Scenario of the search.
        settings: Complete settings.
        meridians: See `Planner`.

    Raises:
        PlanningError: If there is no search for goals of these types together, or the settings do not suit it.
        EmptyStableSetError: If no pusher twist keeps every contact.
    """
    task = type(scenario.task)
    found = {SEARCHES.get((task, type(goal))) for goal in scenario.task.goals}
    if len(found) == 1 and (prepare := found.pop()) is not None:
        return prepare(scenario, settings, meridians)
    types = ", ".join(goal.__name__ for of, goal in SEARCHES if of is task)
    given = ", ".join(sorted({type(goal).__name__ for goal in scenario.task.goals})) or "none"
    raise PlanningError(
        f"there is no search for a {task.__name__} with goals of types {given}; allowed: goals of one type of {types}"
    )


def _require_own_search(scenario: Scenario, settings: PlanSettings) -> None:
    """Check that the settings suit a search for several pushes.

    Raises:
        PlanningError: If another planner or another cost is required.
    """
    name, _ = planner_named(settings.planner or scenario.planner.name)
    if name != DEFAULT_PLANNER:
        raise PlanningError(
            f"multi-push plans (robot.start) have their own search, {DEFAULT_PLANNER}; the planner {name!r} is "
            "for a single push"
        )
    if scenario.planner.cost != RANKED_BY:
        raise PlanningError(
            f"multi-push plans (robot.start) are ranked by {RANKED_BY}, with the weights in 'pushes'; "
            f"the cost {scenario.planner.cost!r} is for a single push"
        )
