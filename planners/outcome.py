"""The interface of every search: question, budget and outcome, with the better plans found on the way."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from pushplan.core.collision import Scene
from pushplan.errors import PlanningError
from pushplan.planners.controls import MARGIN_SHARE, MOST_MARGIN
from pushplan.planners.validator import Validator
from pushplan.plans.diagnosis import Diagnosis
from pushplan.plans.path import PushPath
from pushplan.plans.plan import Improvement, Nearest
from pushplan.plans.segment import Segment
from pushplan.plans.settings import Observer, PlanSettings
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray
from pushplan.util.names import AUTO

Segments = tuple[Segment, ...]


@dataclass(frozen=True, eq=False)
class Question:
    """The problem given to a search.

    Attributes:
        scenario: Scenario. It differs from the search's own one only in starts, goals and robot pose.
        validator: Validator of its plans.
        previous: Earlier path of a single push that may still be usable; see `Planner.plan`.
        explain: Whether to diagnose a failure.
    """

    scenario: Scenario
    validator: Validator
    previous: PushPath | None = None
    explain: bool = True


@dataclass(frozen=True)
class Budget:
    """Limits of a search.

    Attributes:
        began: Value of `time.perf_counter` at the beginning.
        time_limit: Time limit, s.
        seed: Seed of the random numbers.
        first: Whether the first plan is enough.
        iterations: Maximum number of iterations.
        gap: Relative gap to the lower bound that is small enough.
    """

    began: float
    time_limit: float
    seed: int
    first: bool = False
    iterations: int | None = None
    gap: float = 0.0

    @classmethod
    def of(cls, settings: PlanSettings, began: float) -> Budget:
        """Return the budget of complete settings, counted from `began`, a value of `time.perf_counter`."""
        limit, seed, gap = settings.time_limit, settings.seed, settings.gap
        if limit is None or seed is None or gap is None:
            raise PlanningError("the settings are not complete; allowed: settings.completed(scenario)")
        return cls(began, limit, seed, settings.first, settings.iterations, gap)

    @property
    def until(self) -> float:
        """Value of `time.perf_counter` at which the time is over."""
        return self.began + self.time_limit


class TaskSearch(ABC):
    """Search for plans in one scenario. Data that do not depend on starts and goals are computed once."""

    @property
    @abstractmethod
    def set_name(self) -> str:
        """Name of the stable set."""

    @abstractmethod
    def with_obstacles(self, scenario: Scenario) -> TaskSearch:
        """Return the search for a scenario that differs only in its obstacles."""

    @abstractmethod
    def search(self, question: Question, budget: Budget, observer: Observer) -> Outcome:
        """Return the best plan found.

        Raises:
            PlanningError: If a start or goal is not free, or there is nothing to push.
            EmptyStableSetError: If no contact can push a load.
        """

    def steering(self) -> Steering:
        """Return the data for collision-free steering paths of a single push.

        Raises:
            PlanningError: If the plate is not in contact at the start.
        """
        raise PlanningError("steering paths exist only for a single push; this robot starts apart from its loads")


@dataclass(frozen=True, eq=False)
class Steering:
    """Data for steering paths of a single push, with the first margin.

    Attributes:
        scene: Collision scene of the chain.
        families: (f, 3, 3) families of twists for the three arcs of a path, scaled to a cost rate of 1.
        stable: Stable set of the twists.
        margin: Lower limit of their margins.
    """

    scene: Scene
    families: FloatArray
    stable: StableSet
    margin: float


@dataclass(frozen=True, eq=False)
class Outcome:
    """Result of a search.

    Attributes:
        candidates: Plans without timing, best first; the fastest one after timing is chosen. Empty if none was found.
        margin_asked: Margin required at first.
        margin: Margin required in the end.
        iterations: Number of iterations.
        improvements: Successively better plans.
        cost: Returns the cost of segments that ranks plans, m.
        lower_bound: Lower bound of the ranking objective, or a function that computes it; None if unknown.
        tree: See `Plan`.
        explain: Returns the reason, the diagnosis and the nearest plan of a failure; called at most once.
        scene: Collision scene of the first push, if it exists already.
        usual_margin: Margin that `stability.margin: auto` requires if the load allows it.
        remarks: See `Plan`.
        undelivered: Reasons why loads do not reach their goals, by name; empty for complete plans.
        proofs: Proofs that some of these loads cannot be delivered.
    """

    candidates: tuple[Segments, ...]
    margin_asked: float
    margin: float
    iterations: int
    improvements: tuple[Improvement, ...]
    cost: Callable[[Segments], float]
    lower_bound: Callable[[Segments], float | None] | float | None = None
    tree: FloatArray = field(default_factory=lambda: np.zeros((0, 2, 3)))
    explain: Callable[[], tuple[str, tuple[Diagnosis, ...], Nearest | None]] | None = None
    scene: Scene | None = None
    usual_margin: float = MOST_MARGIN
    remarks: tuple[str, ...] = ()
    undelivered: Mapping[str, str] = field(default_factory=dict)
    proofs: tuple[Diagnosis, ...] = ()

    @classmethod
    def without_plan(cls, proof: Diagnosis, margin: float) -> Outcome:
        """Return the outcome of a proven failure without a search, with the lowest margin of the search."""
        explanation = proof.text, (proof,), None
        return cls((), margin, margin, 0, (), lambda segments: math.inf, explain=lambda: explanation)

    def remarks_on(self, scenario: Scenario, segments: Segments) -> tuple[str, ...]:
        """Return the remarks on a plan, and the load that does not allow the usual margin of `auto`."""
        margin, pushes = self.margin_asked, [one for one in segments if one.load is not None and one.pushes]
        if scenario.stability.margin != AUTO or margin >= self.usual_margin or not pushes:
            return self.remarks
        load = min(pushes, key=lambda push: push.margin).load
        names = ", ".join(f"'{name}'" for name in load.names) if load is not None else ""
        most = f"no push of {names} has more than {margin / MARGIN_SHARE:.2g}"
        return (f"margin {margin:.2g} instead of {self.usual_margin:.2g}: {most}", *self.remarks)


class Improvements:
    """List of successively better plans, reported to an observer.

    Args:
        observer: Observer of the plans.
        began: Value of `time.perf_counter` at the beginning.
    """

    def __init__(self, observer: Observer, began: float) -> None:
        self._observer, self._began = observer, began
        self.found: list[Improvement] = []

    def add(self, cost: float, iterations: int, segments: Segments = (), seconds: float | None = None) -> None:
        """Add a plan that is better than all before."""
        now = time.perf_counter() - self._began if seconds is None else seconds
        self.found.append(Improvement(now, cost, iterations, segments))
        self._observer.improved(self.found[-1])
