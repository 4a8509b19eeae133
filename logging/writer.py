"""Writes the log of a run, so that a kill at any moment loses nothing that was known before.

A run is written as attachments, each when it is known: the scenario, every improvement of the path, the plan, every
simulated second of the execution, what was measured and noticed. When the run is over, the messages for viewers are
made from it (`topics`). The log grows as NAME.mcap.partial and becomes NAME.mcap when it is finished.

Two runs with the same seed write the same bytes, except in these fields of the metadata (as long in both, on one
machine with the same versions): `started_at`, `finished_at`, `machine`, `git`, `sha256`, `iterations`, and times of
the clock, `..._s`.
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
"""Attachments: the scenario byte for byte; with everything resolved that it leaves open; the files it refers to."""

PLAN, IMPROVEMENT, SAMPLES, END = "plan.bin", "improvement/", "execution/", "execution.bin"
"""Attachments: the plan; followed by a number, an improvement of the path; likewise, a simulated second of the
execution; what the execution came to."""

MEASURED, EVENT, REPLAN, TRIAL, LINE = "measured/", "event/", "replan/", "trial/", "line/"
"""Attachments, followed by a number: measurements, events, plans on the way, ends of trials, other lines of /log."""

ENCODED = (PLAN, IMPROVEMENT, SAMPLES, END, MEASURED, EVENT, REPLAN, TRIAL, LINE)
"""Of all of these, what `codec` encodes."""

ATTACHMENTS = (SCENARIO_FILE, SCENARIO_JSON, SCENARIO_FOLDER, LAYOUT_FILE, *ENCODED)
"""What names of attachments begin with."""

_LATEST = 1 << 33
"""Simulated time has to be before this, s."""

_FEWEST = 40
"""Samples of a part of the execution: of hours, sampled coarsely, a part for each second is more than is read."""


def _parts_of(t: FloatArray, ended: bool) -> Iterator[slice]:
    """Yield the samples of each simulated second, or of several with `_FEWEST` of them, given their times (m,).

    Args:
        t: The times.
        ended: Yield the rest, too, whatever its number.
    """
    begin = 0
    for cut in (np.flatnonzero(np.diff(np.floor(t))) + 1).tolist():
        if cut - begin >= _FEWEST:
            yield slice(begin, cut)
            begin = cut
    if len(t) - begin >= (1 if ended else _FEWEST):
        yield slice(begin, len(t))


class RunLogWriter:
    """A log being written: a context manager that never leaves half a file under the final name.

    Example:
        >>> with RunLogWriter.create("run.mcap", scenario, {"seed": 1}) as log:
        ...     log.plan(plan(scenario, seed=1))
        ...     log.finish("solved")

    Without `finish`, or with an exception inside, the file stays under `partial` and its metadata say why. Whatever
    writes raises OutputError when the file cannot be written.
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
        """Begin a log: what the run starts from is written when this returns.

        Args:
            path: Final name of the log. A file of that name is replaced when the log is finished, not before.
            scenario: What the run is about, with the settings of the plan (`Planner.scenario`).
            settings: Names and values for the metadata `pushplan.run`: planner, set, seed, ...
            words: The metadata `pushplan.run` of a run that is over; None for one that begins now.
            new: Refuse a name that there is already.
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
        """Name of the file until it is finished."""
        return self._file.partial

    def _attach(self, name: str, data: bytes, media_type: str = MEDIA_TYPE) -> None:
        """Write an attachment; when this returns, no kill can lose it."""
        self._digest.add(name, data)
        self._writer.add_attachment(0, 0, name, media_type, data)

    def _numbered(self, name: str, value: object) -> None:
        self._attach(f"{name}{self._counts[name]:06d}.bin", encode(value))
        self._counts[name] += 1

    def log(self, level: str, text: str) -> None:
        """Write a line to /log.

        Args:
            level: One of `schemas.LEVELS`.
            text: What to say; without wall-clock times, which would differ from run to run.

        Raises:
            ValueError: When the level is none of them.
            OutputError: When the file cannot be written.
        """
        if level not in schemas.LEVELS:
            raise ValueError(f"level {level!r} is none of {', '.join(schemas.LEVELS)}")
        execution = self._run.execution
        time = 0.0 if execution is None or not len(execution.t) else float(execution.t[-1])
        self.line(LogLine(time, level, text))

    def line(self, line: LogLine) -> None:
        """Write a line to /log as it is."""
        self._others.append(line)
        self._numbered(LINE, (line.time, line.level, line.text))

    def note(self, name: str, words: Mapping[str, str]) -> None:
        """Write metadata under a name that begins with `pushplan.`."""
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
        """Write what planning found, and what it took; improvements that `improved` has written are not repeated."""
        for point in plan.improvements[len(self._run.improvements) :]:
            self.improved(point)
        self.note(metadata.PLANNING, metadata.planning_words(plan))
        self._attach(PLAN, encode(metadata.without_clock(plan)))
        self._attach(LAYOUT_FILE, layout_text(self._run.scenario, plan), "application/json")
        self._run = replace(self._run, plan=plan)

    def samples(self, execution: Execution) -> None:
        """Write the simulated seconds of an execution that are over and not written yet.

        Args:
            execution: As far as it has come; the samples that were written before are the same.

        Raises:
            RunLogError: When times go back or are no numbers.
            OutputError: When the file cannot be written.
        """
        over = int(np.searchsorted(execution.t, np.floor(execution.t[-1]))) if len(execution.t) else 0
        self._write_samples(execution, over, ended=False)
        if self._samples:
            self._run = replace(self._run, execution=execution.until(self._samples))

    def execution(self, execution: Execution) -> None:
        """Write what the simulator made of the plan, a simulated second at a time, as far as it is not written yet.

        Raises:
            RunLogError: When times go back or are no numbers.
            OutputError: When the file cannot be written.
        """
        self._write_samples(execution, len(execution.t), ended=True)
        end = {"samples": len(execution.t), "goal_error": execution.goal_error, "loss": execution.loss}
        self._attach(END, encode(end))
        self._run = replace(self._run, execution=execution)

    def _write_samples(self, execution: Execution, end: int, ended: bool) -> None:
        """Write the samples of an execution up to one, but for those that were written before."""
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
        """Write what a closed loop has measured, noticed, done and planned and is not written yet."""
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
        """Write how the plan ended in a sampled world."""
        self._numbered(TRIAL, end)

    def finish(self, outcome: str, seconds: Mapping[str, float] | None = None) -> None:
        """End the log and give it its final name.

        Args:
            outcome: How the run ended, in a word: solved, unsolved, ...
            seconds: Wall-clock time of each phase, for the metadata `pushplan.result`.

        Raises:
            OutputError: When the file cannot be written; what is there stays under `partial`.
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
        """Write messages and result of the run."""
        self._finished, run = True, self._run
        lines = lines_of(run.scenario, run.plan, run.execution, run.feedback, self._others)
        for instant, topic, data in messages(replace(run, lines=lines)):
            self._send(instant, topic, data)
        self._writer.flush()  # type: ignore[no-untyped-call]
        told = {**metadata.result_words(run), **words, "finished_at": metadata.now()}
        self._digest.add_words(metadata.RESULT, told)
        self._writer.add_metadata(metadata.RESULT, {**told, metadata.DIGEST: self._digest.hexdigest()})
        self._writer.finish()  # type: ignore[no-untyped-call]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the file; see `abandon`."""
        self.abandon(error)

    def discard(self) -> None:
        """Remove the file, which was not finished."""
        self._file.discard()

    def abandon(self, error: BaseException | None) -> None:
        """Close the file; if it was not finished, say why in it, as far as that can be written, and leave it."""
        if not self._finished:
            words = {"outcome": "unfinished"}
            with contextlib.suppress(OutputError):  # nothing more can be written; the first error counts
                if error is not None:
                    outcome = "interrupted" if isinstance(error, KeyboardInterrupt) else "failed"
                    words = {"outcome": outcome, "error": f"{type(error).__name__}: {error}"}
                    self.log("error", f"{outcome}: {words['error']}")
                self._end(words)
        self._file.close()
