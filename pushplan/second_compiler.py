"""A second process that compiles the search while the first one compiles the mechanics.

Both leave what they compile in numba's cache on disk, a file for each function, from which the other one takes it. So
the first run on a machine with two processors takes little more than half the time.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading

WORK = "from pushplan.kernels import compile_search; compile_search({!r})"


class SecondCompiler:
    """Starts the process once compiling is seen to take a while; loading a full cache is over before.

    Whatever becomes of the process, the first one compiles what it does not find.

    Args:
        planner: Name of the planner whose search is compiled.
        patience: Seconds until it starts.
    """

    def __init__(self, planner: str, patience: float) -> None:
        self._command = [sys.executable, "-c", WORK.format(planner)]
        self._process: subprocess.Popen[bytes] | None = None
        self._timer = threading.Timer(patience, self._start)
        self._timer.daemon = True

    def __enter__(self) -> SecondCompiler:
        if (os.cpu_count() or 1) > 1 and sys.executable:
            self._timer.start()
        return self

    def wait(self) -> None:
        """Wait until the process has compiled everything, if it was started."""
        self._settle()
        if self._process is not None:
            self._process.wait()

    def __exit__(self, *error: object) -> None:
        self._settle()
        if self._process is not None and self._process.poll() is None:
            self._process.kill()
            self._process.wait()

    def _settle(self) -> None:
        """Leave no thread behind: from here on the process is there, or never will be."""
        self._timer.cancel()
        if self._timer.is_alive():
            self._timer.join()

    def _start(self) -> None:
        """Start the process, without a word on the user's screen."""
        quiet = subprocess.DEVNULL
        self._process = subprocess.Popen(self._command, stdin=quiet, stdout=quiet, stderr=quiet)
