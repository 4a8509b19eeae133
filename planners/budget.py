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
    """

    time_limit: float
    stall: int = 15_000
    gap: float = 1e-9
    first: bool = False
    iterations: int | None = None
