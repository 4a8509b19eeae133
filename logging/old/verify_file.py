"""The messages and words of a log against those that its scenario and its plan lead to.

The run is written once more, from what `plan_again` and its execution give; both logs are compared topic by topic,
field by field: one that is added to a message is compared without anything being said here.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path

import numpy as np

from pushplan.logging.mcap_file import McapFile, Message, Metadata
from pushplan.logging.old.check import TOLERANCE, Check
from pushplan.logging.old.messages import metadata, schemas
from pushplan.logging.old.messages.fields import Value, flattened
from pushplan.logging.old.messages.recorded import RecordedRun
from pushplan.logging.old.messages.schemas import Topic
from pushplan.logging.old.plan_again import plan_again
from pushplan.logging.old.reader import read_run, read_runs
from pushplan.logging.old.several_again import execute_again
from pushplan.logging.old.writer import RunLogWriter
from pushplan.util.names import COSTS

FREE_WORDS = ("crc32", "finished_at", "outcome", "error")
"""Words of `pushplan.result` that nothing else determines, beside those of wall-clock times; `outcome` is judged."""

_NOT_IN_OLD_LOGS = (schemas.SCENE, schemas.CONTACTS, schemas.PLAN_NEAREST, schemas.COSTS)


def verify_file(path: Path, number: int = 0) -> list[Check]:
    """Compare every topic and word of a log that follows from its scenario and plan.

    Args:
        path: Of the log.
        number: Of the run in it, from 0.

    Raises:
        PushplanError: When the log cannot be read, or its plan cannot be executed at all.
    """
    run = read_runs(path, recover=True)[number]
    if run.plan is None or run.plan.trajectory is None:
        return []
    whole = not run.losses and metadata.RECOVERY not in run.words
    with tempfile.TemporaryDirectory() as folder:
        again = Path(folder) / "again.mcap"
        write_again(run, again)
        checks = [
            check for topic in _comparable(run) for check in compare_topic(topic, path, again, whole, number)
        ]
        return [*checks, *_words(run, read_run(again))] if whole else checks


def _comparable(run: RecordedRun) -> list[Topic]:
    """Return the topics to compare: logs from before contacts were drawn lack some, and show bodies differently."""
    drawn = any(_messages(schemas.CONTACTS, run.path, run.number))
    return [topic for topic in schemas.TOPICS if drawn or topic not in _NOT_IN_OLD_LOGS]


def write_again(run: RecordedRun, path: Path) -> None:
    """Write the log that a run's scenario and plan lead to."""
    plan = plan_again(run)
    execution = execute_again(run.scenario, plan)
    if execution is not None and run.execution is not None and run.execution.dynamic_margins is None:
        execution = replace(execution, dynamic_margins=None)  # a log of an older version
    words = run.words.get(metadata.RUN)
    with RunLogWriter.create(path, run.scenario, {}, words, began=run.began) as log:
        log.plan(plan)
        if execution is not None and run.execution is not None:
            log.execution(execution)
        log.finish("solved" if plan.solved else "unsolved")


def compare_topic(topic: Topic, recorded: Path, again: Path, whole: bool, number: int = 0) -> Iterator[Check]:
    """Compare the messages of the `number`-th run on a topic; of a log that lost some, those that are there."""
    if not whole and topic in (schemas.EXECUTION, schemas.EXECUTION_END):
        return
    worst: dict[str, Check] = {topic.name: Check(topic.name, 0.0)}
    for first, second in _pairs(topic, recorded, again, whole, number):
        if first is None or second is None:
            side = "missing in the log" if first is None else "not to be in the log"
            worst[topic.name] = Check(topic.name, math.inf, what=f"a message is {side}")
            break
        if first.time != second.time:
            _raise(
                worst,
                Check(f"{topic.name} time", 1e-9 * abs(first.time - second.time), time=1e-9 * second.time),
            )
        if first.data != second.data:
            for check in _message(topic, first, second):
                _raise(worst, check)
    yield from worst.values()


def _raise(worst: dict[str, Check], check: Check) -> None:
    """Keep the largest difference of each quantity; one that is no number counts as the largest."""
    before = worst.get(check.quantity)
    if before is None or not check.difference <= before.difference:
        worst[check.quantity] = check


