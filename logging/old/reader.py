"""Reads a run log back into the objects that the run had; damaged and hostile files end in one typed error."""

from __future__ import annotations

from dataclasses import replace
from itertools import count
from pathlib import Path

from google.protobuf.message import DecodeError

from pushplan.errors import PushplanError, RunLogError
from pushplan.logging.mcap_file import Attachment, DamageError, Item, McapFile, Message, Metadata
from pushplan.logging.old.messages import metadata
from pushplan.logging.old.messages.contents import TOPICS, Contents
from pushplan.logging.old.messages.effort import Effort
from pushplan.logging.old.messages.recorded import RecordedRun
from pushplan.logging.old.messages.scenario_files import ScenarioFiles
from pushplan.logging.old.messages.seal import unsealed
from pushplan.plans.result import ProgressPoint
from pushplan.util.files import PARTIAL

_OURS = "pushplan."

_RUN = 256 << 10
"""Memory, in bytes, charged for each run of a log: beginning and ending one takes milliseconds, which this bounds."""


def read_run(path: Path | str, *, recover: bool | None = None) -> RecordedRun:
    """Read the log of a run.

    Args:
        path: The file, with one run in it.
        recover: Read what is whole of a damaged file and list in `losses` what is not. By default files whose
            name ends in .partial are recovered and others are not.

    Returns:
        The run; every array as it was recorded, bit for bit.

    Raises:
        RunLogError: When the file is damaged (and not to be recovered), no run log, or of a newer format; or holds
            several runs.
    """
    found = read_runs(path, recover=recover)
    if len(found) > 1:
        what = (
            f"a log of {len(found)} errands; pushplan replay and read_runs take those, this takes one problem"
        )
        raise RunLogError(str(path), what)
    return found[0]


def read_runs(path: Path | str, *, recover: bool | None = None) -> tuple[RecordedRun, ...]:
    """Read a log of one run, or of several that follow one another, as the errands with several objects do.

    Args:
        path: The file.
        recover: See `read_run`.

    Raises:
        RunLogError: As `read_run`.
    """
    path = Path(path)
    damaged = path.name.endswith(PARTIAL) if recover is None else recover
    file = McapFile(path, recover=damaged, topics={topic.name for topic in TOPICS})
    readings = [_Reading(file, 0)]
    for item in file.items():
        if isinstance(item, Metadata) and item.name == metadata.RUN and readings[-1].begun:
            try:
                file.keep(_RUN, item.offset)
            except DamageError as damage:
                file.lose(damage)
                break
            readings.append(_Reading(file, len(readings)))
        readings[-1].take(item)
    return tuple(reading.finish() for reading in readings)


class _Reading:
    """Turns the items of a file, one after another, into a run."""

    def __init__(self, file: McapFile, number: int) -> None:
        self._file = file
        self._number = number
        self._began = 0
        self._words: dict[str, dict[str, str]] = {}
        self._scenario = ScenarioFiles(file)
        self._contents = Contents(lambda: len(self._scenario.read().chain.contacts), file.recover)

    @property
    def begun(self) -> bool:
        """Whether its first item has come."""
        return metadata.RUN in self._words

    def take(self, item: Item) -> None:
        """Take the next item of the file."""
        try:
            match item:
                case Message():
                    self._take_message(item)
                case Attachment():
                    self._scenario.take(item)
                case Metadata():
                    self._take_metadata(item)
        except RunLogError:
            raise
        except DamageError as damage:
            self._file.lose(damage)
        except (DecodeError, KeyError, ValueError, PushplanError) as error:
            what = f"no {error}" if isinstance(error, KeyError) else str(error)
            self._file.lose(DamageError(f"{_name(item)}: {what}", item.offset))

    def _take_message(self, item: Message) -> None:
        self._file.keep(self._contents.memory(item), item.offset)
        if self._number and not self._began:
            self._began = self._contents.began = item.time
        self._contents.take(item)

    def _take_metadata(self, item: Metadata) -> None:
        if not item.name.startswith(_OURS):
            return
        words = unsealed(item.words)
        if item.name in self._words:
            raise ValueError("a name that was there already")
        if item.name == metadata.RUN:
            self._check_format(words["format"], item.offset)
        if item.name.startswith(metadata.PROGRESS):
            float(words["found_s"])
        if item.name == metadata.PLANNING:
            self._contents.effort = Effort.from_words(words)
        self._words[item.name] = words

    def _check_format(self, text: str, offset: int) -> None:
        known = metadata.FORMAT
        if int(text) > known:
            what = f"a run log of format {text}; this version of pushplan reads formats up to {known}"
            raise RunLogError(str(self._file.path), what, offset)

    def finish(self) -> RecordedRun:
        """Return the run, once the file has been read.

        Raises:
            RunLogError: When something is missing that a run log has.
        """
        self._file.require(metadata.RUN in self._words, f"the metadata {metadata.RUN!r} of a run log")
        scenario = self._scenario.read()
        self._scenario.check(self._words.get(metadata.RUN, {}))
        self._file.require(metadata.RESULT in self._words, f"the metadata {metadata.RESULT!r}")
        self._file.require(not self._contents.cut, "the end of the execution")
        for first, behind in self._contents.gaps:
            self._file.require(False, f"samples {first} to {behind - 1} of the execution")
        plan, execution = self._contents.plan, self._contents.execution()
        return RecordedRun(
            path=self._file.path,
            scenario=scenario,
            plan=None if plan is None else replace(plan, execution=execution),
            execution=execution,
            lines=tuple(self._contents.lines),
            words=self._words,
            losses=tuple(self._file.losses),
            progress=self._progress(),
            feedback=self._contents.feedback.feedback,
            number=self._number,
            began=self._began,
        )

    def _progress(self) -> tuple[ProgressPoint, ...]:
        """Return the improvements with the times of the plan or, of a run that was cut off, of their metadata."""
        if self._contents.plan is not None:
            return self._contents.plan.progress
        words = (self._words.get(f"{metadata.PROGRESS}.{k:04d}", {}) for k in count())
        seconds = (float(found.get("found_s", "nan")) for found in words)
        return tuple(
            replace(point, seconds=at) for point, at in zip(self._contents.progress, seconds, strict=False)
        )


def _name(item: Item) -> str:
    return f"a message on {item.topic}" if isinstance(item, Message) else repr(item.name)
