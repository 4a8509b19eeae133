"""What a draft leads to: its stable set and plan, or what is wrong with it in words."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pushplan.errors import EmptyStableSetError, PlanningError, ScenarioError
from pushplan.plan import plan
from pushplan.plans.result import PlanResult
from pushplan.queries import Queries
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.view.draft import Draft

SEARCH = 0.5
"""Time limit of a search for the first path, s: most are found in milliseconds."""

POLISHING = 0.6
"""Time limit of the search for better paths, s."""


@dataclass(frozen=True, eq=False)
class Answer:
    """What there is to show of a draft.

    Attributes:
        draft: Which.
        scenario: The draft as a scenario; None when it is none.
        stable: The set that was planned in; None where there is none.
        result: The plan; None when it cannot be asked for.
        findings: What is wrong, or why there is no plan, in sentences; empty when there is a plan.
        stage: How far the work has come: `path`, `timed` or `polished`.
    """

    draft: Draft
    scenario: Scenario | None
    stable: StableSet | None
    result: PlanResult | None
    findings: tuple[str, ...]
    stage: str

    @property
    def solved(self) -> bool:
        """Whether there is a plan."""
        return self.result is not None and self.result.solved


class Answers:
    """Answers drafts of one scenario; stable set, controls and compiled code are kept as long as the chain is.

    Args:
        scenario: With which all begins.
        tell: Called with sentences for the user about what takes long.

    Raises:
        EmptyStableSetError: When no pusher twist keeps every contact.
    """

    def __init__(self, scenario: Scenario, tell: Callable[[str], None] | None = None) -> None:
        self._queries = Queries(scenario, tell=tell)
        self._slides = np.zeros(len(scenario.chain.objects))

    def path(self, draft: Draft) -> Answer:
        """Return the first path, checked but not timed; it takes a tenth of the time of a timed one."""
        return self._ask(draft, timed=False)

    def timed(self, draft: Draft) -> Answer:
        """Return the first path, timed and executed, with what it tolerates; or why there is none."""
        return self._ask(draft, timed=True)

    def polished(self, answer: Answer, stop: Callable[[], bool]) -> Answer:
        """Return a better plan for an answer with a scenario; it ends when `stop` says so."""
        assert answer.scenario is not None
        result = plan(answer.scenario, time_limit=POLISHING, stop=stop)
        return Answer(answer.draft, answer.scenario, answer.stable, result, tuple(result.why_not), "polished")

    def _ask(self, draft: Draft, timed: bool) -> Answer:
        stage = "timed" if timed else "path"
        try:
            scenario = draft.scenario()
        except ScenarioError as error:
            findings = tuple(finding.text("").lstrip(": ") for finding in error.findings)
            return Answer(draft, None, None, None, findings, stage)
        try:
            queries = self._for(draft, scenario)
            start, goal = scenario.start, scenario.goal.pose_chain
            result = queries.plan(start, goal, timed=timed, time_limit=SEARCH, explain=timed)
        except (EmptyStableSetError, PlanningError) as error:
            return Answer(draft, scenario, None, None, (str(error),), stage)
        return Answer(draft, scenario, queries.stable, result, tuple(result.why_not), stage)

    def _for(self, draft: Draft, scenario: Scenario) -> Queries:
        """Return queries about the draft's chain in its room."""
        if not np.array_equal(self._slides, draft.slides):
            self._queries = Queries(scenario)
            self._slides = draft.slides
        return self._queries.with_obstacles(scenario.obstacles)
