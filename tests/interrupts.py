"""Ctrl-C for tests: a shell that starts them in the background lets them, and their children, ignore it."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager


def heed_interrupts() -> None:
    """Let Ctrl-C end the program that follows; for `preexec_fn`."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@contextmanager
def interrupts_heeded() -> Iterator[None]:
    """Let Ctrl-C raise KeyboardInterrupt in this process meanwhile."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
