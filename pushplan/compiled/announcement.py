"""The wait for compiled code, told to the user: numba compiles a function when it is called for the first time."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count

from pushplan.compiled.private import on_compiling

PATIENCE = 1.5
"""Seconds of compiling after which the user is told what takes so long."""

ANNOUNCEMENT = "compiling for this machine (once for each kind of work, a minute or two; kept for later) ..."


@contextmanager
def announced(
    tell: Callable[[str], None] | None, news: Callable[[str], None] | None = None
) -> Iterator[None]:
    """Tell the user if something is being compiled for a while, and how far that is.

    Code that is loaded from the cache on disk is not compiled, and nothing is told.

    Args:
        tell: Called with a sentence, once; None for nothing at all.
        news: Called with how many functions were compiled, whenever the next one begins.
    """
    if tell is None:
        yield
        return
    timer = threading.Timer(PATIENCE, tell, [ANNOUNCEMENT])
    timer.daemon = True
    begun = count(1)

    def one_more() -> None:
        number = next(begun)
        if news is not None:
            news(f"compiling function {number}")
        if not timer.ident:
            timer.start()

    try:
        with on_compiling(one_more):
            yield
        if news is not None:
            news("")
    finally:
        timer.cancel()
