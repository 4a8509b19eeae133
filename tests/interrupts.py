"""Ctrl-C for tests: a shell that starts them in the background lets them, and their children, ignore it."""

import signal


def heed_interrupts() -> None:
    """Let Ctrl-C end the program that follows; for `preexec_fn`."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
