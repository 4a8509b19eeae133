"""Search for several pushes of one load: intermediate poses, results and the improvement of plans."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from pushplan.core.samples import descend, pushed_at_random, random_descent
from pushplan.geometry import se2
from pushplan.planners.multi.graph import Graph, PushSequence
from pushplan.planners.multi.room import PushRoom, Query
from pushplan.planners.multi.routes import crossings, routes
from pushplan.planners.problem import sampling_box
from pushplan.util.arrays import BoolArray, FloatArray


class Sampler:
    """Sampler of load poses.

    Args:
        room: Robot, load and contacts.
        query: Start and goals.
        changes: (m, m) lower bounds of the cost of contact changes, m.
        firsts: (m,) whether a first push at each contact is possible.
        lasts: (m, g) whether the robot can back off from each contact at each goal.
        seed: Seed of the random numbers.
    """

    def __init__(
        self, room: PushRoom, query: Query, changes: FloatArray, firsts: BoolArray, lasts: BoolArray, seed: int
    ) -> None:
        self._query, self._changes = query, changes
        self._firsts, self._lasts = np.flatnonzero(firsts), np.flatnonzero(lasts.any(axis=1))
        self._modes = [contact.packed for contact in room.contacts]
        self._box, self._most = np.array(sampling_box(room.scenario)), room.scenario.transport.most
        self._random = np.random.default_rng(seed)
        self._state = np.array([seed], dtype=np.uint64)

    def draw(self, count: int, best: PushSequence | None, over: Callable[[], bool]) -> FloatArray:
        """Return at least `count` poses (k, 3), mostly near contact changes of a plan or at the ends of descents.

        Return fewer, but at least one, if `over` returns true first.
        """
        found: list[FloatArray] = []
        if best is not None and len(best.steps) > 1:
            found += self._polished(best)
        while len(found) < count and not (found and over()):
            found += self._some(best)
        return np.array(found)

    def _some(self, best: PushSequence | None) -> list[FloatArray]:
        kind = self._random.random()
        # 30 % near poses of the best plan, 20 % after random pushes, 2 % uniform, the rest at the ends of descents.
        if kind < 0.3 and best is not None and len(best.steps) > 1:
            return [self._near(best.steps[self._random.integers(len(best.steps) - 1)].after)]
        if kind < 0.5:
            return [self._pushed()]
        if kind < 0.52 or self._most < 2:
            low, high = self._box[:2], self._box[2:]
            return [np.append(self._random.uniform(low, high), self._random.uniform(-np.pi, np.pi))]
        return self._descended(math.inf if best is None else best.cost)

    def _near(self, pose: FloatArray) -> FloatArray:
        """Return a random pose near a pose."""
        scale = self._scale()
        step = self._random.normal(size=3) * [scale, scale, 2.0 * scale]
        if self._random.random() < 0.5:
            step[2] = 0.0
        return se2.compose(pose, step)

    def _scale(self) -> float:
        """Return a random scale for moving a pose, m, log-uniformly distributed."""
        return math.exp(self._random.uniform(math.log(1e-3), math.log(0.5)))

    def _pushed(self) -> FloatArray:
        """Return a pose at the end of a random push from the start, or at the beginning of one to a goal."""
        back = self._random.random() < 0.5
        goals = self._query.goals
        pose = goals[self._random.integers(len(goals))] if back else self._query.load
        contact = int(self._random.choice(self._lasts if back else self._firsts))
        return pushed_at_random(self._modes[contact], pose, -1.0 if back else 1.0, self._state)

    def _descended(self, below: float) -> list[FloatArray]:
        """Return the intermediate poses of a descent that ends below a cost, or a random pose after 12 attempts."""
        query = self._query
        for _ in range(12):
            poses = random_descent(
                self._modes,
                query.load,
                query.goals,
                self._firsts,
                self._lasts,
                self._most,
                self._changes,
                below,
                self._state,
            )
            if len(poses):
                return list(poses)
        return [self._pushed()]

    def _polished(self, best: PushSequence) -> list[FloatArray]:
        """Return the poses at which a plan changes the contact, improved by a descent."""
        poses = np.array([step.after for step in best.steps[:-1]])
        ends = np.stack([best.steps[0].before, best.steps[-1].after])
        sequence = np.array([step.contact for step in best.steps])
        descend(self._modes, sequence, ends, poses, self._scale(), 300, self._state)
        return list(poses)


MOST_POSES = 160
"""Maximum number of poses in a graph. Beyond it, a new graph begins with the poses of the best plan."""

CROSSINGS = 40
"""Number of the best crossings that are tried first. Each adds pushes to and from all other poses."""


@dataclass(frozen=True, eq=False)
class Found:
    """Result of a search.

    Attributes:
        best: Best plan; None if there is none.
        lower_bound: Lower bound of any plan's cost, m.
        seconds: Time to the first plan, s; None if there is none.
        batches: Number of pose batches, limited by `Limits.iterations`.
        looked_at: Number of pushes and transits checked.
        arrives: Whether a transit to some contact at the start exists or was not yet ruled out.
        begins: (m,) whether the robot has room to approach each contact at the start.
        leaves: (m,) whether the settling push of each contact is free at the start.
        ends: (m, g) whether the robot has room to back off from each contact at each goal.
    """

    best: PushSequence | None
    lower_bound: float
    seconds: float | None
    batches: int
    looked_at: int
    arrives: bool
    begins: BoolArray
    leaves: BoolArray
    ends: BoolArray


@dataclass(frozen=True)
class Limits:
    """Stopping conditions of a search.

    Attributes:
        until: Value of `time.perf_counter` at which the search stops.
        patience: The value at which it stops if there is no plan.
        first: Whether to stop at the first plan.
        iterations: Maximum number of pose batches.
        gap: Relative gap to the lower bound at which the search stops.
        stop: Returns whether to stop at once.
    """

    until: float
    patience: float = math.inf
    first: bool = False
    iterations: int | None = None
    gap: float = 0.0
    stop: Callable[[], bool] | None = None

    def over(self, batches: int, without_plan: bool = False) -> bool:
        """Return whether the search must stop."""
        spent = self.iterations is not None and batches >= self.iterations
        until = min(self.until, self.patience) if without_plan else self.until
        return spent or time.perf_counter() >= until or (self.stop is not None and self.stop())


def search(
    room: PushRoom,
    query: Query,
    limits: Limits,
    seed: int,
    improved: Callable[[PushSequence, int], None] | None = None,
) -> Found:
    """Search for several pushes.

    Args:
        room: Robot, load and contacts.
        query: Start and goals.
        limits: Stopping conditions.
        seed: Seed of the random numbers.
        improved: Called with every better plan and the batches so far.
    """
    began = time.perf_counter()
    modes = [contact.packed for contact in room.contacts]
    graph = Graph(room, query, seed, partial(limits.over, -1))
    ways = routes(room, query, graph.changes)
    sampler: Sampler | None = None  # most first plans need no sampler
    best: PushSequence | None = None
    first: float | None = None
    batches, waiting = 0, query.goals[:0]
    while True:
        below = math.inf if best is None else best.cost - 1e-6  # the smallest saving that counts, m
        over = partial(limits.over, batches - 1, best is None)
        found = graph.cheapest(below, over)
        if found is not None:
            best = graph.end_near(found)
            best = graph.shorten_transits(best)
            first = time.perf_counter() - began if first is None else first
            if improved is not None:
                improved(best, batches)
        if best is not None and (limits.first or best.cost <= graph.bound * (1.0 + limits.gap)):
            break
        if graph.stuck or limits.over(batches, best is None):
            break
        below = math.inf if best is None else best.cost - 1e-6
        over = partial(limits.over, batches - 1, best is None)
        if batches == 0:
            poses = query.goals[:0]
            for some in crossings(query.load, query.goals, modes):
                poses = _shortest_first(graph, np.concatenate([poses, some]))[:MOST_POSES]
                if over():
                    break
            poses, waiting = poses[:CROSSINGS], poses[CROSSINGS:]
        elif best is None and batches % 2 and len(some := next(ways, query.goals[:0])):
            poses = some
        elif len(waiting):
            poses, waiting = waiting, waiting[:0]
        else:
            firsts = graph.begins & graph.leaves
            sampler = sampler or Sampler(room, query, graph.changes, firsts, graph.ends, seed)
            poses = sampler.draw(12, best, over)
        if batches and len(graph.poses) + len(poses) > MOST_POSES:
            looked_at, graph = graph.looked_at, Graph(room, query, seed + batches, over)
            graph.looked_at += looked_at
            poses = np.array([*poses, *(step.after for step in best.steps[:-1])]) if best is not None else poses
        graph.add(poses, below, over)
        batches += 1
    begins, leaves, ends = graph.begins, graph.leaves, graph.ends
    return Found(best, graph.bound, first, batches, graph.looked_at, graph.arrives, begins, leaves, ends)


def _shortest_first(graph: Graph, poses: FloatArray) -> FloatArray:
    """Return poses (k, 3), sorted by the lower bound of the cost of a plan through them."""
    to, on = graph.lower_bounds(poses)
    return poses[np.argsort(to + on, kind="stable")]
