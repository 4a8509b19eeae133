"""The pace of a replay: simulated times as the wall clock reaches them."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

from pushplan.errors import PushplanError


@dataclass(frozen=True)
class Playback:
    """How to play a run.

    Attributes:
        rate: Simulated seconds in each second, > 0.
        start_offset: Simulated time at which to begin, s, >= 0.
        duration: Simulated seconds to play, > 0; None plays to the end.
        loop: Begin again at the end, for ever.

    Raises:
        PushplanError: When one of them is not as stated.
    """

    rate: float = 1.0
    start_offset: float = 0.0
    duration: float | None = None
    loop: bool = False

    def __post_init__(self) -> None:
        _require("rate", self.rate, self.rate > 0.0, "> 0")
        _require("start_offset", self.start_offset, self.start_offset >= 0.0, ">= 0")
        if self.duration is not None:
            _require("duration", self.duration, self.duration > 0.0, "> 0")

    def span(self, end: float) -> tuple[float, float]:
        """Return where a run that ends at `end` begins to play and where it stops, s.

        Raises:
            PushplanError: When it ends before it begins.
        """
        if self.start_offset > end:
            raise PushplanError(f"start_offset is {self.start_offset} s, but the run ends at {end:.3f} s")
        stop = end if self.duration is None else min(end, self.start_offset + self.duration)
        return self.start_offset, stop


def _require(name: str, value: float, holds: bool, allowed: str) -> None:
    if not (math.isfinite(value) and holds):
        raise PushplanError(f"{name} is {value}; it must be finite and {allowed}")


class Pace:
    """Waits until the wall clock reaches a simulated time.

    Attributes:
        rate: Simulated seconds in each second.
    """

    def __init__(
        self,
        begin: float,
        rate: float,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.rate = rate
        self._begin = begin
        self._clock, self._sleep = clock, sleep
        self._started = clock()

    def wait_for(self, simulated: float) -> None:
        """Return when it is `simulated` s, at once if that has passed."""
        ahead = self._started + (simulated - self._begin) / self.rate - self._clock()
        if ahead > 0.0:
            self._sleep(ahead)

    @property
    def now(self) -> float:
        """The simulated time, s."""
        return self._begin + self.rate * (self._clock() - self._started)
