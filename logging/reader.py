"""Reads a run log back into the objects that the run had; damaged and hostile files end in one typed error."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from google.protobuf.message import DecodeError

from pushplan.errors import PushplanError, RunLogError
from pushplan.logging import metadata, plan_message, schemas
from pushplan.logging.attached import SCENARIO_FILE, SCENARIO_JSON, scenario_from_attachments
from pushplan.logging.cursor import DamageError
from pushplan.logging.effort import Effort
from pushplan.logging.execution_message import Collector
from pushplan.logging.items import Attachment, Item, Message, Metadata
from pushplan.logging.mcap_file import McapFile
from pushplan.logging.partial_file import SUFFIX
from pushplan.logging.recorded import LogLine, RecordedRun
from pushplan.logging.schemas import MessageClass, Topic
from pushplan.result import PlanResult
from pushplan.scenario import Scenario
from pushplan.sim.execution import Execution

_V = TypeVar("_V")


def read_run(path: Path | str, *, recover: bool | None = None) -> RecordedRun:
    """Read the log of a run.

    Args:
        path: The file.
        recover: Read what is whole of a damaged file and list in `losses` what is not. By default files whose
            name ends in .partial are recovered and others are not.

    Returns:
        The run; every array as it was recorded, bit for bit.

    Raises:
        RunLogError: When the file is damaged (and not to be recovered), no run log, or of a newer format.
    """
    path = Path(path)
    file = McapFile(path, recover=path.name.endswith(SUFFIX) if recover is None else recover)
    reading = _Reading(file)
    for item in file.items():
        reading.take(item)
    return reading.finish()


class _Reading:
    """Turns the items of a file, one after another, into a run."""

    def __init__(self, file: McapFile) -> None:
        self._file = file
        self._words: dict[str, dict[str, str]] = {}
        self._attachments: dict[str, Attachment] = {}
        self._scenario: Scenario | None = None
        self._progress: list[tuple[int, float]] = []
        self._plan: PlanResult | None = None
        self._samples: Collector | None = None
        self._execution: Execution | None = None
        self._lines: list[LogLine] = []
        self._handlers: dict[str, tuple[Topic, Callable[[MessageClass], None]]] = {
            schemas.PROGRESS.name: (schemas.PROGRESS, self._take_progress),
            schemas.PLAN.name: (schemas.PLAN, self._take_plan),
            schemas.EXECUTION.name: (schemas.EXECUTION, self._take_samples),
            schemas.EXECUTION_END.name: (schemas.EXECUTION_END, self._take_end),
            schemas.LOG.name: (schemas.LOG, self._take_line),
        }

    def take(self, item: Item) -> None:
        """Take the next item of the file; other topics are for viewers, other names for other programs."""
        try:
            if isinstance(item, Metadata):
                self._take_metadata(item)
            elif isinstance(item, Attachment):
                _put_once(self._attachments, item.name, item)
            else:
                self._take_message(item)
        except RunLogError:
            raise
        except (DecodeError, ValueError, KeyError, PushplanError) as error:
            what = f"{_name(item)}: {error}"
            self._file.lose(_name(item), DamageError(what, item.offset))

    def _take_metadata(self, item: Metadata) -> None:
        if not item.name.startswith("pushplan."):
            return
        words = metadata.unsealed(item.words)
        if item.name == metadata.RUN:
            self._check_format(words["format"], item.offset)
        _put_once(self._words, item.name, words)

    def _check_format(self, text: str, offset: int) -> None:
        if int(text) > metadata.FORMAT:
            what = (
                f"a run log of format {text}; this version of pushplan reads formats up to {metadata.FORMAT}"
            )
            raise RunLogError(str(self._file.path), what, offset)

    def _take_message(self, item: Message) -> None:
        if item.topic not in self._handlers:
            return
        topic, handle = self._handlers[item.topic]
        expected = topic.message.DESCRIPTOR.full_name
        if item.kind != expected:
            raise ValueError(f"a message of type {item.kind!r} instead of {expected}")
        handle(topic.message.FromString(item.data))

    def _take_progress(self, message: MessageClass) -> None:
        self._progress.append((message.iterations, message.cost))

    def _take_plan(self, message: MessageClass) -> None:
        if self._plan is not None:
            raise ValueError("a second plan")
        effort = Effort.from_words(self._words[metadata.PLANNING])
        self._plan = plan_message.decode(message, effort, self._progress)

    def _take_samples(self, message: MessageClass) -> None:
        if self._samples is None:
            self._samples = Collector(len(self.scenario.chain.contacts))
        self._samples.add(message)

    def _take_end(self, message: MessageClass) -> None:
        samples = self._samples or Collector(len(self.scenario.chain.contacts))
        self._execution = samples.finish(message)

    def _take_line(self, message: MessageClass) -> None:
        if not 1 <= message.level <= len(schemas.LEVELS):
            raise ValueError(f"level {message.level} of a line")
        seconds = message.timestamp.seconds + 1e-9 * message.timestamp.nanos
        self._lines.append(LogLine(seconds, schemas.LEVELS[message.level - 1], message.message))

    @property
    def scenario(self) -> Scenario:
        """The scenario, read from the attachments when it is first needed.

        Raises:
            RunLogError: When they are missing or no scenario.
        """
        for name in (SCENARIO_FILE, SCENARIO_JSON):
            self._require(name in self._attachments, f"the attachment {name!r}")
        if self._scenario is None:
            self._scenario = scenario_from_attachments(self._file.path, self._attachments)
        return self._scenario

    def finish(self) -> RecordedRun:
        """Return the run, once the file has been read.

        Raises:
            RunLogError: When something is missing that a run log has.
        """
        self._require(metadata.RUN in self._words, f"the metadata {metadata.RUN!r} of a run log")
        if not self._file.recover:
            self._require(metadata.RESULT in self._words, f"the metadata {metadata.RESULT!r}")
            self._require(self._samples is None or self._execution is not None, "the end of the execution")
        scenario, execution = self.scenario, self._execution
        if execution is None and self._samples is not None:
            execution = self._samples.finish(None)
        return RecordedRun(
            path=self._file.path,
            scenario=scenario,
            plan=self._plan,
            execution=execution,
            lines=tuple(self._lines),
            words=self._words,
            losses=tuple(self._file.losses),
        )

    def _require(self, there: bool, what: str) -> None:
        if not there:
            raise RunLogError(str(self._file.path), f"the file ends without {what}", self._file.size)


def _put_once(found: dict[str, _V], name: str, value: _V) -> None:
    if name in found:
        raise ValueError(f"{name!r} twice")
    found[name] = value


def _name(item: Item) -> str:
    return f"a message on {item.topic}" if isinstance(item, Message) else repr(item.name)
