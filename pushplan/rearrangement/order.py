"""In which order pieces go to their goals, and which of them have to get out of the way first.

A depth-first search over situations. A piece is brought to its goal only where every other one that is left keeps a
plan of its own (or waits for another piece to leave its goal); where none can be, one that is in the way is put
somewhere from where the rest goes on. As few are as possible. What is spent on each plan grows while there is
no order.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np

from pushplan.planners.multi.search import Limits
from pushplan.rearrangement.parking import parking
from pushplan.rearrangement.pieces import Errand, Piece, Situation, errand
from pushplan.scenario.parts import Goal

STAGES = ((1, 0), (1, 1), (4, 1), (16, 1), (4, 2), (16, 2), (16, 3), (64, 3), (256, 6))
"""How many batches of poses the search for one errand may take, and how often pieces are put out of the way in all,
at most, one after the other while there is no order.

Batches, not seconds: the same seed finds the same order, however busy the machine is.
"""

PLACES = 4
"""Places that are tried for a piece that is in the way."""

NEAR = 0.8
"""A piece nearer than this (m) to another, or to its goal, may be in its way."""


class Order:
    """The search for an order.

    Args:
        pieces: All that can be pushed.
        seed: Of the random numbers.
        until: `time.perf_counter` at which it is over.
        stop: Asked whether to end at once.

    Attributes:
        looked_at: Errands that were searched for.
    """

    def __init__(
        self, pieces: tuple[Piece, ...], seed: int, until: float, stop: Callable[[], bool] | None = None
    ) -> None:
        self._pieces, self._seed, self._until, self._stop = pieces, seed, until, stop
        self._random = np.random.default_rng(seed)
        self._patience = STAGES[0][0]
        self._known: dict[tuple[object, ...], Errand | None] = {}
        self.looked_at = 0

    def find(self, now: Situation) -> tuple[Errand, ...] | None:
        """Return errands that bring every piece that is left to a goal, None where none were found in time."""
        for self._patience, relocations in STAGES:
            self._known = {key: one for key, one in self._known.items() if one is not None}
            found = self._go_on(now, relocations)
            if found is not None or self._over():
                return found
        return None

    def _over(self) -> bool:
        return time.perf_counter() >= self._until or (self._stop is not None and self._stop())

    def _go_on(self, now: Situation, relocations: int) -> tuple[Errand, ...] | None:
        if not now.left:
            return ()
        for step in self._deliveries(now):
            after = step.after(now)
            if self._over():
                return None
            if all(self._is_open(after, k) for k in after.left):
                rest = self._go_on(after, relocations)
                if rest is not None:
                    return (step, *rest)
        return self._make_way(now, relocations) if relocations else None

    def _deliveries(self, now: Situation) -> list[Errand]:
        """Return the errands that bring a piece to a goal now, cheapest first."""
        found = [self._delivery(now, k) for k in sorted(now.left)]
        return sorted((one for one in found if one is not None), key=lambda one: one.cost)

    def _delivery(self, now: Situation, piece: int) -> Errand | None:
        key = (piece, now.plate.tobytes(), now.poses.tobytes())
        if key not in self._known:
            self._known[key] = self._errand(now, piece)
        return self._known[key]

    def _errand(self, now: Situation, piece: int, places: tuple[Goal, ...] = ()) -> Errand | None:
        self.looked_at += 1
        limits = Limits(self._until, first=True, iterations=self._patience, stop=self._stop)
        return errand(self._pieces, now, piece, limits, self._seed, places)

    def _is_open(self, now: Situation, piece: int) -> bool:
        """Tell whether a piece has a plan, or only waits for others that are left to leave all its goals."""
        return self._waits(now, piece) or self._delivery(now, piece) is not None

    def _waits(self, now: Situation, piece: int) -> bool:
        return all(
            self._on_goal(now, piece, goal) & now.left for goal in range(len(self._pieces[piece].goals))
        )

    def _on_goal(self, now: Situation, piece: int, goal: int) -> frozenset[int]:
        """Return the pieces that stand on a goal of another."""
        own = self._pieces[piece]
        area = own.area(own.goals[goal].pose_chain).buffer(own.prepared.scenario.clearance)
        others = (k for k in range(len(self._pieces)) if k != piece)
        return frozenset(k for k in others if self._pieces[k].area(now.poses[k]).intersects(area))

    def _make_way(self, now: Situation, relocations: int) -> tuple[Errand, ...] | None:
        """Put a piece that is in the way somewhere else, and go on from there."""
        for piece in self._in_the_way(now):
            places = parking(self._pieces, now, piece, self._random)
            for _ in range(PLACES):
                step = self._errand(now, piece, places) if places else None
                if step is None or self._over():
                    break
                after = step.after(now)
                if relocations > 1 or any(self._delivery(after, k) is not None for k in after.left):
                    rest = self._go_on(after, relocations - 1)
                    if rest is not None:
                        return (step, *rest)
                reached = step.end
                places = tuple(p for p in places if np.hypot(*(p.pose_chain - reached)[:2]) > 0.2)
        return None

    def _in_the_way(self, now: Situation) -> Iterator[int]:
        """Yield the pieces that may be in the way: those on goals first, then those near, then what is shut in."""
        on_goals = [
            k
            for piece in sorted(now.left)
            for goal in range(len(self._pieces[piece].goals))
            for k in sorted(self._on_goal(now, piece, goal))
        ]
        near = [k for piece in sorted(now.left) for k in self._near(now, piece)]
        yield from dict.fromkeys([*on_goals, *near, *sorted(now.left)])

    def _near(self, now: Situation, piece: int) -> list[int]:
        """Return the pieces near another or its goals, nearest first."""
        spots = np.array([now.poses[piece], *(goal.pose_chain for goal in self._pieces[piece].goals)])[:, :2]
        away = [float(np.linalg.norm(spots - pose[:2], axis=1).min()) for pose in now.poses]
        return [int(k) for k in np.argsort(away) if k != piece and away[k] < NEAR]
