"""Writer of run logs; a kill at any moment loses nothing that was written before.

A run is written as attachments as soon as each is known: the scenario, every improvement of the path, the plan, every
simulated second of the execution, measurements and events. At the end, the messages for viewers are generated from it
(`topics`). The log grows as NAME.mcap.partial and is renamed to NAME.mcap when it is finished.

Two runs with the same seed write the same bytes, except in these fields of the metadata: `started_at`, `finished_at`,
`machine`, `git`, `sha256`, `iterations`, and clock times `..._s`. On one machine with the same versions, these have
the same length in both.
"""

from __future__ import annotations

import contextlib
import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

import pushplan.logging.metadata as metadata
import pushplan.logging.schemas as schemas
from pushplan.errors import OutputError, RunLogError
from pushplan.logging.codec import MEDIA_TYPE, encode
from pushplan.logging.layout import LAYOUT_FILE, layout_text
from pushplan.logging.mcap_file import mcap_writer
from pushplan.logging.recorded import LogLine, RecordedRun
from pushplan.logging.signals import series_of
from pushplan.logging.topics import lines_of, messages
from pushplan.plans.execution import Execution, TrialEnd
from pushplan.plans.plan import Improvement, Plan
from pushplan.plans.run import Feedback, Measured
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray
from pushplan.util.files import Output

SCENARIO_FILE, SCENARIO_JSON, SCENARIO_FOLDER = "scenario.yaml", "scenario.json", "scenario/"
"""Attachments: the scenario byte for byte; the resolved scenario; prefix of the files that it refers to."""

PLAN, IMPROVEMENT, SAMPLES, END = "plan.bin", "improvement/", "execution/", "execution.bin"
"""Attachments: the plan; prefix of numbered improvements of the path; prefix of numbered seconds of the execution;
its result."""

MEASURED, EVENT, REPLAN, TRIAL, LINE = "measured/", "event/", "replan/", "trial/", "line/"
"""Prefixes of numbered attachments: measurements, events, replans, outcomes of trials, other lines of /log."""

ENCODED = (PLAN, IMPROVEMENT, SAMPLES, END, MEASURED, EVENT, REPLAN, TRIAL, LINE)
"""Attachments that `codec` encodes."""

ATTACHMENTS = (SCENARIO_FILE, SCENARIO_JSON, SCENARIO_FOLDER, LAYOUT_FILE, *ENCODED)
"""Prefixes of the names of attachments."""

_LATEST = 1 << 33
"""Exclusive upper limit of simulated time, s."""

_FEWEST = 40
"""Smallest number of samples in a part of the execution; a part for each second of several hours would exceed the
reader's limits."""


def _parts_of(t: FloatArray, ended: bool) -> Iterator[slice]:
    """Yield the samples of each simulated second, or of several seconds with at least `_FEWEST` samples.

    Args:
        t: Times of the samples, s, (m,).
        ended: Whether to yield the rest, too, even if it is shorter.
    """
    begin = 0
    for cut in (np.flatnonzero(np.diff(np.floor(t))) + 1).tolist():
        if cut - begin >= _FEWEST:
            yield slice(begin, cut)
            begin = cut
    if len(t) - begin >= (1 if ended else _FEWEST):
        yield slice(begin, len(t))


