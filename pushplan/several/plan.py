"""Plan several pushes: from a scenario with a place of the robot to timed segments, executed and checked."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pushplan.errors import PlanningError, TimingError
from pushplan.geometry import se2
from pushplan.planners.collision.separation import separation
from pushplan.planners.improve.session import Branches
from pushplan.planners.multi.graph import PushSequence
from pushplan.planners.multi.room import PushRoom, Question
from pushplan.planners.multi.search import Found, Limits, search
from pushplan.planners.problem.problem import SLACK
from pushplan.plans.path import PushPath
from pushplan.plans.result import PlanResult, ProgressPoint
from pushplan.plans.segment import Segment, join_paths
from pushplan.scenario.build import troubles_at
from pushplan.scenario.model import Scenario
from pushplan.several.execution import execute_segments
from pushplan.several.modes import Mode
from pushplan.several.prepared import Prepared
from pushplan.several.reasons import reasons
from pushplan.several.robustness import least_robustness
from pushplan.several.segments import mode_of, segments_of, timed
from pushplan.several.verdict import verdict_on
from pushplan.util.arrays import FloatArray
from pushplan.util.names import DEFAULT_PLANNER, RETREAT, TRANSIT_CLEARANCE
from pushplan.util.stopwatch import Stopwatch

PATIENCE = 0.5
"""Share of what is left of the time that a margin may take without a plan, before a lower one is tried."""


@dataclass(frozen=True, eq=False)
class Asked:
    """How to search, in the words of `pushplan.plan`; None stands for what the scenario says."""

    seed: int | None = None
    time_limit: float | None = None
    first: bool = False
    iterations: int | None = None
    gap: float | None = None
    progress: Callable[[ProgressPoint], None] | None = None
    stop: Callable[[], bool] | None = None


@dataclass(frozen=True, eq=False)
class Outcome:
    """What the searches with one margin after the other came to.

    Attributes:
        room: With the margins of the last one.
        robot: (3,) pose of the robot's frame where that search began.
        found: What it found.
        level: Of its margins.
        seconds: Of all of them.
        progress: The better and better plans.
    """

    room: PushRoom
    question: Question
    found: Found
    level: int
    seconds: float
    progress: tuple[ProgressPoint, ...]


def plan_pushes(prepared: Prepared, asked: Asked, watch: Stopwatch, began: float) -> PlanResult:
    """Return the plan of several pushes for the scenario that `prepared` is for.

    Args:
        prepared: Load and room.
        asked: How to search.
        watch: Takes the time of the phases.
        began: `time.perf_counter` from which the time limit counts.

    Raises:
        PlanningError: When no goal is free, or the load is at one already.
        EmptyStableSetError: When no contact can push the load.
    """
    scenario = prepared.scenario
    goals = free_goals(scenario)
    with watch("search"):
        outcome = _search(prepared, goals, asked, began)
    return checked(prepared, outcome, asked, watch)


def free_goals(scenario: Scenario) -> FloatArray:
    """Return the goals (g, 3) at which the load is free.

    Raises:
        PlanningError: When there are none, or the load is at one already.
    """
    assert scenario.pushes is not None
    free: list[FloatArray] = []
    troubles: list[str] = []
    for goal in scenario.pushes.goals:
        if max(se2.pose_error(scenario.start, goal.pose_chain)) < 1e-7:
            raise PlanningError("the load is at a goal already: there is nothing to push")
        wrong = list(troubles_at(scenario, goal.pose_chain, "goal"))
        troubles += wrong
        if not wrong:
            free.append(goal.pose_chain)
    if not free:
        raise PlanningError("the goal is occupied: " + "; ".join(dict.fromkeys(troubles)))
    return np.array(free)


def _search(prepared: Prepared, goals: FloatArray, asked: Asked, began: float) -> Outcome:
    """Search with one margin after the other until there is a plan."""
    scenario = prepared.scenario
    limit = scenario.planner.time_limit if asked.time_limit is None else asked.time_limit
    gap = scenario.planner.gap if asked.gap is None else asked.gap
    seed = scenario.planner.seed if asked.seed is None else asked.seed
    until, progress = began + limit, _Progress(asked.progress, began)
    share = 0.0
    for level in range(prepared.levels):
        last = level + 1 == prepared.levels
        share = 1.0 if last else share + PATIENCE * (1.0 - share)
        room = prepared.room(level)
        question = Question(backed_off(room, scenario), np.array(scenario.start), goals)
        limits = Limits(until, began + share * limit, asked.first, asked.iterations, gap, asked.stop)
        found = search(room, question, limits, seed, progress.improved)
        if found.best is not None or limits.over(0):
            break
    seconds = time.perf_counter() - began
    return Outcome(room, question, found, level, seconds, tuple(progress.points))


class _Progress:
    """Keeps, and tells of, better and better plans."""

    def __init__(self, tell: Callable[[ProgressPoint], None] | None, began: float) -> None:
        self._tell, self._began = tell, began
        self.points: list[ProgressPoint] = []

    def improved(self, best: PushSequence, looked_at: int) -> None:
        self.points.append(ProgressPoint(time.perf_counter() - self._began, best.cost, looked_at))
        if self._tell is not None:
            self._tell(self.points[-1])


def backed_off(room: PushRoom, scenario: Scenario) -> FloatArray:
    """Return where the robot's frame (3,) is once it is clear of the load: it backs off where it is near at first."""
    robot = scenario.robot_start
    assert scenario.pushes is not None
    enough = max(scenario.clearance, TRANSIT_CLEARANCE) + SLACK
    x, y, theta = se2.relative(scenario.start, robot)
    gap = separation(room.load, x, y, theta, enough)
    return robot if gap >= enough else se2.compose(robot, [-scenario.pushes.retreat, 0.0, 0.0])


