"""Measures wall-clock time by phase, and pauses the garbage collector."""

from __future__ import annotations

import gc
import time
from collections.abc import Iterator
from contextlib import contextmanager


class Stopwatch:
    """Adds up the time of each phase; the time of an inner phase is not part of the outer phase.

    Attributes:
        seconds: Time by phase, s.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._inside = 0.0

    @contextmanager
    def __call__(self, phase: str) -> Iterator[None]:
        """Add the time spent in this context to a phase."""
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
    """Pause the collection of reference cycles; with compiled code loaded, one collection takes 0.1 s."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()
