"""Verification of a log: execute the recorded plan again, and generate every message again.

For every kind of log, it compares:

- the execution, sample by sample, with a new one of the recorded plan (if the log has its world; that of slipping
  objects is not recorded);
- every message byte by byte, and differing ones field by field, with times, numbers, order and schemas;
- every field of the metadata that follows from plan and execution.

The reader has already checked the digest of all attachments and metadata, and so of the measurements.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from google.protobuf.message import DecodeError
from google.protobuf.message import Message as ProtobufMessage

import pushplan.logging.metadata as metadata
import pushplan.logging.schemas as schemas
from pushplan.geometry.se2 import compose, exp
from pushplan.logging.mcap_file import Channel, Message
from pushplan.logging.recorded import RecordedRun
from pushplan.logging.runs import number_in
from pushplan.logging.signals import SIGNALS, series_of
from pushplan.logging.topics import messages
from pushplan.plans.execution import Execution
from pushplan.util.arrays import FloatArray

TOLERANCE = 1e-9
"""Largest difference that counts as rounding, in SI units; for forces, relative to the largest one."""

NOT_COMPARED = (
    "clock times, machine, versions and settings",
    "steps and tree of the search",
    "lines of /log that do not follow from the run",
    "layout.json",
    "times and types of attachments, header and index of the file",
)
ELSEWHERE = "object motion (in a world that the log does not hold)"
"""Unverified parts of a log; `ELSEWHERE` if the execution cannot be repeated."""


@dataclass(frozen=True)
class Check:
    """Comparison of one quantity.

    Attributes:
        quantity: Compared quantity.
        difference: Largest difference; infinite if one side is missing.
        tolerance: Largest allowed difference.
        time: Simulated time of the largest difference, s; None for a quantity without time.
        what: Description of a difference that is not a number.
    """

    quantity: str
    difference: float
    tolerance: float = TOLERANCE
    time: float | None = None
    what: str = ""

    @property
    def matches(self) -> bool:
        """Whether the difference is within the tolerance."""
        return self.difference <= self.tolerance  # False for NaN

    @property
    def text(self) -> str:
        """Outcome as a sentence."""
        if self.what:
            return f"{self.quantity}: {self.what}"
        at = "" if self.time is None else f" at {self.time:.3f} s"
        sign = "<=" if self.matches else ">"
        return f"{self.quantity}: differs by {self.difference:.3g}{at} ({sign} {self.tolerance:.3g})"


@dataclass(frozen=True)
class VerifyReport:
    """All comparisons of one run.

    Attributes:
        checks: Comparisons.
        versions: Packages whose versions differ from those in the log, as text.
        not_compared: Unverified parts of the log, as text.
    """

    checks: tuple[Check, ...]
    versions: tuple[str, ...] = ()
    not_compared: tuple[str, ...] = NOT_COMPARED

    @property
    def matches(self) -> bool:
        """Whether every comparison is within its tolerance."""
        return all(check.matches for check in self.checks)

    @property
    def mismatches(self) -> tuple[Check, ...]:
        """Comparisons beyond their tolerance."""
        return tuple(check for check in self.checks if not check.matches)


def verify(run: RecordedRun, execute: Callable[[RecordedRun], Execution | None]) -> VerifyReport:
    """Compare a recorded run with a new execution of its plan and with newly generated messages.

    Args:
        run: Run from `load_run(path, messages=True)`.
        execute: Function that executes the plan of a run again; it returns None if the world is not known.

    Raises:
        PushplanError: If the recorded plan cannot be executed.
    """
    checks: list[Check] = []
    said = {key: value for key, value in run.fields.get(metadata.RUN, {}).items() if key.startswith("version.")}
    now = {f"version.{name}": version for name, version in metadata.versions().items()}
    others = [(key, value, now.get(key, "")) for key, value in said.items() if value != now.get(key)]
    versions = tuple(f"{key.removeprefix('version.')} {value}, now {new}" for key, value, new in others)
    if run.other_scenario and not any(one.startswith("pushplan ") for one in versions):
        what = "differs from the resolved scenario file"
        checks.append(Check("scenario.json", math.inf, what=what))
    revision = number_in(run.fields.get(metadata.RUN, {}).get("topics", "")) or 0.0
    left_out: list[str] = []
    if run.execution is not None:
        again = execute(run)
        if again is None:
            left_out.append(ELSEWHERE)
        else:
            checks += _compare_executions(run.execution, again, revision, left_out)
    records = (run.execution, None if run.feedback is None else run.feedback.measured)
    recorded = [signal for record in records if record is not None for signal, _ in series_of(record)]
    left_out += [f"{signal.quantity} (it does not follow from the plan)" for signal in recorded if not signal.decided]
    checks += _compare_messages(run, revision, left_out)
    checks += _compare_words(run)
    return VerifyReport(tuple(checks), versions, (*NOT_COMPARED, *left_out))


def check_way(execution: Execution) -> Check:
    """Compare the poses of an execution with the twists between them."""
    steps = np.diff(execution.t)[:, None]
    after = compose(execution.poses[:-1], exp(execution.twists[:-1] * steps))
    return series_check("path of the plate", execution.t[1:], execution.poses[1:], after)


def _compare_executions(
    recorded: Execution, again: Execution, revision: float, left_out: list[str]
) -> Iterator[Check]:
    """Compare two executions of the same plan; the recorded one can be truncated.

    Series that an older log lacks (by its `revision`) are added to `left_out`.
    """
    cut = math.isnan(recorded.goal_error[0])
    count = min(len(recorded.t), len(again.t))
    if not cut:
        yield Check("number of samples", abs(len(recorded.t) - len(again.t)), 0.0)
    for name, signal in SIGNALS[Execution].items():
        first, second = getattr(recorded, name), getattr(again, name)
        if (first is None and second is None) or not signal.decided:
            continue
        if first is None and signal.since > revision:
            left_out.append(f"{signal.quantity} (the log is older)")
        elif first is None or second is None:
            yield Check(signal.quantity, math.inf, what="unknown on one side")
        else:
            largest = float(np.abs(second).max(initial=1.0, where=np.isfinite(second)))
            tolerance = TOLERANCE * (largest if signal.unit.startswith("N") else 1.0)
            yield series_check(signal.quantity, recorded.t[:count], first[:count], second[:count], tolerance)
    if cut:
        return
    yield Check("goal error", float(np.abs(np.subtract(recorded.goal_error, again.goal_error)).max()))
    places = [None if one.loss is None else one.loss.contact for one in (recorded, again)]
    if places[0] != places[1]:
        yield Check("lost contact", math.inf, what=f"recorded {places[0]}, executed again {places[1]}")
    elif recorded.loss is not None and again.loss is not None:
        yield Check("lost contact", abs(recorded.loss.time - again.loss.time))


def series_check(
    quantity: str, t: FloatArray, first: FloatArray, second: FloatArray, tolerance: float = TOLERANCE
) -> Check:
    """Compare two arrays (m, ...), sample by sample at times `t` (m,); NaN equals NaN."""
    apart = np.where(np.isnan(first) & np.isnan(second), 0.0, np.abs(first - second))
    apart = apart.reshape(len(t), -1).max(axis=1, initial=0.0)
    if len(apart) == 0:
        return Check(quantity, 0.0, tolerance)
    worst = int(np.argmax(np.where(np.isnan(apart), np.inf, apart)))
    return Check(quantity, float(apart[worst]), tolerance, float(t[worst]))


def _compare_messages(run: RecordedRun, revision: float, left_out: list[str]) -> list[Check]:
    """Compare the messages with newly generated ones; those of a truncated log up to its end.

    The topics can have any order in the file, because tools that rewrite logs change it. Parts that are not compared
    are added to `left_out`.
    """
    topics = {topic.name: topic for topic in schemas.TOPICS if topic.since <= revision}
    worst = {name: Check(name, 0.0) for name in topics}
    recorded: dict[str, list[Message]] = {name: [] for name in topics}
    others = {channel.topic for channel in run.channels} - {topic.name for topic in schemas.TOPICS}
    for message in run.messages:
        recorded.setdefault(message.topic, []).append(message)
    expected: dict[str, list[tuple[int, bytes]]] = {name: [] for name in topics}
    for time, topic, data in messages(run):
        expected.setdefault(topic.name, []).append((time, data))
    left_out += [f"topic {name} (not of pushplan)" for name in sorted(others)]
    left_out += [f"{name} (not of pushplan)" for name in run.foreign]
    left_out += [f"topic {topic.name} (the log is older)" for topic in schemas.TOPICS if topic.since > revision]
    for name, topic in topics.items():
        found, wanted = recorded[name], expected[name]
        kind, missing = _declared_type(run, topic)
        left_out += [f"field {field} (the log has none)" for field in missing]
        if kind is None:
            worst[f"{name} schema"] = Check(f"{name} schema", math.inf, what="declared differently")
        elif len(found) != len(wanted) and not (run.losses and len(found) < len(wanted)):
            worst[name] = Check(name, math.inf, what=f"{len(found)} messages instead of {len(wanted)}")
        else:
            for number, (message, (then, made)) in enumerate(zip(found, wanted, strict=False)):
                off = max(abs(message.time - then), abs(message.published - then))
                if off:
                    _keep_largest(worst, Check(f"{name} time", 1e-9 * off, 0.0, 1e-9 * then))
                if message.number != number:
                    _keep_largest(worst, Check(f"{name} number", abs(message.number - number), 0.0, 1e-9 * then))
                if message.data != made:
                    for check in _compare_fields(name, kind, message.data, made, 1e-9 * then):
                        _keep_largest(worst, check)
    return list(worst.values())


def _declared_type(run: RecordedRun, topic: schemas.Topic) -> tuple[schemas.MessageClass | None, list[str]]:
    """Return the type of a topic's messages in a log, None if it is unknown, and the fields that it lacks."""
    declared = [channel for channel in run.channels if channel.topic == topic.name]
    ours = Channel(topic.name, "protobuf", topic.kind, "protobuf", topic.schema)
    if not declared or declared == [ours]:
        return topic.message, []
    if len(declared) > 1 or declared[0]._replace(schema=ours.schema) != ours:
        return None, []
    return schemas.older(topic, declared[0].schema)


