"""The search for several pushes: what it finds, its lower bound, and how it goes on to better plans."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from pushplan.planners.multi.graph import Graph, PushSequence
from pushplan.planners.multi.room import PushRoom, Question
from pushplan.planners.multi.samples import Sampler, crossings
from pushplan.util.arrays import BoolArray, FloatArray

MOST_POSES = 160
"""More are let go of, those first through which a plan can be least good."""


CROSSINGS = 40
"""So many of the poses where straight pushes cross are tried at first: each adds pushes to and from all others."""


DEAR = 3.0
"""A first plan that costs so much more than its bound, m, is taken only after more effort was spent on ways
that were not found."""


@dataclass(frozen=True, eq=False)
class Found:
    """What a search came to.

    Attributes:
        best: The best plan, None without any.
        lower_bound: Cost that no plan beats, m.
        seconds: Until the first plan, None without any.
        looked_at: Pushes and ways that were looked at.
        arrives: The robot found a way to some contact at the start, or none was looked for.
        begins: (m,) whether the robot has room to drive to each contact at the start.
        leaves: (m,) whether the settling push of each contact is free at the start.
        ends: (m, g) whether it has room to back off from each contact at each goal.
    """

    best: PushSequence | None
    lower_bound: float
    seconds: float | None
    looked_at: int
    arrives: bool
    begins: BoolArray
    leaves: BoolArray
    ends: BoolArray


@dataclass(frozen=True)
class Limits:
    """When a search ends.

    Attributes:
        until: `time.perf_counter` at which it is over.
        patience: The same while there is no plan.
        first: The first plan is enough.
        iterations: Batches of poses, at most.
        gap: Share above the lower bound at which a plan is good enough.
        stop: Asked whether to end at once.
    """

    until: float
    patience: float = math.inf
    first: bool = False
    iterations: int | None = None
    gap: float = 0.0
    stop: Callable[[], bool] | None = None

    def over(self, batches: int, without_plan: bool = False) -> bool:
        """Whether there is no more time."""
        spent = self.iterations is not None and batches >= self.iterations
        until = min(self.until, self.patience) if without_plan else self.until
        return spent or time.perf_counter() >= until or (self.stop is not None and self.stop())


def search(
    room: PushRoom,
    question: Question,
    limits: Limits,
    seed: int,
    improved: Callable[[PushSequence, int], None] | None = None,
) -> Found:
    """Search for several pushes.

    Args:
        room: Robot, load and contacts.
        question: From where to where.
        limits: When to end.
        seed: Of the random numbers.
        improved: Called with every better plan and the pushes and ways looked at so far.
    """
    began = time.perf_counter()
    modes = [contact.packed for contact in room.contacts]
    graph = Graph(room, question, seed)
    sampler = Sampler(room, question, graph.changes, graph.begins & graph.leaves, graph.ends, seed)
    best: PushSequence | None = None
    first: float | None = None
    batches, waiting = 0, question.goals[:0]
    while True:
        below = math.inf if best is None else best.cost - 1e-6  # the smallest saving that counts, m
        found = graph.cheapest(below, partial(limits.over, batches - 1, best is None))
        if found is not None:
            best = graph.end_near(found)
            best = graph.shorten_transits(best)
            first = time.perf_counter() - began if first is None else first
            if improved is not None:
                improved(best, graph.looked_at)
        if best is not None and limits.first and best.cost > graph.bound + DEAR and graph.try_harder(1):
            continue
        if best is not None and (limits.first or best.cost <= graph.bound * (1.0 + limits.gap)):
            break
        if graph.stuck or limits.over(batches, best is None):
            break
        if best is None:
            graph.try_harder()
        below = math.inf if best is None else best.cost - 1e-6
        if batches == 0:
            poses = _shortest_first(graph, crossings(question.load, question.goals, modes))
            poses, waiting = poses[:CROSSINGS], poses[CROSSINGS:]
        else:
            poses, waiting = (waiting, waiting[:0]) if len(waiting) else (sampler.draw(12, best), waiting)
        if batches and len(graph.poses) + len(poses) > MOST_POSES:
            graph.forget(MOST_POSES // 2, below)
        graph.add(poses, below)
        batches += 1
    return Found(best, graph.bound, first, graph.looked_at, graph.arrives, graph.begins, graph.leaves, graph.ends)


def _shortest_first(graph: Graph, poses: FloatArray) -> FloatArray:
    """Return poses (k, 3), those first through which a plan may cost least."""
    to, on = graph.lower_bounds(poses)
    return poses[np.argsort(to + on, kind="stable")]
