"""One search: its best path, what ends it, and how paths get better."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

import pushplan.core.improve as improve
from pushplan.core.problem import GAIN, Objective, Problem, remaining
from pushplan.planners.search.common import Common
from pushplan.plans.path import PushPath
from pushplan.util.arrays import FloatArray


@dataclass(frozen=True)
class StopRule:
    """When a planner stops.

    Attributes:
        time_limit: Wall-clock seconds, at most.
        stall: Stop after this many iterations without a better path, once there is one, and after more where it is
            far above the lower bound (`session.DOUBTFUL`). Runs that end so, not by the time limit, repeat bit by
            bit.
        gap: Stop when the cost exceeds the lower bound by no more than this share.
        first: Stop at the first path.
        iterations: Stop after this many iterations, at most; None sets no limit. Unlike the time limit it ends the
            same search at the same place on every machine.
        enough: Share of the iterations where they are given, else of the time, after which a search that has a path
            is over.
        stop: Asked now and then whether the search has to end at once.
        explaining: Seconds of the time limit that are kept, while there is no path, to find out why.
    """

    time_limit: float
    stall: int = 15_000
    gap: float = 1e-9
    first: bool = False
    iterations: int | None = None
    enough: float = 1.0
    stop: Callable[[], bool] | None = None
    explaining: float = 0.0

    def used(self, seconds: float, iterations: int) -> float:
        """Return the share of the iterations, where they are given, else of the time, that is spent."""
        if self.iterations is None:
            return seconds / self.time_limit if self.time_limit > 0.0 else 1.0
        return iterations / self.iterations

    def is_used_up(self, seconds: float, iterations: int, share: float = 1.0) -> bool:
        """Return whether a share of the iterations or of the time is spent, or all of the time, or `stop` says so."""
        if self.stop is not None and self.stop():
            return True
        if self.iterations is None:
            return seconds >= share * self.time_limit
        return iterations >= share * self.iterations or seconds >= self.time_limit


class Incumbent:
    """The best path so far.

    Args:
        objective: What makes one path better than another.

    Attributes:
        arcs: (k, 4) its twists and lengths, None while there is none.
        value: What the objective says of it; infinite while there is none.
        cost: Its travel, m; infinite while there is none.
    """

    def __init__(self, objective: Objective) -> None:
        self._objective = objective
        self.arcs: FloatArray | None = None
        self.value = self.cost = math.inf

    @property
    def horizon(self) -> float:
        """Cost (m) from which on no path can be better; infinite while there is none.

        That is what its value would buy at the lowest rate, on a single arc.
        """
        return (self.value - self._objective.per_arc) / self._objective.lowest

    @property
    def bound(self) -> float:
        """Cost that a path has to stay below to be better, m."""
        return self.horizon - GAIN

    def value_of(self, arcs: FloatArray) -> float:
        """Return the value of a path (k, 4)."""
        return improve.objective_value(self._objective, arcs)

    def take(self, arcs: FloatArray) -> bool:
        """Keep a path (k, 4) if it is better; return whether it is."""
        offered = self.value_of(arcs)
        if offered >= self.value - GAIN:
            return False
        self.arcs, self.value, self.cost = arcs.copy(), offered, float(np.sum(arcs[:, 3]))
        return True


CHUNK = 128
"""Extensions between two looks at the clock."""

REFINE_CHUNK = 2_000
"""Changes tried on the best path between two rounds of search."""

WORTHWHILE = 1e-3
"""Share of the cost that an improvement has to save to put off the end by stalling."""

DOUBTFUL = 0.5
"""Share above the lower bound from which on a path may well lead through a wrong passage."""

MOST_DOUBT = 2.0
"""Share from which on it makes no difference: the bound may be next to nothing."""

DOUBT = 8.0
"""A search with a path that is doubtful by a share more stalls after 1 + DOUBT times that share as many iterations.