class RunLogWriter:
    """Context manager that writes a log and never leaves an incomplete file under its final name.

    Example:
        >>> with RunLogWriter.create("run.mcap", scenario, {"seed": 1}) as log:
        ...     log.plan(plan(scenario, seed=1))
        ...     log.finish("solved")

    Without `finish`, or with an exception inside, the file stays under `partial`, and its metadata give the reason.
    All methods that write raise OutputError if the file cannot be written.
    """

    def __init__(self, file: Output, scenario: Scenario) -> None:
        self._file = file
        self._writer = mcap_writer(file, f"pushplan {metadata.version_of('pushplan')}")
        self._channels: dict[str, int] = {}
        self._sequence: Counter[int] = Counter()
        self._finished = False
        self._run = RecordedRun(file.path, scenario)
        self._others: list[LogLine] = []
        self._counts: Counter[str] = Counter()
        self._samples = self._measured = 0
        self._digest = metadata.Digest()

    @classmethod
    def create(
        cls,
        path: Path | str,
        scenario: Scenario,
        settings: Mapping[str, object],
        words: Mapping[str, str] | None = None,
        new: bool = False,
    ) -> Self:
        """Create a log and write the inputs of the run.

        Args:
            path: Final path of the log. An existing file is replaced only when the log is finished.
            scenario: Scenario of the run, with the settings of the plan (`Planner.scenario`).
            settings: Names and values for the metadata `pushplan.run`: planner, set, seed, ...
            words: Metadata `pushplan.run` of an earlier run; None for a run that begins now.
            new: Whether to refuse an existing file.
        """
        file = Output(path, new=new)
        try:
            log = cls(file, scenario)
            log.note(metadata.RUN, metadata.run_words(scenario, settings) if words is None else words)
            log._attach(SCENARIO_FILE, scenario.source, "application/yaml")
            log._attach(SCENARIO_JSON, scenario.to_json().encode(), "application/json")
            for name, data in scenario.attachments.items():
                log._attach(SCENARIO_FOLDER + name, data, "application/octet-stream")
        except BaseException:
            file.discard()
            raise
        return log

    @property
    def partial(self) -> Path:
        """Path of the file until it is finished."""
        return self._file.partial

    def _attach(self, name: str, data: bytes, media_type: str = MEDIA_TYPE) -> None:
        """Write an attachment, which survives a kill from then on."""
        self._digest.add(name, data)
        self._writer.add_attachment(0, 0, name, media_type, data)

    def _numbered(self, name: str, value: object) -> None:
        self._attach(f"{name}{self._counts[name]:06d}.bin", encode(value))
        self._counts[name] += 1

    def log(self, level: str, text: str) -> None:
        """Write a line to /log.

        Args:
            level: Level from `schemas.LEVELS`.
            text: Text without wall-clock times, which would differ from run to run.

        Raises:
            ValueError: If the level is unknown.
            OutputError: If the file cannot be written.
        """
        if level not in schemas.LEVELS:
            raise ValueError(f"the level is {level!r}; allowed: {', '.join(schemas.LEVELS)}")
        execution = self._run.execution
        time = 0.0 if execution is None or not len(execution.t) else float(execution.t[-1])
        self.line(LogLine(time, level, text))

    def line(self, line: LogLine) -> None:
        """Write a complete line to /log."""
        self._others.append(line)
        self._numbered(LINE, (line.time, line.level, line.text))

    def note(self, name: str, words: Mapping[str, str]) -> None:
        """Write a metadata record; its name begins with `pushplan.`."""
        self._digest.add_words(name, words)
        self._writer.add_metadata(name, dict(words))

    def improved(self, point: Improvement) -> None:
        """Write an improvement of the best path."""
        number = len(self._run.improvements)
        words = {"found_s": metadata.exact(point.seconds), "path_cost": repr(point.cost)}
        self.note(f"{metadata.PROGRESS}.{number:04d}", words)
        self._numbered(IMPROVEMENT, replace(point, seconds=math.nan))
        self._run = replace(self._run, improvements=(*self._run.improvements, point))

    def plan(self, plan: Plan) -> None:
        """Write a plan and its planning effort; improvements that are already written are not repeated."""
        for point in plan.improvements[len(self._run.improvements) :]:
            self.improved(point)
        self.note(metadata.PLANNING, metadata.planning_words(plan))
        self._attach(PLAN, encode(metadata.without_clock(plan)))
        self._attach(LAYOUT_FILE, layout_text(self._run.scenario, plan), "application/json")
        self._run = replace(self._run, plan=plan)

    def samples(self, execution: Execution) -> None:
        """Write the finished simulated seconds of an execution that are not written yet.

        Args:
            execution: Execution so far; its written samples must not change.

        Raises:
            RunLogError: If times go back or are not numbers.
            OutputError: If the file cannot be written.
        """
        over = int(np.searchsorted(execution.t, np.floor(execution.t[-1]))) if len(execution.t) else 0
        self._write_samples(execution, over, ended=False)
        if self._samples:
            self._run = replace(self._run, execution=execution.until(self._samples))

    def execution(self, execution: Execution) -> None:
        """Write the rest of an execution that is not written yet, in parts of a simulated second, and its result.

        Raises:
            RunLogError: If times go back or are not numbers.
            OutputError: If the file cannot be written.
        """
        self._write_samples(execution, len(execution.t), ended=True)
        end = {"samples": len(execution.t), "goal_error": execution.goal_error, "loss": execution.loss}
        self._attach(END, encode(end))
        self._run = replace(self._run, execution=execution)

    def _write_samples(self, execution: Execution, end: int, ended: bool) -> None:
        """Write the samples of an execution before `end` that are not written yet."""
        before = np.append(0.0, execution.t[:-1])
        wrong = np.flatnonzero(~((execution.t >= before) & (execution.t < _LATEST)))
        if len(wrong):
            what = f"time {execution.t[wrong[0]]} s cannot follow {before[wrong[0]]} s"
            raise RunLogError(str(self._file.path), what)
        about = {"names": execution.names, "judge": execution.judge}
        first = self._samples
        for these in _parts_of(execution.t[first:end], ended):
            these = slice(first + these.start, first + these.stop)
            part = {signal.name: values[these] for signal, values in series_of(execution)}
            self._numbered(SAMPLES, {"first": these.start, **about, "arrays": part})
            self._samples = these.stop

    def feedback(self, feedback: Feedback) -> None:
        """Write the new measurements, events and replans of a closed loop."""
        first, measured = self._measured, feedback.measured
        if len(measured.t) > first:
            new = {signal.name: values[first:] for signal, values in series_of(measured)}
            self._numbered(MEASURED, Measured(**new))
            self._measured = len(measured.t)
        for event in feedback.events[self._counts[EVENT] :]:
            self._numbered(EVENT, event)
        for replan in feedback.replans[self._counts[REPLAN] :]:
            result = None if replan.result is None else metadata.without_clock(replan.result)
            self._numbered(REPLAN, replace(replan, seconds=math.nan, result=result))
        if self._measured or feedback.events or feedback.replans:
            self._run = replace(self._run, feedback=feedback)

    def trial(self, end: TrialEnd) -> None:
        """Write the outcome of a Monte Carlo sample."""
        self._numbered(TRIAL, end)

    def finish(self, outcome: str, seconds: Mapping[str, float] | None = None) -> None:
        """End the log and give it its final name.

        Args:
            outcome: Outcome of the run in one word: solved, unsolved, ...
            seconds: Wall-clock time of each phase, s, for the metadata `pushplan.result`.

        Raises:
            OutputError: If the file cannot be written; the incomplete file stays under `partial`.
        """
        spent = {f"{phase}_s": metadata.exact(time) for phase, time in (seconds or {}).items()}
        self._end({"outcome": outcome, **spent})
        self._file.publish()

    def _send(self, instant: int, topic: schemas.Topic, data: bytes) -> None:
        if not self._channels:
            numbers: dict[str, int] = {}
            for one in schemas.TOPICS:
                if one.kind not in numbers:
                    numbers[one.kind] = self._writer.register_schema(one.kind, "protobuf", one.schema)
                self._channels[one.name] = self._writer.register_channel(one.name, "protobuf", numbers[one.kind])
        channel = self._channels[topic.name]
        self._writer.add_message(channel, instant, data, instant, self._sequence[channel])
        self._sequence[channel] += 1

    def _end(self, words: Mapping[str, str]) -> None:
        """Write the messages and the result of the run."""
        self._finished, run = True, self._run
        lines = lines_of(run.scenario, run.plan, run.execution, run.feedback, self._others)
        for instant, topic, data in messages(replace(run, lines=lines)):
            self._send(instant, topic, data)
        self._writer.flush()  # type: ignore[no-untyped-call]
        fields = {**metadata.result_words(run), **words, "finished_at": metadata.now()}
        self._digest.add_words(metadata.RESULT, fields)
        self._writer.add_metadata(metadata.RESULT, {**fields, metadata.DIGEST: self._digest.hexdigest()})
        self._writer.finish()  # type: ignore[no-untyped-call]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the file; see `abandon`."""
        self.abandon(error)

    def discard(self) -> None:
        """Remove the unfinished file."""
        self._file.discard()

    def abandon(self, error: BaseException | None) -> None:
        """Close the file; an unfinished one stays, with the reason in its metadata if possible."""
        if not self._finished:
            words = {"outcome": "unfinished"}
            with contextlib.suppress(OutputError):  # nothing more can be written; the first error counts
                if error is not None:
                    outcome = "interrupted" if isinstance(error, KeyboardInterrupt) else "failed"
                    words = {"outcome": outcome, "error": f"{type(error).__name__}: {error}"}
                    self.log("error", f"{outcome}: {words['error']}")
                self._end(words)
        self._file.close()
