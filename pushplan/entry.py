"""Where the program begins: Ctrl-C while it loads ends it without a traceback."""

from __future__ import annotations

from typing import NoReturn

from pushplan.basics.interruption import leaving_at_once


def entry() -> NoReturn:
    """Load the command line, run it, and end the process with its exit code."""
    with leaving_at_once():
        from pushplan.cli import entry as run
    run()