def checked(prepared: Prepared, outcome: Outcome, asked: Asked, watch: Stopwatch) -> PlanResult:
    """Time, execute and check what was found; tell why where nothing was."""
    found, room, scenario = outcome.found, outcome.room, prepared.scenario
    seed = scenario.planner.seed if asked.seed is None else asked.seed
    result = PlanResult(
        solved=False,
        reason="",
        planner=DEFAULT_PLANNER,
        stable_set=prepared.modes[0].stable.name,
        seed=seed,
        path=None,
        trajectory=None,
        first_solution_s=outcome.progress[0].seconds if outcome.progress else None,
        planning_s=outcome.seconds,
        progress=outcome.progress,
        extensions=found.looked_at,
        min_margin=None,
        tree=Branches().ends,
        lower_bound=found.lower_bound,
        objective=scenario.planner.cost,
        margin_asked=prepared.margin_asked,
        margin=min(mode.margin(outcome.level) for mode in prepared.modes),
    )
    if found.best is None:
        told = reasons(room, outcome.question, found)
        limit = scenario.planner.time_limit if asked.time_limit is None else asked.time_limit
        words = "; ".join(reason.text for reason in told)
        proven = any(reason.proven for reason in told)
        reason = words if proven else f"no plan found within the time limit of {limit:g} s: {words}"
        return replace(result, reason=reason, diagnosis=told)
    segments = (
        *_backing_off(scenario, outcome.question),
        *segments_of(room, outcome.question.robot, found.best),
    )
    result = replace(
        result,
        segments=segments,
        path=join_paths(segments),
        objective_cost=objective_cost(scenario, segments),
        min_margin=least_margin(segments, prepared.modes),
    )
    return _driven(prepared, result, watch)


def _backing_off(scenario: Scenario, question: Question) -> tuple[Segment, ...]:
    """The retreat with which a robot begins that is near the load at first."""
    start = scenario.robot_start
    length = float(np.linalg.norm(start[:2] - question.robot[:2]))
    if length == 0.0:
        return ()
    path = PushPath(start, np.array([[-1.0, 0.0, 0.0]]), np.array([length]))
    return (Segment(RETREAT, "", 0.0, path, np.zeros(3), scenario.start, scenario.start),)


def objective_cost(scenario: Scenario, segments: tuple[Segment, ...]) -> float:
    """Return what the segments of a plan cost in all, as the search counts it, m."""
    pushes = scenario.pushes
    assert pushes is not None
    count = sum(segment.pushes for segment in segments)
    pushed = sum(segment.path.cost for segment in segments if segment.pushes)
    alone = sum(segment.path.cost for segment in segments if not segment.pushes)
    return pushed + pushes.transit_weight * alone + pushes.switch_cost * (count - 1)


def least_margin(segments: tuple[Segment, ...], modes: tuple[Mode, ...]) -> float:
    """Return the smallest margin of any twist of any push."""
    pushes = [segment for segment in segments if segment.pushes]
    return min(float(mode_of(push, modes).stable.margin(push.path.twists).min()) for push in pushes)


def _driven(prepared: Prepared, result: PlanResult, watch: Stopwatch) -> PlanResult:
    """Return the plan with its trajectory, executed and checked."""
    scenario, modes = prepared.scenario, prepared.modes
    try:
        with watch("timing"):
            segments, trajectory = timed(scenario, result.segments, modes)
    except TimingError as error:
        return _unsolved(result, f"a plan was found that cannot be driven: {error}")
    with watch("execution"):
        execution = execute_segments(scenario, result.stable_set, segments, trajectory, modes)
    with watch("checking"):
        wrong = verdict_on(scenario, segments, trajectory, execution, modes)
    if wrong:
        return _unsolved(result, wrong)
    return replace(
        result,
        solved=True,
        segments=segments,
        trajectory=trajectory,
        execution=execution,
        robustness=lambda: least_robustness(segments, trajectory, modes),
    )


def _unsolved(result: PlanResult, reason: str) -> PlanResult:
    return replace(result, reason=reason, path=None, segments=(), objective_cost=None)
