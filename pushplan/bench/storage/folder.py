"""The folder of a benchmark's results: the database, a log for each run, the problems, the report."""

from __future__ import annotations

import contextlib
import fcntl
import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pushplan.bench.processes.outcome import Outcome
from pushplan.bench.suites.suite import RunSpec, Suite
from pushplan.errors import PushplanError
from pushplan.util.files import write_whole


class FolderError(PushplanError, ValueError):
    """A folder of results cannot be used."""


class ResultsFolder:
    """Where the results of a benchmark are.

    Attributes:
        path: The folder.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    @property
    def database(self) -> Path:
        """Planner Arena's database."""
        return self.path / "results.db"

    @property
    def report(self) -> Path:
        """The report for people."""
        return self.path / "report.html"

    @property
    def scratch(self) -> Path:
        """Where runs have their folders while they go on."""
        return self.path / ".scratch"

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other benchmarks out of the folder, which is made if need be.

        Raises:
            FolderError: When another benchmark writes into it, or it is a file.
        """
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except FileExistsError as error:
            raise FolderError(f"{self.path} is a file; allowed: a folder, which may be new") from error
        with os.fdopen(os.open(self.path / ".lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC), "rb") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise FolderError(f"another benchmark writes into {self.path} now") from error
            shutil.rmtree(self.scratch, ignore_errors=True)
            self.scratch.mkdir()
            try:
                yield
            finally:
                shutil.rmtree(self.scratch, ignore_errors=True)

    def keep_suite(self, suite: Suite) -> None:
        """Write the suite and its problems, so that the folder says what was run."""
        write_whole(self.path / "suite.yaml", suite.source)
        problems = self.path / "problems"
        problems.mkdir(exist_ok=True)
        for problem in suite.problems:
            write_whole(problems / f"{_plain(problem.name)}.yaml", problem.scenario.source)

    def keep_log(self, run: RunSpec, result: Outcome) -> str | None:
        """Write the log of a run, whole or in part, in place of an earlier one; return its name in the folder."""
        (self.path / "logs").mkdir(exist_ok=True)
        stem = f"logs/{'-'.join(_plain(word) for word in run.words.values())}-{run.key[:8]}.mcap"
        whole, part = self.path / stem, self.path / f"{stem}.partial"
        for path in (whole, part):
            with contextlib.suppress(FileNotFoundError):
                path.unlink()
        if result.log is None:
            return None
        target = whole if result.whole else part
        write_whole(target, result.log)
        return str(target.relative_to(self.path))


def _plain(word: str) -> str:
    """Return a word with nothing in it that file names do not like."""
    return re.sub(r"[^\w.+-]+", "_", word, flags=re.ASCII)
