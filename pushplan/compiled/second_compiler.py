"""A second process that compiles the search while the first one compiles the mechanics.

Both leave what they compile in numba's cache on disk, a file for each function, from which the other one takes it. So
the first run on a machine with two processors takes little more than half the time.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext

from pushplan.compiled.private import on_compiling

WORK = "from pushplan.kernels import compile_search; compile_search({!r})"


@contextmanager
def second_compiler(planner: str) -> Iterator[None]:
    """Start the process with the first function that is compiled inside, and wait for its end.

    Code that is loaded from the cache needs no second process. Whatever becomes of it, the first one compiles what it
    does not find.

    Args:
        planner: Name of the planner whose search is compiled.
    """
    starter = _Starter(planner)
    several = (os.cpu_count() or 1) > 1 and sys.executable
    try:
        with on_compiling(starter.start) if several else nullcontext():
            yield
        starter.wait()
    finally:
        starter.kill()


class _Starter:
    """Starts the process, once."""

    def __init__(self, planner: str) -> None:
        self._command = [sys.executable, "-c", WORK.format(planner)]
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start the process, without a word on the user's screen."""
        if self._process is None:
            quiet = subprocess.DEVNULL
            self._process = subprocess.Popen(self._command, stdin=quiet, stdout=quiet, stderr=quiet)

    def wait(self) -> None:
        """Wait until the process has compiled everything, if there is one."""
        if self._process is not None:
            self._process.wait()

    def kill(self) -> None:
        """End the process if it is still there."""
        if self._process is not None and self._process.poll() is None:
            self._process.kill()
            self._process.wait()
