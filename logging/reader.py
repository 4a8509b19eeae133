"""Reads a run log back into the objects that the run had; damaged and hostile files end in one typed error."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import pushplan.logging.metadata as metadata
import pushplan.logging.schemas as schemas
import pushplan.logging.writer as writer
from pushplan.errors import PushplanError, RunLogError, ScenarioError
from pushplan.logging.codec import CodecError, decode, memory
from pushplan.logging.mcap_file import Attachment, DamageError, Item, McapFile, Message, Metadata
from pushplan.logging.recorded import LogLine, RecordedRun
from pushplan.logging.signals import SIGNALS, series_of
from pushplan.logging.topics import lines_of
from pushplan.plans.execution import Execution, StabilityLoss, TrialEnd
from pushplan.plans.plan import Improvement, Plan
from pushplan.plans.run import Event, Feedback, Measured, Replan
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.util.files import PARTIAL

_SCENARIO_MEMORY = 5
"""Bytes of memory for each byte of a scenario's file: of a pressure map, its numbers as well."""

_TWICE = "there are two of that name; two run logs in one file cannot be told apart"

_ITEM = 12 << 10
"""Memory, in bytes, charged for each attachment, at least: reading one takes time."""


def load_run(path: Path | str, *, recover: bool | None = None, messages: bool = False) -> RecordedRun:
    """Read the log of a run.

    Args:
        path: The file.
        recover: Read a damaged file up to the damage and list in `losses` what is lost. By default files whose name
            ends in .partial are recovered and others are not.
        messages: Keep what viewers see as well, for `verify`.

    Returns:
        The run; every array as it was recorded, bit for bit.

    Raises:
        RunLogError: When the file is damaged (and not to be recovered), no run log, or of another format.
    """
    path = Path(path)
    damaged = path.name.endswith(PARTIAL) if recover is None else recover
    file = McapFile(path, recover=damaged, topics=None if messages else ())
    reading = _Reading(file)
    for item in file.items():
        reading.take(item)
    return reading.finish()


read_run = load_run
"""The same, by its older name, which scripts use."""


