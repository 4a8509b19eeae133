"""The log of a run as it grows; what hinders recording never hinders the run."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Literal, Self

from pushplan.errors import OutputError, PushplanError
from pushplan.plans.result import PlanResult, ProgressPoint, Run
from pushplan.scenario.model import Scenario
from pushplan.util.stopwatch import Stopwatch

if TYPE_CHECKING:
    from pushplan.logging.old.writer import RunLogWriter

Where = Path | str | Literal[False] | None
"""A file, False for no log, or None for one in the folder of the recorded runs."""


class IncompleteLogError(OutputError):
    """A run is over, but its log could not be written to its end.

    Attributes:
        run: The run.
        partial: What was written of the log.
    """

    def __init__(self, error: OutputError, run: Run, partial: Path) -> None:
        self.run, self.partial = run, partial
        what = str(error).removeprefix(f"{error.path}: ")
        super().__init__(error.path, f"{what}; what was written of the log is in {partial}")


class Recording:
    """Writes the log of a run: a context manager around it.

    Where the user has not named a file, whatever keeps the log from being written is told as a warning. Where he
    has, it is raised at once when the log cannot be begun, and by `finished` otherwise.

    Args:
        scenario: What the run is about.
        settings: For the metadata, `seed` among them.
        where: The log.
        runs: Folder of the recorded runs, instead of the usual one.
        tell: Takes warnings; None for Python's own.
        watch: Takes the time of the phase `logging`.

    Raises:
        OutputError: When the log that is named cannot be begun.
    """

    def __init__(
        self,
        scenario: Scenario,
        settings: Mapping[str, object],
        where: Where,
        runs: Path | str | None,
        tell: Callable[[str], None] | None,
        watch: Stopwatch,
    ) -> None:
        self._scenario, self._settings, self._tell, self._watch = scenario, settings, tell, watch
        self._named, self._runs = where is not None, runs
        self._path: Path | None = None
        self._writer: RunLogWriter | None = None
        self._error: OutputError | None = None
        self._partial: Path | None = None
        if where is not False:
            self._begin(where)

    def _begin(self, where: Path | str | None) -> None:
        with self._writing():
            from pushplan.logging.old.writer import RunLogWriter  # nobody waits for it who logs nothing

            self._path = self._new_log() if where is None else Path(where)
            self._writer = RunLogWriter.create(self._path, self._scenario, self._settings)
            self._partial = self._writer.partial
        if self._named and self._error is not None:
            raise self._error

    def _new_log(self) -> Path:
        from pushplan.logging.runs import new_log, runs_folder

        seed = self._settings["seed"]
        assert isinstance(seed, int)
        return new_log(runs_folder(self._runs), self._scenario.name, seed)

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Do what writes the log; an error ends the recording, not the run."""
        with self._watch("logging"):
            try:
                yield
            except OutputError as error:
                self._error = error
                if self._writer is not None:
                    self._writer.abandon(error)
                    self._writer = None
                if not self._named:
                    self._warn(f"warning: this run is not recorded: {error}")

    def _warn(self, text: str) -> None:
        if self._tell is None:
            warnings.warn(text, RuntimeWarning, stacklevel=2)
        else:
            self._tell(text)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close a log that is not finished; a problem that was refused is an outcome of its own."""
        with self._writing():
            if self._writer is not None and isinstance(error, PushplanError):
                self._writer.log("error", str(error))
                self._writer.finish("refused")
            elif self._writer is not None:
                self._writer.abandon(error)
        self._writer = None
        self._prune()

    def improved(self, point: ProgressPoint) -> None:
        """Write an improvement of the best path, so that it outlives a kill."""
        if self._writer is not None:
            with self._writing():
                self._writer.improved(point)

    def end(self, result: PlanResult, interrupted: bool) -> None:
        """Write the plan and its execution."""
        if self._writer is None:
            return
        with self._writing():
            outcome = self._outcome(self._writer, result)
            self._writer.finish("interrupted" if interrupted else outcome, self._watch.seconds)
        self._writer = None

    def follow(self, result: PlanResult, scenario: Scenario, settings: Mapping[str, object]) -> None:
        """Write the plan and its execution, and begin another run in the same log."""
        if self._writer is None:
            return
        with self._writing():
            self._writer.follow(self._outcome(self._writer, result), scenario, settings)

    @staticmethod
    def _outcome(writer: RunLogWriter, result: PlanResult) -> str:
        """Write the plan and its execution; return what they come to, in a word."""
        writer.plan(result)
        if result.execution is not None:
            writer.execution(result.execution)
        return "solved" if result.solved else "unsolved"

    def _prune(self) -> None:
        """Remove the oldest runs beyond the size cap, where this one was recorded among them."""
        if self._named or self._path is None or self._error is not None:
            return
        from pushplan.logging.runs import prune

        with self._writing():
            prune(self._path.parent, self._path)

    def finished(self, result: PlanResult) -> Run:
        """Return the run, which is over.

        Raises:
            IncompleteLogError: When the log that is named could not be written.
        """
        log = self._path if self._error is None else None
        run = Run(self._scenario, result, result.execution, log, self._watch.seconds)
        if self._named and self._error is not None and self._partial is not None:
            raise IncompleteLogError(self._error, run, self._partial)
        return run
