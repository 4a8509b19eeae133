"""What an MCAP file says, item by item in file order: messages with their topics, attachments, metadata."""

from __future__ import annotations

import contextlib
import os
import stat
from collections.abc import Collection, Generator, Iterator
from pathlib import Path
from typing import BinaryIO

from pushplan.errors import RunLogError
from pushplan.logging.mcap import opcodes, records
from pushplan.logging.mcap.budget import WORDS_MEMORY, Budget, ExhaustedError
from pushplan.logging.mcap.cursor import DamageError
from pushplan.logging.mcap.declarations import Declarations
from pushplan.logging.mcap.items import Attachment, Item, Metadata
from pushplan.logging.mcap.records import Frame
from pushplan.logging.mcap.resync import next_sound
from pushplan.logging.mcap.summary_check import SummaryCheck, repeated_declarations

MOST_LOSSES = 1000
"""Damaged places behind which a file is read on."""


class McapFile:
    """Reads one file once.

    Attributes:
        path: The file.
        recover: Go on behind damage and list it in `losses`, instead of raising an error.
        size: Of the file, bytes; known once reading has begun.
        budget: What may be read and kept; likewise.
        losses: What could not be read, in words.
    """

    def __init__(self, path: Path, recover: bool = False, topics: Collection[str] | None = None) -> None:
        """Prepare to read.

        Args:
            path: The file.
            recover: See above.
            topics: The topics whose messages are wanted; None for all.
        """
        self.path = path
        self.recover = recover
        self.size = 0
        self.budget = Budget(0)
        self.losses: list[str] = []
        self._declared = Declarations(topics)
        self._check = SummaryCheck()
        self._hopeless = False

    def items(self) -> Iterator[Item]:
        """Yield what the file holds.

        Raises:
            RunLogError: When the file cannot be read, or is damaged and not to be recovered.
        """
        try:
            with open(_regular(self.path), "rb") as stream:
                self.size = os.fstat(stream.fileno()).st_size
                self.budget = Budget(self.size)
                if self.recover:
                    self._preload(stream)
                yield from self._walk(stream)
        except OSError as error:
            raise RunLogError(str(self.path), f"cannot read the log: {error.strerror}") from error

    def _preload(self, stream: BinaryIO) -> None:
        with contextlib.suppress(DamageError):
            for frame in repeated_declarations(stream, self.size):
                self._item(frame)

    def _walk(self, stream: BinaryIO) -> Iterator[Item]:
        """Yield the items of the file; in one to be recovered, begin again behind every stretch without records."""
        begin: int | None = 0
        while begin is not None:
            begin = yield from self._stretch(stream, begin)

    def _stretch(self, stream: BinaryIO, begin: int) -> Generator[Item, None, int | None]:
        """Yield items up to the end or the next damage of the frames; return where to go on, if anywhere."""
        try:
            for frame in records.frames(stream, self.size, begin):
                self.budget.outer_record(frame.offset)
                try:
                    yield from self._items(frame)
                    self._check.note(frame)
                except DamageError as damage:
                    self.lose(damage, f"{opcodes.PREFIX + len(frame.body)} bytes")
                if self._hopeless:
                    return None
            return None
        except DamageError as damage:
            behind = self._resume(stream, damage)
            self.lose(
                damage, "everything from there on" if behind is None else f"{behind - damage.offset} bytes"
            )
            return behind

    def _resume(self, stream: BinaryIO, damage: DamageError) -> int | None:
        """Return where records go on behind the damage of a file to be recovered."""
        if not self.recover or isinstance(damage, ExhaustedError) or self._hopeless:
            return None
        return next_sound(stream, max(damage.offset, len(opcodes.MAGIC)), self.size)

    def lose(self, damage: DamageError, lost: str) -> None:
        """Note that because of `damage` something is `lost`.

        Raises:
            RunLogError: When the file is not to be recovered.
        """
        if not self.recover:
            raise RunLogError(str(self.path), damage.what, damage.offset) from damage
        self._check.counting = False
        if self._hopeless:
            return
        self._hopeless = isinstance(damage, ExhaustedError) or len(self.losses) >= MOST_LOSSES
        rest = ", and everything from there on" if self._hopeless else ""
        self.losses.append(f"{lost}{rest} at byte {damage.offset}: {damage.what}")

    def require(self, there: bool, what: str, vital: bool = False) -> None:
        """Note that `what` is missing unless it is `there`.

        Raises:
            RunLogError: When the file is not to be recovered, or cannot be without it.
        """
        if not there and (vital or not self.recover):
            raise RunLogError(str(self.path), f"the file ends without {what}", self.size)
        if not there:
            self.losses.append(what)

    def _items(self, frame: Frame) -> Iterator[Item]:
        """Yield what a record says to others, or those in a chunk."""
        if frame.opcode == opcodes.CHUNK:
            yield from self._unpack(frame)
        else:
            item = self._item(frame)
            if item is not None:
                yield item

    def _unpack(self, chunk: Frame) -> Iterator[Item]:
        """Yield the items of a chunk."""
        data, unwanted = records.inflated(chunk, self.budget), self._declared.unwanted
        before = unwanted.passed
        for record in records.chunk_frames(data, chunk.offset, self.budget, unwanted):
            if self._hopeless:
                return
            self._check.count(record.opcode)
            item = self._item(record)
            if item is not None:
                yield item
        self._check.count(opcodes.MESSAGE, unwanted.passed - before)

    def _item(self, frame: Frame) -> Item | None:
        """Return what a record says to others; declarations are kept here, the rest is skipped."""
        match frame.opcode:
            case opcodes.MESSAGE:
                return self._declared.message(frame)
            case opcodes.ATTACHMENT:
                return Attachment(*records.attachment(frame), frame.offset)
            case opcodes.METADATA:
                self.budget.keep(WORDS_MEMORY * len(frame.body), frame.offset)
                cursor = frame.cursor
                return Metadata(cursor.text(), cursor.texts(), frame.offset)
            case opcodes.SCHEMA | opcodes.CHANNEL:
                self._declared.add(frame, self.budget)
        return None


def _regular(path: Path) -> Path:
    """Return `path` if it is a file: reading a pipe or a device might never end."""
    if not stat.S_ISREG(path.stat().st_mode):
        raise RunLogError(str(path), "not a file")
    return path