class _Reading:
    """Turns the items of a file, one after another, into a run."""

    def __init__(self, file: McapFile) -> None:
        self._file = file
        self._words: dict[str, dict[str, str]] = {}
        self._files: dict[str, Attachment] = {}
        self._messages: list[Message] = []
        self._foreign: list[str] = []
        self._digest = metadata.Digest()

    def take(self, item: Item) -> None:
        """Take the next item of the file."""
        try:
            match item:
                case Message():
                    self._file.keep(len(item.data) + 256, item.offset)
                    self._messages.append(item)
                case Attachment():
                    self._take_attachment(item)
                case Metadata():
                    self._take_metadata(item)
        except DamageError as damage:
            self._file.lose(damage)
        except (CodecError, KeyError, ValueError, PushplanError) as error:
            if isinstance(error, RunLogError):
                raise
            name = item.topic if isinstance(item, Message) else repr(item.name)
            self._file.lose(DamageError(f"{name}: {error}", item.offset))

    def _take_attachment(self, item: Attachment) -> None:
        if not item.name.startswith(writer.ATTACHMENTS):  # of whoever merged logs
            self._foreign.append(item.name)
            return
        if item.name in self._files:
            raise ValueError(_TWICE)
        encoded = item.name.endswith(".bin") and item.name.startswith(writer.ENCODED)
        cost = memory(item.data) if encoded else _SCENARIO_MEMORY * len(item.data)
        self._file.keep(max(cost, _ITEM), item.offset)
        self._digest.add(item.name, item.data)
        self._files[item.name] = item

    def _take_metadata(self, item: Metadata) -> None:
        if not item.name.startswith("pushplan."):
            self._foreign.append(item.name)
            return
        if item.name in self._words:
            raise ValueError(_TWICE)
        if item.name == metadata.RUN and item.words.get("format") != str(metadata.FORMAT):
            other, by = item.words.get("format"), item.words.get("version.pushplan", "?")
            what = f"a run log of format {other}, by pushplan {by}; this version reads format {metadata.FORMAT}"
            raise RunLogError(str(self._file.path), what, item.offset)
        self._digest.add_words(item.name, item.words)
        self._words[item.name] = item.words

    def finish(self) -> RecordedRun:
        """Return the run, once the file has been read.

        Raises:
            RunLogError: When something is missing that a run log has.
        """
        file = self._file
        file.require(metadata.RUN in self._words, f"the metadata {metadata.RUN!r} of a run log")
        scenario, other = self._stated()
        self._scenario = self._with_settings(scenario)
        file.require(metadata.RESULT in self._words, f"the metadata {metadata.RESULT!r}")
        self._check_digest()
        try:
            plan, execution, feedback = self._decoded(writer.PLAN), self._execution(), self._feedback()
            if not isinstance(plan, Plan | None):
                raise CodecError(f"the attachment {writer.PLAN!r} holds no plan")
            if plan is not None:
                plan = metadata.with_clock(plan, self._words[metadata.PLANNING])
            others = [LogLine(*line) for line in self._numbered(writer.LINE, _is_line)]
            points, trials = self._numbered(writer.IMPROVEMENT, Improvement), self._trials()
            words = [self._words.get(f"{metadata.PROGRESS}.{k:04d}", {}) for k in range(len(points))]
            found = [float(each.get("found_s", "nan")) for each in words]
            improvements = tuple(replace(point, seconds=s) for point, s in zip(points, found, strict=True))
        except RunLogError:
            raise
        except (CodecError, KeyError, ValueError, TypeError, PushplanError) as error:
            raise RunLogError(str(file.path), f"what it holds is no run: {error}", file.size) from error
        if plan is not None:
            plan = replace(plan, execution=execution, improvements=improvements)
        return RecordedRun(
            path=file.path,
            scenario=scenario,
            plan=plan,
            execution=execution,
            feedback=feedback,
            trials=trials,
            improvements=improvements,
            lines=lines_of(scenario, plan, execution, feedback, others),
            other_scenario=other,
            fields=self._words,
            losses=tuple(file.losses),
            foreign=tuple(self._foreign),
            messages=tuple(self._messages),
            channels=file.channels,
        )

    def _check_digest(self) -> None:
        """Compare what was read with the digest in the result.

        Raises:
            RunLogError: When they differ, and the file is not to be recovered.
        """
        stated = self._words.get(metadata.RESULT, {}).get(metadata.DIGEST)
        if metadata.RESULT in self._words and stated != self._digest.hexdigest():
            what = "its attachments and metadata are not those that were written (their digest differs)"
            self._file.lose(DamageError(what, self._file.size))

    def _stated(self) -> tuple[Scenario, bool]:
        """Return the scenario, and whether the resolved one differs from what its file and the settings come to.

        The file as the user wrote it counts, unless this version of pushplan fills its gaps differently from the
        version that wrote the log; then the resolved one counts. Of a log to be recovered, either one will do.
        """
        names = [name for name in (writer.SCENARIO_FILE, writer.SCENARIO_JSON) if name in self._files]
        for name in (writer.SCENARIO_FILE, writer.SCENARIO_JSON):
            self._file.require(name in names, f"the attachment {name!r}", vital=not names)
        scenario = self._parsed(names[0])
        if len(names) == 1 or scenario.to_json().encode() == self._files[writer.SCENARIO_JSON].data:
            return scenario, False
        resolved = self._parsed(writer.SCENARIO_JSON)  # a name that is not stated is that of a file unknown here
        scenario = replace(scenario, name=resolved.name)
        for known in (scenario, self._with_settings(scenario)):
            if known.to_json().encode() == self._files[writer.SCENARIO_JSON].data:
                return known, False
        # The resolved one names no map any more, its source does.
        return replace(resolved, source=scenario.source, attachments=scenario.attachments), True

    def _with_settings(self, scenario: Scenario) -> Scenario:
        """Return a scenario as it was planned in."""
        try:
            return metadata.settings_in(self._words.get(metadata.RUN, {})).applied(scenario)
        except (ValueError, PushplanError) as error:
            raise RunLogError(str(self._file.path), f"its settings cannot be: {error}", self._file.size) from error

    def _parsed(self, name: str) -> Scenario:
        text = self._files[name]
        referred = {
            key.removeprefix(writer.SCENARIO_FOLDER): file.data
            for key, file in self._files.items()
            if key.startswith(writer.SCENARIO_FOLDER)
        }
        try:
            return scenario_from_text(text.data, self._file.path / name, referred)
        except ScenarioError as error:
            what = f"the scenario in it is refused: {error}"
            raise RunLogError(str(self._file.path), what, text.offset) from error

    def _decoded(self, name: str) -> Any:
        """Return the value of an attachment; None where there is none."""
        found = self._files.get(name)
        try:
            return None if found is None else decode(found.data, self._scenario)
        except PushplanError as error:
            what = f"attachment {name!r}: {error}"
            raise RunLogError(str(self._file.path), what, found.offset if found else 0) from error

    def _numbered(self, name: str, kind: type | Callable[[Any], bool]) -> list[Any]:
        """Return the values of the attachments of a name and a number, as far as the numbers have no gap."""
        found: list[Any] = []
        while (key := f"{name}{len(found):06d}.bin") in self._files:
            value = self._decoded(key)
            if not (isinstance(value, kind) if isinstance(kind, type) else kind(value)):
                raise CodecError(f"the attachment {key!r} holds something else than its name says")
            found.append(value)
        count = sum(key.startswith(name) for key in self._files)
        self._file.require(count == len(found), f"the attachment {name}{len(found):06d}.bin")
        return found

    def _execution(self) -> Execution | None:
        """Return the execution as far as it has come, None when none has begun."""
        parts, end = self._numbered(writer.SAMPLES, _is_part), self._decoded(writer.END)
        self._file.require(end is not None or not parts, "the end of the execution")
        if not parts:
            return None
        first, count = parts[0], 0
        for part in parts:
            same = all(tuple(part[key]) == tuple(first[key]) for key in ("names", "judge", "arrays"))
            if not same or part["first"] != count:
                raise CodecError(f"samples that do not follow sample {count - 1}")
            count += len(part["arrays"]["t"])
        if tuple(first["names"]) != tuple(self._scenario.poses):
            raise CodecError("an execution with other objects than the scenario's")
        arrays = self._joined(Execution, [part["arrays"] for part in parts])
        loss, error = self._end(end, count)
        return Execution(first["names"], first["judge"], **arrays, loss=loss, goal_error=error)

    def _end(self, end: Any, count: int) -> tuple[StabilityLoss | None, tuple[float, float]]:
        """Return the loss and the error at the goal; NaN where samples are missing."""
        if end is not None and end["samples"] == count:
            match end:
                case {"loss": StabilityLoss() | None as loss, "goal_error": (float(position), float(angle))}:
                    return loss, (position, angle)
            raise CodecError("the end of the execution holds something else")
        if end is not None:
            self._file.require(False, f"samples {count} to {end['samples'] - 1} of the execution")
        return None, (math.nan, math.nan)

    def _feedback(self) -> Feedback | None:
        """Return what a closed loop measured, noticed and planned; None where it is none."""
        measured: list[Measured] = self._numbered(writer.MEASURED, Measured)
        events = self._numbered(writer.EVENT, Event)
        replans: list[Replan] = self._numbered(writer.REPLAN, Replan)
        if not (measured or events or replans):
            return None
        parts = [{signal.name: values for signal, values in series_of(part)} for part in measured]
        arrays = self._joined(Measured, parts) if parts else {"t": np.zeros(0), "poses": np.zeros((0, 1, 3))}
        return Feedback(Measured(**arrays), tuple(events), tuple(replans))

    def _joined(self, kind: type, parts: Sequence[Mapping[str, NDArray[Any]]]) -> dict[str, Any]:
        """Return the series of a record, read-only, of which a log has parts."""
        count, arrays = sum(len(part["t"]) for part in parts), {}
        for name in parts[0]:
            values, signal = np.concatenate([part[name] for part in parts]), SIGNALS[kind][name]
            shape = signal.shape(count, len(self._scenario.poses))
            if values.shape != shape or values.dtype != signal.dtype:
                raise CodecError(f"array {name!r} has shape {values.shape}, not {shape}")
            values.setflags(write=False)
            arrays[name] = values
        return arrays

    def _trials(self) -> tuple[TrialEnd, ...]:
        """Return how the plan ended in sampled worlds."""
        ends: list[TrialEnd] = self._numbered(writer.TRIAL, TrialEnd)
        names = list(self._scenario.poses)
        count = len(names)
        for k, end in enumerate(ends):
            shapes = end.errors.shape == (count, 2) and end.objects.shape == (count, 3)
            if end.sample != k or not shapes or end.object not in (names if end.contact else [""]):
                raise CodecError(f"trial {k} is none of {count} objects, or of another sample")
        return tuple(ends)


def _is_line(value: Any) -> bool:
    """Tell whether a value is time, level and text of a line."""
    match value:
        case (float(), str(level), str()):
            return level in schemas.LEVELS
    return False


def _is_part(value: Any) -> bool:
    """Tell whether a value is a part of an execution."""
    match value:
        case {"first": int(), "names": tuple(names), "judge": str(), "arrays": dict(arrays)}:
            return arrays.keys() <= SIGNALS[Execution].keys() and all(isinstance(name, str) for name in names)
    return False
