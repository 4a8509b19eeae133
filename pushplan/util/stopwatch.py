"""Wall-clock time, phase by phase, and no garbage collector at work while it counts."""

from __future__ import annotations

import gc
import time
from collections.abc import Iterator
from contextlib import contextmanager


class Stopwatch:
    """Adds up the time that each phase takes; what a phase inside another one takes is its own, not the other's.

    Attributes:
        seconds: Time by phase, s.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._inside = 0.0

    @contextmanager
    def __call__(self, phase: str) -> Iterator[None]:
        """Count the time spent inside towards a phase."""
        began, before = time.perf_counter(), self._inside
        self._inside = 0.0
        try:
            yield
        finally:
            took = time.perf_counter() - began
            self.seconds[phase] = self.seconds.get(phase, 0.0) + took - self._inside
            self._inside = before + took


@contextmanager
def no_collection() -> Iterator[None]:
    """Put off the collection of reference cycles: with compiled code loaded, one walk takes a tenth of a second."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()
