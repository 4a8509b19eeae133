"""The wait for compiled code, told to the user: numba compiles a function when it is called for the first time."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from pushplan.compiled.private import on_compiling

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
    timer = threading.Timer(PATIENCE, tell, [ANNOUNCEMENT])
    timer.daemon = True
    try:
        with on_compiling(lambda: None if timer.ident else timer.start()):
            yield
    finally:
        timer.cancel()
