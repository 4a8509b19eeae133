"""What a search comes to, whichever it is, and the better and better plans on the way."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from pushplan.core.collision import Scene
from pushplan.planners.controls import MARGIN_SHARE, MOST_MARGIN
from pushplan.plans.plan import Diagnosis, Improvement, Nearest
from pushplan.plans.segment import Segment
from pushplan.plans.settings import Observer
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray
from pushplan.util.names import AUTO

Segments = tuple[Segment, ...]


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
