"""One planning run: the best path so far, its polishing and the budget, shared by every planner."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator

import numpy as np

from pushplan.arrays import FloatArray
from pushplan.geometry import se2
from pushplan.path import TURN_WEIGHT, PushPath
from pushplan.planners.improve.branches import Branches
from pushplan.planners.improve.budget import Budget
from pushplan.planners.improve.polish import merged, price, shorten
from pushplan.planners.problem.problem import Problem, remaining
from pushplan.result import ProgressPoint

CHUNK = 128
"""Extensions between two looks at the clock."""

POLISH_ATTEMPTS = 1_000
"""Changes tried on every path found."""

POLISH_ROUNDS = 8
"""So many times, at most, as long as it promises to become the best one."""

PROMISE = 3.0
"""It does if its price may fall by so many times what the last round saved."""

REFINE_CHUNK = 2_000
"""Changes tried on the best path between two looks at the clock."""

GAIN = 1e-9
"""A path counts as better when it is cheaper by this much, m."""

SHORTEST_ARC = 1e-10
"""Arcs below this (m of cost) are rounding and are left out."""

WORTHWHILE = 1e-3
"""Share of the cost that an improvement has to save to put off the end by stalling."""


class Session:
    """State of a search that planners drive and the caller reads afterwards.

    Args:
        problem: What to plan.
        start: (3,) pose of the chain frame in the world.
        budget: When it is over.
        seed: Of the random numbers.
        on_progress: Called with every improvement.
        hopeless: Asked, with the seconds that the search has taken, whether there is no path, as long as none is
            found.
        before: The search whose time, extensions, iterations and nearest path count to this one's, if it goes on from
            there.

    Attributes:
        problem: What to plan.
        start: (3,) pose of the chain frame in the world.
        best_arcs: (k, 4) twists and lengths of the best path, None while there is none.
        best_cost: Its cost, m; infinite while there is none.
        bound: Cost that a path has to stay below to be better, m.
        closest_arcs: (k, 4) free path that ends nearest to the goal, kept while there is none to it.
        closest_left: Lower bound on the cost that is missing from there, m.
        progress: Every improvement.
        extensions: Arcs propagated.
        iterations: Arcs propagated, some as a share of one, and shortcuts tried.
        stop: What tells planners that the search is over; by default when the budget is used up (`settled`).
        branches: What is kept of the trees.
    """

    def __init__(
        self,
        problem: Problem,
        start: FloatArray,
        budget: Budget,
        seed: int,
        on_progress: Callable[[ProgressPoint], None] | None = None,
        hopeless: Callable[[float], bool] | None = None,
        before: Session | None = None,
    ) -> None:
        self.problem = problem
        self.start = np.array(start, dtype=np.float64)
        self.budget = budget
        self.seed = seed
        self.random = np.array([seed], dtype=np.uint64)
        self.best_arcs: FloatArray | None = None
        self.best_cost = math.inf
        self.closest_arcs, self.closest_left = np.zeros((0, 4)), self.lower_bound_from(self.start)
        self.progress: list[ProgressPoint] = [] if before is None else list(before.progress)
        self.extensions: int = 0 if before is None else before.extensions
        self.iterations: int = 0 if before is None else before.iterations
        self._best_price, self.bound = math.inf, math.inf
        self._reference, self._improved_at = math.inf, self.iterations
        self._lower_bound, self._refining = 0.0, REFINE_CHUNK
        self._on_progress, self._hopeless = on_progress, hopeless
        self.branches: Branches = Branches() if before is None else before.branches
        if before is not None:  # stable then, stable now: searches go on with lower margins, never higher
            self.closest_arcs, self.closest_left = before.closest_arcs, before.closest_left
        self.began: float = time.perf_counter() if before is None else before.began
        self.stop: Callable[[], bool] = self.settled

    @property
    def lower_bound(self) -> float:
        """Cost that no path can beat, m: straight travel and the smallest turn, or a higher one that is known."""
        return max(self._lower_bound, self.lower_bound_from(self.start))

    def lower_bound_from(self, pose: FloatArray) -> float:
        """Straight travel and the smallest turn from a pose (3,) to the goal, m."""
        return float(remaining(pose[0], pose[1], pose[2], self.problem.goal))

    def raise_lower_bound(self, cost: float) -> None:
        """Take over a cost (m) that no path can beat."""
        self._lower_bound = max(self._lower_bound, cost)

    @property
    def best_path(self) -> PushPath | None:
        """The best path, None while there is none."""
        return None if self.best_arcs is None else self._path(self.best_arcs)

    @property
    def closest_path(self) -> PushPath:
        """The path that ends nearest to the goal, as long as there is none to it."""
        return self._path(self.closest_arcs)

    def _path(self, arcs: FloatArray) -> PushPath:
        arcs = arcs[arcs[:, 3] > SHORTEST_ARC]
        return PushPath(self.start, arcs[:, :3], arcs[:, 3])

    @property
    def horizon(self) -> float:
        """Cost (m) from which on no path can be better than the best one; infinite while there is none.

        That is what its price would buy at the lowest rate, on a single arc.
        """
        prices = self.problem.prices
        return (self._best_price - prices.per_arc) / prices.lowest

    @property
    def elapsed(self) -> float:
        """Wall-clock seconds since the session began."""
        return time.perf_counter() - self.began

    @property
    def finished(self) -> bool:
        """Whether the search is over."""
        return self.stop()

    def settled(self) -> bool:
        """Return whether the budget is used up, nothing is left to gain, or it is known that there is no path."""
        budget = self.budget
        share = budget.patience if self.best_arcs is None else budget.enough
        if budget.is_used_up(self.elapsed, self.iterations, share):
            return True
        if self.best_arcs is None:
            return self._given_up()
        if self.budget.first or self.horizon <= self.lower_bound * (1.0 + self.budget.gap) + 1e-12:
            return True
        return self.iterations - self._improved_at >= self.budget.stall

    def _given_up(self) -> bool:
        """Whether it is known that there is no path; not asked where iterations end the search, as time must not."""
        if self._hopeless is None or self.budget.iterations is not None:
            return False
        return self._hopeless(self.elapsed)

    def nearer(self, poses: FloatArray) -> int:
        """Return which of the poses (n, 3) is nearest to the goal, -1 if another one was nearer or reached it."""
        if self.best_arcs is not None or len(poses) == 0:
            return -1
        turn = np.abs(se2.wrap_angle(self.problem.goal[2] - poses[:, 2]))
        away = np.hypot(*(self.problem.goal[:2] - poses[:, :2]).T) + TURN_WEIGHT * turn
        node = int(np.argmin(away))
        return node if away[node] < self.closest_left - GAIN else -1

    def approach(self, arcs: FloatArray) -> None:
        """Take over a free path (k, 4) that ends nearer to the goal than all before."""
        path = PushPath(self.start, arcs[:, :3], arcs[:, 3])
        self.closest_arcs, self.closest_left = merged(arcs), self.lower_bound_from(path.end)

    def spent(self, extensions: int, share: float = 1.0) -> None:
        """Count arcs that were propagated, each as a share of an iteration."""
        self.extensions += extensions
        self.tried(round(share * extensions))

    def tried(self, changes: int) -> None:
        """Count changes of a path that were tried."""
        self.iterations += changes

    def offer(self, arcs: FloatArray) -> None:
        """Take a path (k, 4) to the goal into account, as it is and polished."""
        self.take(merged(arcs))
        if self.budget.first:
            return
        for polished in self.polishing(self.problem, self.start, arcs):
            self.take(polished)

    def polishing(
        self, problem: Problem, start: FloatArray, arcs: FloatArray, to_beat: float = math.inf
    ) -> Iterator[FloatArray]:
        """Polish a path for as long as it promises to become cheaper than another one; yield it every time.

        Args:
            problem: What the path solves.
            start: (3,) pose where it begins.
            arcs: (k, 4) the path.
            to_beat: Price of the other one, if that is not the best path.
        """
        before = price(problem.prices, arcs)
        for _ in range(POLISH_ROUNDS):
            arcs = self._polished(problem, start, arcs, POLISH_ATTEMPTS)
            yield arcs
            now = price(problem.prices, arcs)
            if self.finished or now - PROMISE * (before - now) > min(to_beat, self._best_price):
                return
            before = now

    def refine(self) -> None:
        """Go on polishing the best path, if there is one."""
        if self.best_arcs is None or self.budget.first:
            return
        before = self._best_price
        self.take(self._polished(self.problem, self.start, self.best_arcs, self._refining))
        gained = before - self._best_price > WORTHWHILE * before
        self._refining = REFINE_CHUNK if gained else max(REFINE_CHUNK // 8, self._refining // 2)

    def _polished(self, problem: Problem, start: FloatArray, arcs: FloatArray, attempts: int) -> FloatArray:
        self.tried(attempts)
        return np.asarray(shorten(problem, start, arcs, self.random, attempts))

    def take(self, arcs: FloatArray) -> None:
        """Keep a path (k, 4) to the goal, free and without empty arcs, if it is better than the best one."""
        arcs_price = price(self.problem.prices, arcs)
        if arcs_price >= self._best_price - GAIN:
            return
        self.best_arcs, self._best_price = arcs.copy(), arcs_price
        self.best_cost = float(arcs[:, 3].sum())
        self.bound = self.horizon - GAIN
        if self.horizon < self._reference * (1.0 - WORTHWHILE):
            self._reference, self._improved_at = self.horizon, self.iterations
        self.progress.append(ProgressPoint(self.elapsed, self.best_cost, self.iterations, self.best_path))
        if self._on_progress is not None:
            self._on_progress(self.progress[-1])