def _pairs(
    topic: Topic, recorded: Path, again: Path, whole: bool, number: int
) -> Iterator[tuple[Message | None, Message | None]]:
    first, second = _messages(topic, recorded, number), _messages(topic, again)
    if topic is schemas.LOG:  # others may have written lines of their own
        texts = {_text(topic, message): message for message in first}
        yield from ((texts.get(_text(topic, message)), message) for message in second if whole)
    elif whole:
        yield from zip_longest(first, second)
    else:
        known: dict[int, list[Message]] = {}
        for message in second:
            known.setdefault(message.time, []).append(message)
        for message in first:
            same_time = known.get(message.time, [])
            same = [other for other in same_time if other.data == message.data]
            yield from ((message, other) for other in (same or same_time)[:1])


def _text(topic: Topic, message: Message) -> str:
    return str(topic.message.FromString(bytes(message.data)).message)


def _messages(topic: Topic, path: Path, number: int = 0) -> Iterator[Message]:
    """Yield the messages on a topic of the `number`-th run of a log: each begins with its metadata."""
    begun = -1
    for item in McapFile(path, recover=True, topics=(topic.name,)).items():
        begun += isinstance(item, Metadata) and item.name == metadata.RUN
        if isinstance(item, Message) and item.topic == topic.name and max(begun, 0) == number:
            yield item


def _message(topic: Topic, first: Message, second: Message) -> Iterator[Check]:
    fields, expected = (flattened(topic.message.FromString(bytes(one.data))) for one in (first, second))
    for name in {**fields, **expected}:
        nothing: Value = np.zeros(0) if isinstance({**fields, **expected}[name], np.ndarray) else ()
        difference, tolerance, what = _difference(fields.get(name, nothing), expected.get(name, nothing))
        yield Check(f"{topic.name} {name}", difference, tolerance, 1e-9 * second.time, what)


def _difference(first: Value, second: Value) -> tuple[float, float, str]:
    """Return how far two values are apart, what would pass, and the difference in words if it is no number."""
    if len(first) != len(second):
        return math.inf, 0.0, f"{len(first)} values instead of {len(second)}"
    if isinstance(first, np.ndarray) and isinstance(second, np.ndarray):
        with np.errstate(invalid="ignore"):
            apart = np.where(first == second, 0.0, np.abs(first - second))
        scale = max(1.0, float(np.abs(second).max(initial=0.0)))
        return float(apart.max(initial=0.0)), TOLERANCE * scale, ""
    if first == second:
        return 0.0, 0.0, ""
    found, expected = next((a, b) for a, b in zip(first, second, strict=True) if a != b)
    return math.inf, 0.0, f"{found!r} instead of {expected!r}"


def _words(run: RecordedRun, again: RecordedRun) -> Iterator[Check]:
    """Compare the metadata, and what they say of the scenario."""
    assert run.plan is not None
    said = run.words[metadata.RUN]
    fresh = metadata.run_words(run.scenario, {})
    for key in ("format", "scenario", "scenario_sha256"):
        yield _word(f"{metadata.RUN} {key}", said.get(key), fresh[key])
    settings = {"planner": run.plan.planner, "set": run.plan.stable_set, "seed": str(run.plan.seed)}
    for key, expected in settings.items():
        if key in said:
            yield _word(f"{metadata.RUN} {key}", said[key], expected)
    if "cost" in said:
        what = "" if said["cost"] in COSTS else f"{said['cost']!r} is none of {', '.join(COSTS)}"
        yield Check(f"{metadata.RUN} cost", math.inf if what else 0.0, what=what)
    result, made = run.words[metadata.RESULT], again.words[metadata.RESULT]
    planning = run.words[metadata.PLANNING]
    for key in {**result, **made}:
        if key in FREE_WORDS or (key.endswith("_s") and key not in planning):
            continue
        yield _word(f"{metadata.RESULT} {key}", result.get(key), made.get(key))
    if run.outcome not in ("failed", "interrupted", "unfinished"):
        yield _word(f"{metadata.RESULT} outcome", run.outcome, again.outcome)


def _word(quantity: str, said: str | None, expected: str | None) -> Check:
    try:
        first, second = float(said or ""), float(expected or "")
    except ValueError:
        same = said == expected
        return Check(
            quantity, 0.0 if same else math.inf, what="" if same else f"{said!r} instead of {expected!r}"
        )
    return Check(quantity, 0.0 if first == second else abs(first - second), TOLERANCE * max(1.0, abs(second)))