Of 60 runs of 2 s on the three older dense scenes, 93 % so end within 1 % of the best known, none more than 20 % off;
87 % and four without.
"""


class Session:
    """State of a search that planners drive and the caller reads afterwards.

    Args:
        problem: What to plan.
        start: (3,) pose of the chain frame in the world.
        budget: When it is over.
        seed: Of the random numbers.
        on_progress: Called with every better path, its cost (m), the iterations and the seconds until then.
        hopeless: Asked, with the seconds that the search has taken, whether there is no path, as long as none is
            found.
        common: What it has in common with others; None where it is the only one.

    Attributes:
        problem: What to plan.
        start: (3,) pose of the chain frame in the world.
        random: (1,) state of the random generator.
        best: The best path.
        common: What it has in common with other searches.
        stop: What tells planners that the search is over; by default when the budget is used up (`settled`).
    """

    def __init__(
        self,
        problem: Problem,
        start: FloatArray,
        budget: StopRule,
        seed: int,
        on_progress: Callable[[PushPath, float, int, float], None] | None = None,
        hopeless: Callable[[float], bool] | None = None,
        common: Common | None = None,
    ) -> None:
        self.problem = problem
        self.start = np.array(start, dtype=np.float64)
        self.budget = budget
        self.seed = seed
        self.random = np.array([seed], dtype=np.uint64)
        self.best = Incumbent(problem.objective)
        self.common = common or Common(self.start, problem.goal)
        self._turn_ends, self._turn_share = math.inf, 1.0
        self._on_progress, self._hopeless = on_progress, hopeless
        self._worth_beating, self._improved_at = float("inf"), self.iterations
        self._lower_bound, self._refining = 0.0, REFINE_CHUNK
        self._taken: list[tuple[float, PushPath]] = []
        self.stop: Callable[[], bool] = self.settled

    @property
    def extensions(self) -> int:
        """Arcs propagated, by all searches."""
        return self.common.extensions

    @property
    def iterations(self) -> int:
        """Arcs propagated, some as a share of one, and shortcuts tried, by all searches."""
        return self.common.iterations

    @property
    def solved(self) -> bool:
        """Whether there is a path."""
        return self.best.arcs is not None

    @property
    def lower_bound(self) -> float:
        """Cost that no path can beat, m: straight travel and the smallest turn, or a higher one that is known."""
        return max(self._lower_bound, remaining(self.start, self.problem.goal))

    def raise_lower_bound(self, cost: float) -> None:
        """Take over a cost (m) that no path can beat."""
        self._lower_bound = max(self._lower_bound, cost)

    @property
    def best_path(self) -> PushPath | None:
        """The best path, if there is one."""
        return None if self.best.arcs is None else PushPath.of_arcs(self.start, self.best.arcs)

    def near_best(self, shares: Sequence[float]) -> list[PushPath]:
        """Return the first paths whose values exceed the best one's by no more than some shares, the last one first.

        The best path itself is not among them.
        """
        within = ((1.0 + share) * self.best.value for share in shares)
        firsts = {next(k for k, (value, _) in enumerate(self._taken) if value <= most) for most in within}
        return [self._taken[k][1] for k in sorted(firsts, reverse=True) if k < len(self._taken) - 1]

    @property
    def nearest_path(self) -> PushPath:
        """The path that ends nearest to the goal, as long as there is none to it."""
        return PushPath.of_arcs(self.start, self.common.nearest.arcs)

    @property
    def finished(self) -> bool:
        """Whether the search is over."""
        return self.stop()

    def take_turn(self, iterations: float, share: float) -> None:
        """Go on, after the search that had the turn before, until a turn is over or there is a path.

        Args:
            iterations: So many, which takes a search to the same place on every machine.
            share: Of the whole budget, for planners whose iterations take long.
        """
        self._turn_ends, self._turn_share = self.iterations + iterations, share

    @property
    def turn_over(self) -> bool:
        """Whether another search is to go on, as long as there is no path."""
        if self.solved:
            return False
        if self.iterations >= self._turn_ends:
            return True
        return self.budget.is_used_up(self.common.seconds, self.iterations, self._turn_share)

    def over(self) -> bool:
        """Return whether the search or its turn is over."""
        return bool(self.settled() or self.turn_over)  # OMPL takes no other kind

    def settled(self) -> bool:
        """Return whether the budget is used up, nothing is left to gain, or it is known that there is no path."""
        budget, seconds = self.budget, self.common.seconds
        share = budget.enough
        if not self.solved:
            share, seconds = 1.0, seconds + budget.explaining
        if budget.is_used_up(seconds, self.iterations, share):
            return True
        if not self.solved:  # time must not tell where iterations end the search
            return self._hopeless is not None and budget.iterations is None and self._hopeless(self.common.seconds)
        if budget.first or self.best.horizon <= self.lower_bound * (1.0 + budget.gap) + 1e-12:
            return True
        return self.iterations - self._improved_at >= budget.stall * (1.0 + DOUBT * self._doubt())

    def _doubt(self) -> float:
        """Share of the lower bound by which the best path's cost is doubtful."""
        above = self.best.horizon / max(self.lower_bound, 1e-300) - 1.0
        return min(max(above, DOUBTFUL), MOST_DOUBT) - DOUBTFUL

    def note_nearest(self, poses: FloatArray, way_to: Callable[[int], FloatArray]) -> None:
        """While there is no path, keep the way to that one of a tree's poses (n, 3) which is nearest to the goal.

        Args:
            poses: Of its nodes.
            way_to: Returns the arcs (k, 4) from the start to a node, by its number.
        """
        node = -1 if self.solved else self.common.nearest.nearer(poses)
        if node >= 0:
            self.common.nearest.take(way_to(node), poses[node])

    def spent(self, extensions: int, iterations: int | None = None) -> None:
        """Count arcs that were propagated, and iterations: as many, if it is not said."""
        self.common.extensions += extensions
        self.common.iterations += extensions if iterations is None else iterations

    def offer(self, arcs: FloatArray) -> None:
        """Take a path (k, 4) to the goal into account, as it is and polished while it promises to be the best.

        A first path that is all that is wanted is only cut short: that takes less time than its needless arcs do
        when they are timed.
        """
        arcs = improve.merged(arcs)
        self.take(arcs)
        if self.budget.first:
            self.take(improve.cut_short(self.problem, self.start, arcs, self.problem.objective.per_arc))
            return
        before = self.best.value_of(arcs)
        for _ in range(8):
            arcs = self._polished(arcs, 1_000)
            self.take(arcs)
            now = self.best.value_of(arcs)
            # Each round saves less than the one before: from 3 times this round's saving on there is no hope.
            if self.finished or now - 3.0 * (before - now) > self.best.value:
                return
            before = now

    def refine(self) -> None:
        """Go on polishing the best path, if there is one."""
        if self.best.arcs is None or self.budget.first:
            return
        before = self.best.value
        self.take(self._polished(self.best.arcs, self._refining))
        gained = before - self.best.value > WORTHWHILE * before
        self._refining = REFINE_CHUNK if gained else max(REFINE_CHUNK // 8, self._refining // 2)

    def _polished(self, arcs: FloatArray, attempts: int) -> FloatArray:
        chunk = 125  # between two looks at the clock
        for _ in range(0, attempts, chunk):
            if self.finished:
                break
            self.spent(0, chunk)
            arcs = improve.shorten(self.problem, self.start, arcs, self.random, chunk)
        return arcs

    def take(self, arcs: FloatArray) -> None:
        """Keep a path (k, 4) to the goal, free and without empty arcs, if it is better than the best one."""
        if not self.best.take(arcs):
            return
        if self.best.horizon < self._worth_beating * (1.0 - WORTHWHILE):
            self._worth_beating, self._improved_at = self.best.horizon, self.iterations
        path = PushPath.of_arcs(self.start, arcs)
        self._taken.append((self.best.value, path))
        if self._on_progress is not None:
            self._on_progress(path, self.best.cost, self.iterations, self.common.elapsed)
