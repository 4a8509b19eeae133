"""When a search is over."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Budget:
    """When a planner stops.

    Attributes:
        time_limit: Wall-clock seconds, at most.
        stall: Stop after this many iterations without a better path, once there is one. Runs that end so, not by
            the time limit, repeat bit by bit.
        gap: Stop when the cost exceeds the lower bound by no more than this share.
        first: Stop at the first path.
        iterations: Stop after this many iterations, at most; None sets no limit. Unlike the time limit it ends the
            same search at the same place on every machine.
        patience: Share of the time, or of the iterations where they are given, after which a search without a path
            is over.
    """

    time_limit: float
    stall: int = 15_000
    gap: float = 1e-9
    first: bool = False
    iterations: int | None = None
    patience: float = 1.0

    def is_used_up(self, seconds: float, iterations: int) -> bool:
        """Tell whether the time or the iterations are spent."""
        return seconds >= self.time_limit or (self.iterations is not None and iterations >= self.iterations)

    def has_lost_patience(self, seconds: float, iterations: int) -> bool:
        """Tell whether a search that has no path yet is over."""
        if self.iterations is not None:
            return self.is_used_up(seconds, iterations) or iterations >= self.patience * self.iterations
        return seconds >= self.patience * self.time_limit
