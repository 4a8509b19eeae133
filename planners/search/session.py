"""State of one search: its best path, its stopping rule and the improvement of paths."""

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
    """Stopping rule of a search.

    Attributes:
        time_limit: Limit of the wall-clock time, s.
        stall: Number of iterations without a better path after which a search with a path stops. It grows if the path
            is far above the lower bound (`session.DOUBTFUL`). A run that stops this way repeats bit by bit.
        gap: Relative gap to the lower bound at which the search stops.
        first: Whether to stop at the first path.
        iterations: Maximum number of iterations; None for no limit. Unlike the time limit, it stops a search at the
            same point on every machine.
        enough: Share of the budget (iterations if given, else time) after which a search with a path stops.
        stop: Called regularly; returns whether to stop at once.
        explaining: Time reserved for a diagnosis while there is no path, s.
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
        """Return the used share of the budget: of the iterations if given, else of the time."""
        if self.iterations is None:
            return seconds / self.time_limit if self.time_limit > 0.0 else 1.0
        return iterations / self.iterations

    def is_used_up(self, seconds: float, iterations: int, share: float = 1.0) -> bool:
        """Return whether a share of the budget or all of the time is used up, or `stop` returns true."""
        if self.stop is not None and self.stop():
            return True
        if self.iterations is None:
            return seconds >= share * self.time_limit
        return iterations >= share * self.iterations or seconds >= self.time_limit


class Incumbent:
    """The best path so far.

    Args:
        objective: Objective that ranks paths.

    Attributes:
        arcs: (k, 4) twists and lengths; None if there is no path.
        value: Value of the objective; infinite if there is no path.
        cost: Travel, m; infinite if there is no path.
    """

    def __init__(self, objective: Objective) -> None:
        self._objective = objective
        self.arcs: FloatArray | None = None
        self.value = self.cost = math.inf

    @property
    def horizon(self) -> float:
        """Cost (m) at which no path can be better; infinite if there is no path.

        A single arc at the lowest rate with this cost has the value of the best path.
        """
        return (self.value - self._objective.per_arc) / self._objective.lowest

    @property
    def bound(self) -> float:
        """Cost below which a path can be better, m."""
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
"""Number of extensions between two checks of the clock."""

REFINE_CHUNK = 2_000
"""Number of changes tried on the best path between two rounds of search."""

WORTHWHILE = 1e-3
"""Relative saving from which an improvement resets the count of stalled iterations."""

DOUBTFUL = 0.5
"""Relative gap to the lower bound above which a path may lead through a wrong passage."""

MOST_DOUBT = 2.0
"""Relative gap above which the doubt stays constant, because the lower bound may be nearly zero."""

DOUBT = 8.0
"""Factor of the doubt (gap above `DOUBTFUL`) in the stall limit: `stall` (1 + DOUBT doubt) iterations.

