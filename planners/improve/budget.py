"""When a search is over."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Budget:
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
        patience: Share of the iterations where they are given, else of the time, after which a search without a
            path is over.
        enough: Likewise of a search that has a path.
        stop: Asked now and then whether the search has to end at once.
    """

    time_limit: float
    stall: int = 15_000
    gap: float = 1e-9
    first: bool = False
    iterations: int | None = None
    patience: float = 1.0
    enough: float = 1.0
    stop: Callable[[], bool] | None = None

    def is_used_up(self, seconds: float, iterations: int, share: float = 1.0) -> bool:
        """Tell whether a share of the iterations or of the time is spent, or all of the time, or `stop` says so."""
        if self.stop is not None and self.stop():
            return True
        if self.iterations is None:
            return seconds >= share * self.time_limit
        return iterations >= share * self.iterations or seconds >= self.time_limit
