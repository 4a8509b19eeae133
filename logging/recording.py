"""Recording of a run in its log, and recovery of damaged logs; a failed recording never stops the run."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self

import pushplan.logging.metadata as metadata
from pushplan.errors import OutputError, PushplanError
from pushplan.logging.reader import load_run
from pushplan.logging.recorded import RecordedRun
from pushplan.logging.runs import new_log, prune, runs_folder
from pushplan.logging.topics import lines_of
from pushplan.logging.writer import RunLogWriter
from pushplan.plans.plan import Improvement, Plan
from pushplan.plans.run import Run
from pushplan.plans.settings import Observer
from pushplan.scenario.model import Scenario
from pushplan.util.stopwatch import Stopwatch

Where = Path | str | Literal[False] | None
"""Destination of a log: a file, False for no log, or None for a file in the folder of recorded runs."""


class IncompleteLogError(OutputError):
    """The log of a finished run is incomplete.

    Attributes:
        run: Result of the run: a `Run`, a `ClosedLoopRun` or `Trials`.
        partial: Path of the incomplete log.
    """

    def __init__(self, error: OutputError, run: Any, partial: Path) -> None:
        self.run, self.partial = run, partial
        what = str(error).removeprefix(f"{error.path}: ")
        super().__init__(error.path, f"{what}; the incomplete log is in {partial}")


class Recording:
    """Context manager that writes the log of a run.

    If the user has not named a file, a write error becomes a warning. For a named file, an error at the start is
    raised at once, and a later one by `finished`.

    Args:
        scenario: Scenario of the run, with the settings of the plan.
        settings: Settings for the metadata, `seed` among them.
        where: Destination of the log.
        runs: Folder of the recorded runs; None for the usual one.
        message: Receiver of warnings; None for Python's `warnings`.
        watch: Stopwatch for the phase `logging`.

    Raises:
        OutputError: If the named log cannot be created.
    """

    def __init__(
        self,
        scenario: Scenario,
        settings: Mapping[str, object],
        where: Where = None,
        runs: Path | str | None = None,
        message: Callable[[str], None] | None = None,
        watch: Stopwatch | None = None,
    ) -> None:
        self._message, self._watch = message, Stopwatch() if watch is None else watch
        self._named = where is not None
        self._writer: RunLogWriter | None = None
        self._path: Path | None = None
        self._partial: Path | None = None
        self._error: OutputError | None = None
        if where is not False:
            with self._writing():
                seed = int(str(settings["seed"]))
                self._path = new_log(runs_folder(runs), scenario.name, seed) if where is None else Path(where)
                self._writer = RunLogWriter.create(self._path, scenario, settings)
                self._partial = self._writer.partial
        if self._named and self._error is not None:
            raise self._error

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Write to the log; an error ends the recording, not the run."""
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
        if self._message is None:
            warnings.warn(text, RuntimeWarning, stacklevel=2)
        else:
            self._message(text)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close an unfinished log; its outcome is `refused` for an error of pushplan and `failed` for others."""
        with self._writing():
            if self._writer is not None and isinstance(error, Exception):
                refused = isinstance(error, PushplanError)
                self._writer.log("error", str(error) if refused else f"failed: {type(error).__name__}: {error}")
                self._writer.finish("refused" if refused else "failed")
            elif self._writer is not None:
                self._writer.abandon(error)
        self._writer = None
        if not self._named and self._path is not None and self._error is None:
            with self._writing():
                prune(self._path.parent, self._path)

    def write(self, part: Callable[[RunLogWriter], object]) -> None:
        """Write a part of the log, which survives a kill from then on."""
        if self._writer is not None:
            with self._writing():
                part(self._writer)

    def improved(self, improvement: Improvement) -> None:
        """Write an improvement of the plan."""
        self.write(lambda log: log.improved(improvement))

    def listening(self, observer: Observer) -> Observer:
        """Return an observer that also writes the improvements to the log."""

        def improved(improvement: Improvement) -> None:
            self.improved(improvement)
            observer.improved(improvement)

        return replace(observer, improved=improved)

    def end(self, plan: Plan, interrupted: bool = False) -> None:
        """Write the plan and its execution, and finish the log."""
        self.write(lambda log: log.plan(plan))
        execution = plan.execution
        if execution is not None:
            self.write(lambda log: log.execution(execution))
        self.finish("interrupted" if interrupted else "solved" if plan.solved else "unsolved")

    def finish(self, outcome: str) -> None:
        """End the log and give it its final name."""
        self.write(lambda log: log.finish(outcome, self._watch.seconds))
        self._writer = None

    def finished(self, plan: Plan) -> Run:
        """Return the finished run.

        Raises:
            IncompleteLogError: If the named log could not be written.
        """
        run = Run(plan.scenario, plan, plan.execution, self.log, self._watch.seconds)
        self.require_whole(run)
        return run

    @property
    def log(self) -> Path | None:
        """Path of the log; None without one, or if it could not be written."""
        return self._path if self._error is None else None

    def require_whole(self, done: object) -> None:
        """Raise IncompleteLogError with the result `done` if the named log could not be written."""
        if self._named and self._error is not None and self._partial is not None:
            raise IncompleteLogError(self._error, done, self._partial)


def recover(source: Path | str, target: Path | str) -> RecordedRun:
    """Read the intact part of a damaged log, write it as a new log, and return its run.

    The new log has the original metadata, and lists the lost parts in `pushplan.recovery`. Its messages are generated
    again.

    Raises:
        RunLogError: If too little is left of the log.
        OutputError: If the new log already exists or cannot be written.
    """
    run = load_run(source, recover=True)
    log = RunLogWriter.create(target, run.scenario, {}, _run_words(run), new=True)
    try:
        _write(run, log)
        log.finish(run.outcome, _seconds(run))
    except BaseException:  # the damaged log still exists
        log.discard()
        raise
    return run


def _write(run: RecordedRun, log: RunLogWriter) -> None:
    lost = {f"lost_{k:04d}": loss for k, loss in enumerate(run.losses)}
    log.note(metadata.RECOVERY, {"from": run.path.name, **lost})
    for name, words in run.fields.items():
        if name not in _WRITTEN and not name.startswith(metadata.PROGRESS):
            log.note(name, words)
    for point in run.improvements:
        log.improved(point)
    if run.plan is not None:
        log.plan(run.plan)
    if run.feedback is not None:
        log.feedback(run.feedback)
    if run.execution is not None:
        log.execution(run.execution)
    for end in run.trials:
        log.trial(end)
    follow = set(lines_of(run.scenario, run.plan, run.execution, run.feedback, ()))
    for line in run.lines:
        if line not in follow:
            log.line(line)


_WRITTEN = (metadata.RUN, metadata.PLANNING, metadata.RESULT, metadata.RECOVERY)


def _run_words(run: RecordedRun) -> dict[str, str]:
    """Return the original metadata of the run, with the hash of the resolved scenario if its file is lost."""
    words = run.fields.get(metadata.RUN) or metadata.run_words(run.scenario, {})
    return {**words, "scenario_sha256": hashlib.sha256(run.scenario.source).hexdigest()}


def _seconds(run: RecordedRun) -> dict[str, float]:
    """Return the known durations of the phases of the run, s."""
    effort = set(run.fields.get(metadata.PLANNING, {}))
    words = run.fields.get(metadata.RESULT, {})
    return {
        key.removesuffix("_s"): float(value)
        for key, value in words.items()
        if key.endswith("_s") and key not in effort
    }
