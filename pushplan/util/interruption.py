"""Handles Ctrl-C without a traceback. During planning it ends the search, which keeps its best path.

An exception from a signal handler would pass through planners in C++ and through modules during their import.
Therefore a handler sets a flag, which the search polls.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Iterator
from importlib import import_module
from typing import ClassVar

INTERRUPTED = 130
"""Exit code that shells use for Ctrl-C."""

_FIRST = b"\ninterrupted: continuing with the best path so far; press Ctrl-C again to exit at once\n"


def leave(*_: object) -> None:
    """End the process at once; a signal handler."""
    with contextlib.suppress(OSError):
        os.write(2, b"interrupted\n")
    os._exit(INTERRUPTED)


class Interruption:
    """Flag of a Ctrl-C by the user.

    Attributes:
        requested: Whether the user has pressed Ctrl-C.
    """

    _dropped: ClassVar[bool] = False

    def __init__(self) -> None:
        self.requested = False

    def __call__(self) -> bool:
        """Return whether the user has pressed Ctrl-C."""
        return self.requested

    def _note(self, *_: object) -> None:
        self.requested = True
        signal.signal(signal.SIGINT, leave)
        with contextlib.suppress(OSError):
            os.write(2, _FIRST)

    @contextlib.contextmanager
    def listening(self) -> Iterator[None]:
        """Set the flag at the first Ctrl-C in this context, and end the process at the second one."""
        # A C library with callbacks can have dropped the exception of an earlier Ctrl-C.
        self.requested = self.requested or Interruption._dropped
        with _handling(self._note):
            yield

    @contextlib.contextmanager
    def raising(self) -> Iterator[None]:
        """Set the flag at Ctrl-C and raise KeyboardInterrupt, which an import can turn into another error."""

        def note(*_: object) -> None:
            self.requested = True
            raise KeyboardInterrupt

        def drop(what: sys.UnraisableHookArgs) -> None:
            if what.exc_type is KeyboardInterrupt:
                Interruption._dropped = True
            else:
                previous(what)

        previous, sys.unraisablehook = sys.unraisablehook, drop
        try:
            with _handling(note):
                yield
            if Interruption._dropped:
                raise KeyboardInterrupt
        finally:
            sys.unraisablehook, Interruption._dropped = previous, False


@contextlib.contextmanager
def leaving_at_once() -> Iterator[None]:
    """Let Ctrl-C end the process without a traceback; only for code that has no results to lose."""
    with _handling(leave):
        yield


def import_uninterrupted(*modules: str) -> None:
    """Import C++ modules and delay Ctrl-C until the end, because an exception in nanobind aborts the process."""
    wishes = list[int]()
    try:
        with _handling(lambda *_: wishes.append(1)):
            for module in modules:
                import_module(module)
    finally:
        if wishes:
            signal.raise_signal(signal.SIGINT)


@contextlib.contextmanager
def _handling(handler: object) -> Iterator[None]:
    """Handle SIGINT in this context, if this is the main thread and SIGINT is not ignored (`nohup`, `&`)."""
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        yield
        return
    before = signal.signal(signal.SIGINT, handler)  # type: ignore[arg-type]
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
