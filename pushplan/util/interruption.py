"""What Ctrl-C does: nothing that leaves a traceback, and while planning it ends the search and keeps its best path.

An exception raised by a signal at any place would pass through planners written in C++, and through whatever is being
imported. So a handler notes the wish, and the search asks for it.
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
"""Exit code, as shells report it."""

_FIRST = b"\ninterrupted: going on with the best path until now; Ctrl-C again leaves at once\n"


def leave(*_: object) -> None:
    """End the process at once; a handler of signals."""
    with contextlib.suppress(OSError):
        os.write(2, b"interrupted\n")
    os._exit(INTERRUPTED)


class Interruption:
    """Whether the user has asked for the end.

    Attributes:
        requested: That is so.
    """

    _dropped: ClassVar[bool] = False

    def __init__(self) -> None:
        self.requested = False

    def __call__(self) -> bool:
        """Return whether the user has asked for the end."""
        return self.requested

    def _note(self, *_: object) -> None:
        self.requested = True
        signal.signal(signal.SIGINT, leave)
        with contextlib.suppress(OSError):
            os.write(2, _FIRST)

    @contextlib.contextmanager
    def listening(self) -> Iterator[None]:
        """Take the first Ctrl-C as a wish, and leave at the second one; elsewhere Ctrl-C does what it did."""
        # A library in C that was called back may have dropped the exception, not the wish.
        self.requested = self.requested or Interruption._dropped
        with _handling(self._note):
            yield

    @contextlib.contextmanager
    def raising(self) -> Iterator[None]:
        """Note a Ctrl-C and raise KeyboardInterrupt, which what is being imported may turn into another error."""

        def note(*_: object) -> None:
            self.requested = True
            raise KeyboardInterrupt

        def drop(what: sys.UnraisableHookArgs) -> None:
            if what.exc_type is KeyboardInterrupt:
                Interruption._dropped = True
            else:
                told(what)

        told, sys.unraisablehook = sys.unraisablehook, drop
        try:
            with _handling(note):
                yield
            if Interruption._dropped:
                raise KeyboardInterrupt
        finally:
            sys.unraisablehook, Interruption._dropped = told, False


@contextlib.contextmanager
def leaving_at_once() -> Iterator[None]:
    """Let Ctrl-C end the process without a word from Python, where nothing would be lost."""
    with _handling(leave):
        yield


def import_uninterrupted(*modules: str) -> None:
    """Import modules in C++ and hold Ctrl-C back until they are there: an exception in nanobind's code aborts."""
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
    """Handle SIGINT, unless this is no main thread or the process has been told to ignore it (`nohup`, `&`)."""
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        yield
        return
    before = signal.signal(signal.SIGINT, handler)  # type: ignore[arg-type]
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
