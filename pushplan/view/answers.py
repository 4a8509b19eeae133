"""Answers to drafts, computed in a thread: plan and stable set, or the errors as text."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Generic, TypeVar

import numpy as np

from pushplan.errors import EmptyStableSetError, PlanningError, ScenarioError
from pushplan.planner import Planner
from pushplan.plans.plan import Plan
from pushplan.plans.settings import Observer
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.view.draft import ROBOT, Draft

SEARCH = {"push": 0.5, "multi-push": 2.0, "rearrangement": 5.0}
"""Time limit of the search for a first plan, s. Most take milliseconds, an order of objects takes seconds."""

SHORTENING = 0.02
"""Time limit of shortening the first path of a single push, s; without it, the path has detours."""

POLISHING = {"push": 0.6, "multi-push": 1.5, "rearrangement": 5.0}
"""Time limit of the search for better plans, s."""


@dataclass(frozen=True, eq=False)
class Answer:
    """Answer to a draft.

    Attributes:
        draft: The draft.
        scenario: The draft as a scenario; None if it is not valid.
        stable: Stable set of a single push; None for other scenarios and invalid drafts.
        plan: Plan, solved or not; None if the draft cannot be planned.
        findings: Errors, or reasons why there is no plan, as sentences; empty with a plan.
        stage: Stage of the work: `path`, `timed` or `polished`.
    """

    draft: Draft
    scenario: Scenario | None
    stable: StableSet | None
    plan: Plan | None
    findings: tuple[str, ...]
    stage: str

    @property
    def solved(self) -> bool:
        """Whether there is a plan."""
        return self.plan is not None and self.plan.solved


class Answers:
    """Answers drafts of one scenario; contacts, stable sets and compiled code are cached while the load is the same.

    Args:
        scenario: Initial scenario.
        message: Function that receives messages for the user.

    Raises:
        EmptyStableSetError: If no pusher twist keeps every contact.
    """

    def __init__(self, scenario: Scenario, message: Callable[[str], None] | None = None) -> None:
        self._observer = Observer() if message is None else Observer(message=message)
        self._planner = Planner(scenario, observer=self._observer)
        self._slides = Draft.of(scenario).slides

    def ask(self, draft: Draft, stage: str, stop: Callable[[], bool] | None = None) -> Answer:
        """Return the answer of a stage.

        Args:
            draft: The draft.
            stage: `path` for the first plan, validated but not timed, which takes a tenth of the time; `timed` for
                the first plan with timing, execution and robustness; `polished` for an improved plan.
            stop: Function that returns whether to stop the search.
        """
        try:
            scenario = draft.scenario()
        except ScenarioError as error:
            findings = tuple(finding.text("").lstrip(": ") for finding in error.findings)
            return Answer(draft, None, None, None, findings, stage)
        kind, first = scenario.kind, stage != "polished"
        observer = Observer(self._observer.message, cancelled=stop) if stop is not None else self._observer
        try:
            planner = self._for(draft, scenario)
            load = scenario.load if scenario.task.one_load else None
            goals = None if load is None else np.array([goal.pose_chain for goal in scenario.goals[load.name]])
            ask = partial(
                planner.plan,
                None if load is None else load.start,
                goals,
                robot=None if load is None else draft.poses.get(ROBOT),
                timed=stage != "path",
                observer=observer,
            )
            held = scenario.task.held
            plan = ask(time_limit=SHORTENING, explain=False) if first and held else None
            if plan is None or not plan.solved:
                limit = (SEARCH if first else POLISHING)[kind]
                plan = ask(time_limit=limit, explain=stage != "path", first=first)
        except (EmptyStableSetError, PlanningError) as error:
            return Answer(draft, scenario, None, None, (str(error),), stage)
        stable = planner.stable if held else None
        return Answer(draft, scenario, stable, plan, tuple(plan.why_not), stage)

    def _for(self, draft: Draft, scenario: Scenario) -> Planner:
        """Return a planner for the draft, reusing the preparation of the same load."""
        if not scenario.task.one_load:
            return Planner(scenario, observer=self._observer)
        if not np.array_equal(self._slides, draft.slides):
            self._planner = Planner(scenario, observer=self._observer)
            self._slides = draft.slides
        return self._planner.with_obstacles(scenario.obstacles)


Question = TypeVar("Question")


class Worker(Generic[Question]):
    """A thread that answers the latest question and drops older ones.

    Args:
        answer: Function that is called in the thread with a question, and with a function that returns whether there
            is a newer one.
    """

    def __init__(self, answer: Callable[[Question, Callable[[], bool]], None]) -> None:
        self._answer = answer
        self._changed = threading.Condition()
        self._waiting: list[Question] = []
        self._ended = False
        self.failure: BaseException | None = None
        self._thread = threading.Thread(target=self._work, daemon=True, name="pushplan-view")
        self._thread.start()

    def ask(self, question: Question) -> None:
        """Replace the waiting question."""
        with self._changed:
            self._waiting = [question]
            self._changed.notify()

    def end(self) -> None:
        """End the thread after its current answer."""
        with self._changed:
            self._ended = True
            self._changed.notify()
        self._thread.join()

    def outdated(self) -> bool:
        """Return whether there is a newer question than the current one."""
        return bool(self._waiting) or self._ended

    def idle(self, seconds: float) -> bool:
        """Wait for some seconds or a newer question; return whether there is none."""
        with self._changed:
            return not self._changed.wait_for(self.outdated, seconds)

    @property
    def alive(self) -> bool:
        """Whether the thread still answers questions."""
        return self._thread.is_alive()

    def _work(self) -> None:
        try:
            while True:
                with self._changed:
                    self._changed.wait_for(self.outdated)
                    if self._ended:
                        return
                    question = self._waiting.pop()
                self._answer(question, self.outdated)
        except BaseException as error:  # `Window.wait` raises it
            self.failure = error