Of 60 runs of 2 s on the three older dense scenes, 93 % end within 1 % of the best known cost, and none more than 20 %
above it. Without this factor, 87 % do, and four end more than 20 % above it.
"""


class Session:
    """State of a search. Planners update it, and the caller reads it afterwards.

    Args:
        problem: Push problem.
        start: (3,) pose of the chain frame in the world.
        budget: Stopping rule.
        seed: Seed of the random numbers.
        on_progress: Called with every better path, its cost (m), and the iterations and seconds so far.
        hopeless: Called with the seconds of the search while there is no path; returns whether none exists.
        common: Data shared with other searches; None if there are none.

    Attributes:
        problem: Push problem.
        start: (3,) pose of the chain frame in the world.
        random: (1,) state of the random generator.
        best: Best path.
        common: Data shared with other searches.
        stop: Stopping condition for planners; by default `settled`.
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
        """Number of arcs propagated by all searches."""
        return self.common.extensions

    @property
    def iterations(self) -> int:
        """Number of arcs propagated (some count partly) and shortcuts tried, by all searches."""
        return self.common.iterations

    @property
    def solved(self) -> bool:
        """Whether there is a path."""
        return self.best.arcs is not None

    @property
    def lower_bound(self) -> float:
        """Lower bound of the cost, m: straight travel and the smallest turn, or a higher known bound."""
        return max(self._lower_bound, remaining(self.start, self.problem.goal))

    def raise_lower_bound(self, cost: float) -> None:
        """Raise the lower bound to a cost (m), if that is higher."""
        self._lower_bound = max(self._lower_bound, cost)

    @property
    def best_path(self) -> PushPath | None:
        """The best path; None if there is none."""
        return None if self.best.arcs is None else PushPath.of_arcs(self.start, self.best.arcs)

    def near_best(self, shares: Sequence[float]) -> list[PushPath]:
        """Return for each share the first path within it of the best value, latest first.

        The best path itself is left out.
        """
        within = ((1.0 + share) * self.best.value for share in shares)
        firsts = {next(k for k, (value, _) in enumerate(self._taken) if value <= most) for most in within}
        return [self._taken[k][1] for k in sorted(firsts, reverse=True) if k < len(self._taken) - 1]

    @property
    def nearest_path(self) -> PushPath:
        """The path that ends nearest to the goal, kept while no path reaches it."""
        return PushPath.of_arcs(self.start, self.common.nearest.arcs)

    @property
    def finished(self) -> bool:
        """Whether the search is over."""
        return self.stop()

    def take_turn(self, iterations: float, share: float) -> None:
        """Begin a turn. It ends after some iterations, at a share of the budget, or with a path.

        Args:
            iterations: Iterations of the turn. They take a search to the same point on every machine.
            share: Share of the whole budget, for planners with slow iterations.
        """
        self._turn_ends, self._turn_share = self.iterations + iterations, share

    @property
    def turn_over(self) -> bool:
        """Whether the turn is over without a path, so that another search continues."""
        if self.solved:
            return False
        if self.iterations >= self._turn_ends:
            return True
        return self.budget.is_used_up(self.common.seconds, self.iterations, self._turn_share)

    def over(self) -> bool:
        """Return whether the search or its turn is over."""
        return bool(self.settled() or self.turn_over)  # OMPL accepts only bool

    def settled(self) -> bool:
        """Return whether the budget is used up, no gain is possible, or it is proven that no path exists."""
        budget, seconds = self.budget, self.common.seconds
        share = budget.enough
        if not self.solved:
            share, seconds = 1.0, seconds + budget.explaining
        if budget.is_used_up(seconds, self.iterations, share):
            return True
        if not self.solved:  # a limit of iterations must not depend on time
            return self._hopeless is not None and budget.iterations is None and self._hopeless(self.common.seconds)
        if budget.first or self.best.horizon <= self.lower_bound * (1.0 + budget.gap) + 1e-12:
            return True
        return self.iterations - self._improved_at >= budget.stall * (1.0 + DOUBT * self._doubt())

    def _doubt(self) -> float:
        """Return the relative gap of the best path above `DOUBTFUL`, up to `MOST_DOUBT`."""
        above = self.best.horizon / max(self.lower_bound, 1e-300) - 1.0
        return min(max(above, DOUBTFUL), MOST_DOUBT) - DOUBTFUL

    def note_nearest(self, poses: FloatArray, way_to: Callable[[int], FloatArray]) -> None:
        """While there is no path, keep the path to the tree node nearest to the goal.

        Args:
            poses: (n, 3) poses of the nodes.
            way_to: Returns the arcs (k, 4) from the start to a node, by index.
        """
        node = -1 if self.solved else self.common.nearest.nearer(poses)
        if node >= 0:
            self.common.nearest.take(way_to(node), poses[node])

    def spent(self, extensions: int, iterations: int | None = None) -> None:
        """Count propagated arcs and iterations, by default as many."""
        self.common.extensions += extensions
        self.common.iterations += extensions if iterations is None else iterations

    def offer(self, arcs: FloatArray) -> None:
        """Consider a path (k, 4) to the goal, and polish it while it can still become the best.

        If a first path is enough, it is only cut short. This takes less time than timing its needless arcs.
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
            # Each round saves less than the one before. Give up if 3 times this round's saving is not enough.
            if self.finished or now - 3.0 * (before - now) > self.best.value:
                return
            before = now

    def refine(self) -> None:
        """Polish the best path further, if there is one."""
        if self.best.arcs is None or self.budget.first:
            return
        before = self.best.value
        self.take(self._polished(self.best.arcs, self._refining))
        gained = before - self.best.value > WORTHWHILE * before
        self._refining = REFINE_CHUNK if gained else max(REFINE_CHUNK // 8, self._refining // 2)

    def _polished(self, arcs: FloatArray, attempts: int) -> FloatArray:
        chunk = 125  # between two checks of the clock
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
