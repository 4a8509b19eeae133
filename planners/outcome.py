"""The interface of every search: a question, a budget, and the outcome with the better plans on the way."""

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
    """What a search is asked.

    Attributes:
        scenario: As the one that the search was prepared for, but for starts, goals and the robot's place.
        validator: For plans of that scenario.
        previous: An earlier path of a single push, which may still do; see `Planner.plan`.
        explain: Whether to find out why there is no plan.
    """

    scenario: Scenario
    validator: Validator
    previous: PushPath | None = None
    explain: bool = True


@dataclass(frozen=True)
class Budget:
    """What a search may use up.

    Attributes:
        began: `time.perf_counter` at which the time limit began to count.
        time_limit: Seconds.
        seed: Of the random numbers.
        first: Whether the first plan is enough.
        iterations: Of the search, at most.
        gap: Share above the lower bound that is good enough.
    """

    began: float
    time_limit: float
    seed: int
    first: bool = False
    iterations: int | None = None
    gap: float = 0.0

    @classmethod
    def of(cls, settings: PlanSettings, began: float) -> Budget:
        """Return what complete settings allow, counted from `time.perf_counter` being `began`."""
        limit, seed, gap = settings.time_limit, settings.seed, settings.gap
        if limit is None or seed is None or gap is None:
            raise PlanningError("the settings are not complete; allowed: settings.completed(scenario)")
        return cls(began, limit, seed, settings.first, settings.iterations, gap)

    @property
    def until(self) -> float:
        """`time.perf_counter` at which the time is over."""
        return self.began + self.time_limit


class TaskSearch(ABC):
    """Searches for plans in one scenario; what does not depend on starts and goals is prepared once."""

    @property
    @abstractmethod
    def set_name(self) -> str:
        """Name of the stable set that it plans in."""

    @abstractmethod
    def with_obstacles(self, scenario: Scenario) -> TaskSearch:
        """Return the search for a scenario that differs in what stands in the room only."""

    @abstractmethod
    def search(self, question: Question, budget: Budget, observer: Observer) -> Outcome:
        """Return the best plan that was found.

        Raises:
            PlanningError: If a start or goal is not free, or there is nothing to push.
            EmptyStableSetError: If no contact can push a load.
        """

    def steering(self) -> Steering:
        """Return what collision-free steering paths of a single push are made of.

        Raises:
            PlanningError: If the plate is not in contact at the start.
        """
        raise PlanningError("steering paths: allowed for a single push; this robot stands apart from its loads")


@dataclass(frozen=True, eq=False)
class Steering:
    """Steering paths of a single push, with the first margin.

    Attributes:
        scene: The chain among what stands in the room.
        families: (f, 3, 3) twists that the three arcs of a path may have, scaled to a cost rate of 1.
        stable: The set that they are taken from.
        margin: That they exceed.
    """

    scene: Scene
    families: FloatArray
    stable: StableSet
    margin: float


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a search found.

    Attributes:
        candidates: Plans, not timed, the best one first; the one that is driven fastest counts. None where none was
            found.
        margin_asked: What the twists' margins had to exceed at first.
        margin: What they had to exceed in the end.
        iterations: Of the search.
        improvements: Better and better plans.
        cost: Returns by what plans are compared, of segments, m.
        lower_bound: What no plan beats of what ranks them, or what works it out; None where none is known.
        tree: See `Plan`.
        explain: Returns the reason, the diagnosis and the nearest plan where none was found; called at most once.
        scene: Of the first push, where it is there already.
        usual_margin: What `stability.margin: auto` asks for where the load allows it.
        remarks: See `Plan`.
        undelivered: Why loads do not get to their goals by the candidates, by name; empty for whole plans.
        proofs: That some of these cannot be delivered.
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
        """Return that of a search that need not begin, with the lowest margin that it would have planned with."""
        told = proof.text, (proof,), None
        return cls((), margin, margin, 0, (), lambda segments: math.inf, explain=lambda: told)

    def remarks_on(self, scenario: Scenario, segments: Segments) -> tuple[str, ...]:
        """Return the remarks on a plan, and which load allows no usual margin where `auto` chose it."""
        asked, pushes = self.margin_asked, [one for one in segments if one.load is not None and one.pushes]
        if scenario.stability.margin != AUTO or asked >= self.usual_margin or not pushes:
            return self.remarks
        load = min(pushes, key=lambda push: push.margin).load
        names = ", ".join(f"'{name}'" for name in load.names) if load is not None else ""
        most = f"no push of {names} has more than {asked / MARGIN_SHARE:.2g}"
        return (f"margin {asked:.2g} instead of {self.usual_margin:.2g}: {most}", *self.remarks)


class Improvements:
    """Keeps, and tells of, better and better plans.

    Args:
        observer: Who is told.
        began: `time.perf_counter` from which seconds count.
    """

    def __init__(self, observer: Observer, began: float) -> None:
        self._observer, self._began = observer, began
        self.found: list[Improvement] = []

    def add(self, cost: float, iterations: int, segments: Segments = (), seconds: float | None = None) -> None:
        """Keep a plan that is better than those before."""
        now = time.perf_counter() - self._began if seconds is None else seconds
        self.found.append(Improvement(now, cost, iterations, segments))
        self._observer.improved(self.found[-1])
