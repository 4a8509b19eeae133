"""What a search comes to, whichever it is, and the better and better plans on the way."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from pushplan.core.collision import Scene
from pushplan.plans.plan import Diagnosis, Improvement, Nearest
from pushplan.plans.segment import Segment
from pushplan.plans.settings import Observer
from pushplan.util.arrays import FloatArray

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

    @classmethod
    def without_plan(cls, proof: Diagnosis, margin: float) -> Outcome:
        """Return that of a search that need not begin, with the lowest margin that it would have planned with."""
        told = proof.text, (proof,), None
        return cls((), margin, margin, 0, (), lambda segments: math.inf, explain=lambda: told)


class Improvements:
    """Keeps, and tells of, better and better plans.

    Args:
        observer: Who is told.
        began: `time.perf_counter` from which seconds count.
    """

    def __init__(self, observer: Observer, began: float) -> None:
        self._observer, self._began = observer, began
        self.found: list[Improvement] = []

    def add(
        self, cost: float, iterations: int, segments: Segments = (), seconds: float | None = None
    ) -> None:
        """Keep a plan that is better than those before."""
        now = time.perf_counter() - self._began if seconds is None else seconds
        self.found.append(Improvement(now, cost, iterations, segments))
        self._observer.improved(self.found[-1])
