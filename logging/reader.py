"""Reader of run logs; it restores the original objects, and damaged or hostile files end in one typed error."""

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
"""Bytes of memory for each byte of a scenario's file, including the numbers of a pressure map."""

_USED_TWICE = "the name is used twice; a file with two run logs cannot be read"

_ITEM = 12 << 10
"""Smallest memory that is counted for an attachment, bytes, because reading each one takes time."""


def load_run(path: Path | str, *, recover: bool | None = None, messages: bool = False) -> RecordedRun:
    """Read the log of a run.

    Args:
        path: Path of the log.
        recover: Whether a damaged file is read up to the damage, with the lost parts in `losses`. None recovers only
            files whose name ends in .partial.
        messages: Whether to keep the messages for viewers, too, for `verify`.

    Returns:
        The run; every array equals the recorded one bit for bit.

    Raises:
        RunLogError: If the file is damaged (and not recovered), is not a run log, or has another format.
    """
    path = Path(path)
    damaged = path.name.endswith(PARTIAL) if recover is None else recover
    file = McapFile(path, recover=damaged, topics=None if messages else ())
    reading = _Reading(file)
    for item in file.items():
        reading.take(item)
    return reading.finish()


read_run = load_run
"""Older name of `load_run`, which scripts use."""


class _Reading:
    """Builds a run from the items of a file."""

    def __init__(self, file: McapFile) -> None:
        self._file = file
        self._words: dict[str, dict[str, str]] = {}
        self._files: dict[str, Attachment] = {}
        self._messages: list[Message] = []
        self._foreign: list[str] = []
        self._digest = metadata.Digest()

    def take(self, item: Item) -> None:
        """Process the next item of the file."""
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
        if not item.name.startswith(writer.ATTACHMENTS):  # from another program, as in merged logs
            self._foreign.append(item.name)
            return
        if item.name in self._files:
            raise ValueError(_USED_TWICE)
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
            raise ValueError(_USED_TWICE)
        if item.name == metadata.RUN and item.words.get("format") != str(metadata.FORMAT):
            other, by = item.words.get("format"), item.words.get("version.pushplan", "?")
            what = f"a run log of format {other} from pushplan {by}; this version reads format {metadata.FORMAT}"
            raise RunLogError(str(self._file.path), what, item.offset)
        self._digest.add_words(item.name, item.words)
        self._words[item.name] = item.words

    def finish(self) -> RecordedRun:
        """Return the run after the whole file was read.

        Raises:
            RunLogError: If a part of a run log is missing.
        """
        file = self._file
        file.require(metadata.RUN in self._words, f"the metadata {metadata.RUN!r} of a run log")
        scenario, other = self._read_scenario()
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
            raise RunLogError(str(file.path), f"its contents are not a valid run: {error}", file.size) from error
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
        """Compare the contents with the digest in the result.

        Raises:
            RunLogError: If they differ and the file is not recovered.
        """
        stated = self._words.get(metadata.RESULT, {}).get(metadata.DIGEST)
        if metadata.RESULT in self._words and stated != self._digest.hexdigest():
            what = "its attachments or metadata were changed after writing (their digest differs)"
            self._file.lose(DamageError(what, self._file.size))

    def _read_scenario(self) -> tuple[Scenario, bool]:
        """Return the scenario, and whether the resolved one differs from its file with the settings.

        The user's file takes precedence, unless this version of pushplan resolves it differently from the version
        that wrote the log; then the resolved one does. For a recovered log, one of the two is enough.
        """
        names = [name for name in (writer.SCENARIO_FILE, writer.SCENARIO_JSON) if name in self._files]
        for name in (writer.SCENARIO_FILE, writer.SCENARIO_JSON):
            self._file.require(name in names, f"the attachment {name!r}", vital=not names)
        scenario = self._parsed(names[0])
        if len(names) == 1 or scenario.to_json().encode() == self._files[writer.SCENARIO_JSON].data:
            return scenario, False
        resolved = self._parsed(writer.SCENARIO_JSON)  # a missing name is that of the original file
        scenario = replace(scenario, name=resolved.name)
        for known in (scenario, self._with_settings(scenario)):
            if known.to_json().encode() == self._files[writer.SCENARIO_JSON].data:
                return known, False
        # The resolved scenario no longer names its map files, but its source does.
        return replace(resolved, source=scenario.source, attachments=scenario.attachments), True

    def _with_settings(self, scenario: Scenario) -> Scenario:
        """Return a scenario with the settings of the run."""
        try:
            return metadata.settings_in(self._words.get(metadata.RUN, {})).applied(scenario)
        except (ValueError, PushplanError) as error:
            raise RunLogError(str(self._file.path), f"its settings are invalid: {error}", self._file.size) from error

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
            what = f"its scenario is invalid: {error}"
            raise RunLogError(str(self._file.path), what, text.offset) from error

    def _decoded(self, name: str) -> Any:
        """Return the value of an attachment; None if there is no such attachment."""
        found = self._files.get(name)
        try:
            return None if found is None else decode(found.data, self._scenario)
        except PushplanError as error:
            what = f"attachment {name!r}: {error}"
            raise RunLogError(str(self._file.path), what, found.offset if found else 0) from error

    def _numbered(self, name: str, kind: type | Callable[[Any], bool]) -> list[Any]:
        """Return the values of the numbered attachments of a name, up to the first gap in the numbers."""
        found: list[Any] = []
        while (key := f"{name}{len(found):06d}.bin") in self._files:
            value = self._decoded(key)
            if not (isinstance(value, kind) if isinstance(kind, type) else kind(value)):
                raise CodecError(f"the attachment {key!r} holds a value of another type")
            found.append(value)
        count = sum(key.startswith(name) for key in self._files)
        self._file.require(count == len(found), f"the attachment {name}{len(found):06d}.bin")
        return found

    def _execution(self) -> Execution | None:
        """Return the recorded part of the execution; None without samples."""
        parts, end = self._numbered(writer.SAMPLES, _is_part), self._decoded(writer.END)
        self._file.require(end is not None or not parts, "the end of the execution")
        if not parts:
            return None
        first, count = parts[0], 0
        for part in parts:
            same = all(tuple(part[key]) == tuple(first[key]) for key in ("names", "judge", "arrays"))
            if not same or part["first"] != count:
                raise CodecError(f"samples of the execution do not follow sample {count - 1}")
            count += len(part["arrays"]["t"])
        if tuple(first["names"]) != tuple(self._scenario.poses):
            raise CodecError("the execution has other objects than the scenario")
        arrays = self._joined(Execution, [part["arrays"] for part in parts])
        loss, error = self._end(end, count)
        return Execution(first["names"], first["judge"], **arrays, loss=loss, goal_error=error)

    def _end(self, end: Any, count: int) -> tuple[StabilityLoss | None, tuple[float, float]]:
        """Return the loss and the error at the goal; NaN if samples are missing."""
        if end is not None and end["samples"] == count:
            match end:
                case {"loss": StabilityLoss() | None as loss, "goal_error": (float(position), float(angle))}:
                    return loss, (position, angle)
            raise CodecError("the end of the execution has invalid fields")
        if end is not None:
            self._file.require(False, f"samples {count} to {end['samples'] - 1} of the execution")
        return None, (math.nan, math.nan)

    def _feedback(self) -> Feedback | None:
        """Return measurements, events and replans of a closed loop; None for other runs."""
        measured: list[Measured] = self._numbered(writer.MEASURED, Measured)
        events = self._numbered(writer.EVENT, Event)
        replans: list[Replan] = self._numbered(writer.REPLAN, Replan)
        if not (measured or events or replans):
            return None
        parts = [{signal.name: values for signal, values in series_of(part)} for part in measured]
        arrays = self._joined(Measured, parts) if parts else {"t": np.zeros(0), "poses": np.zeros((0, 1, 3))}
        return Feedback(Measured(**arrays), tuple(events), tuple(replans))

    def _joined(self, kind: type, parts: Sequence[Mapping[str, NDArray[Any]]]) -> dict[str, Any]:
        """Return the read-only series of a record, joined from the parts in the log."""
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
        """Return the outcomes of the Monte Carlo samples."""
        ends: list[TrialEnd] = self._numbered(writer.TRIAL, TrialEnd)
        names = list(self._scenario.poses)
        count = len(names)
        for k, end in enumerate(ends):
            shapes = end.errors.shape == (count, 2) and end.objects.shape == (count, 3)
            if end.sample != k or not shapes or end.object not in (names if end.contact else [""]):
                raise CodecError(f"trial {k} has another number of objects than {count}, or another sample")
        return tuple(ends)


def _is_line(value: Any) -> bool:
    """Return whether a value is a log line: (time, level, text)."""
    match value:
        case (float(), str(level), str()):
            return level in schemas.LEVELS
    return False


def _is_part(value: Any) -> bool:
    """Return whether a value is a part of an execution."""
    match value:
        case {"first": int(), "names": tuple(names), "judge": str(), "arrays": dict(arrays)}:
            return arrays.keys() <= SIGNALS[Execution].keys() and all(isinstance(name, str) for name in names)
    return False
