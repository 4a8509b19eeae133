"""Keys pressed in a terminal, one at a time and unseen, while something else goes on."""

from __future__ import annotations

import os
import select
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_LONGEST = 8
"""Bytes that a key sends, at most."""


@contextmanager
def keyboard() -> Iterator[Callable[[float], str]]:
    """Give a function that waits so many seconds for a key and returns it, or nothing.

    Where the input is no terminal, or the system has none of this kind, it only waits.
    """
    try:
        import termios
        import tty

        fd = sys.stdin.fileno()
        before = termios.tcgetattr(fd)
    except (ImportError, OSError, ValueError, termios.error):
        yield _without_keys
        return
    try:
        tty.setcbreak(fd)
        yield lambda seconds: _key(fd, seconds)
    finally:
        termios.tcsetattr(fd, termios.TCSADRAIN, before)


def _key(fd: int, seconds: float) -> str:
    ready, _, _ = select.select([fd], [], [], seconds)
    return os.read(fd, _LONGEST).decode(errors="replace") if ready else ""


def _without_keys(seconds: float) -> str:
    time.sleep(seconds)
    return ""
