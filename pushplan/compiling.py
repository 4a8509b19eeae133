"""The wait for compiled code, told to the user: numba compiles a function when it is called for the first time."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from numba.core.event import Event, Listener, install_listener

PATIENCE = 1.5
"""Seconds of compiling after which the user is told what takes so long."""

ANNOUNCEMENT = "compiling for this machine (only at the first use, for about a minute) ..."


@contextmanager
def announced(tell: Callable[[str], None] | None) -> Iterator[None]:
    """Call `tell` with a sentence for the user, once, if something is being compiled for a while.

    Code that is loaded from the cache on disk is not compiled, and nothing is told.
    """
    if tell is None:
        yield
        return
    watch = _Watch(tell)
    try:
        with install_listener("numba:compile", watch):
            yield
    finally:
        watch.cancel()


class _Watch(Listener):
    """Starts a timer with the first function that is compiled."""

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._timer = threading.Timer(PATIENCE, tell, [ANNOUNCEMENT])
        self._timer.daemon = True
        self._started = False

    def on_start(self, event: Event) -> None:
        """Take note that a function begins to be compiled."""
        del event
        if not self._started:
            self._started = True
            self._timer.start()

    def on_end(self, event: Event) -> None:
        """Let the timer run: as a rule the next function follows at once."""

    def cancel(self) -> None:
        """Tell nothing from here on."""
        self._timer.cancel()