def _keep_largest(worst: dict[str, Check], check: Check) -> None:
    """Keep the check with the largest difference of each quantity; NaN counts as the largest."""
    before = worst.get(check.quantity)
    if before is None or not (math.isnan(before.difference) or check.difference <= before.difference):
        worst[check.quantity] = check


def _compare_fields(topic: str, kind: schemas.MessageClass, data: bytes, made: bytes, time: float) -> Iterator[Check]:
    try:
        one, other = (kind.FromString(each) for each in (data, made))
    except DecodeError:
        yield Check(topic, math.inf, time=time, what="a message that cannot be decoded")
        return
    other.DiscardUnknownFields()  # the messages of an older log lack them
    if data == other.SerializeToString(deterministic=True):
        return
    first, second = dict(_leaves(one, "")), dict(_leaves(other, ""))
    for name in {**first, **second}:
        a, b = first.get(name), second.get(name)
        numbers = isinstance(a, float | int) and isinstance(b, float | int)
        if numbers and a != b and not (a != a and b != b):
            scale = max(1.0, abs(b))  # type: ignore[arg-type]
            yield Check(f"{topic} {name}", abs(a - b), TOLERANCE * scale, time)  # type: ignore[operator]
        elif not numbers and a != b:
            yield Check(f"{topic} {name}", math.inf, time=time, what=f"{a!r:.60} instead of {b!r:.60}")
    if first == second:
        yield Check(topic, math.inf, time=time, what="other bytes with the same fields")


def _leaves(message: Any, prefix: str) -> Iterator[tuple[str, Any]]:
    """Yield dotted name and value of each field; repeated fields have an index."""
    for field, value in message.ListFields():
        repeated = not isinstance(value, str | bytes | int | float | ProtobufMessage)
        members = list(value) if repeated else [value]
        for k, member in enumerate(members):
            name = f"{prefix}{field.name}" + (f"[{k}]" if repeated else "")
            if isinstance(member, ProtobufMessage):
                yield from _leaves(member, f"{name}.")
            else:
                yield name, member


def _compare_words(run: RecordedRun) -> Iterator[Check]:
    """Compare the metadata of the result with those of the run.

    Numbers can differ by rounding: the margins of a growing log were computed for a few samples at a time.
    """
    said = run.fields.get(metadata.RESULT)
    if said is None:
        return
    for key, value in metadata.result_words(run).items():
        quantity, found = f"{metadata.RESULT} {key}", said.get(key)
        a, b = number_in(found or ""), number_in(value)
        if found == value:
            yield Check(quantity, 0.0)
        elif a is not None and b is not None:
            yield Check(quantity, abs(a - b))
        else:
            yield Check(quantity, math.inf, what=f"{found!r} instead of {value!r}")
