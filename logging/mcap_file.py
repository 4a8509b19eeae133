"""What an MCAP file says, item by item in file order: messages with their topics, attachments, metadata."""

from __future__ import annotations

import contextlib
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from pushplan.errors import RunLogError
from pushplan.logging import opcodes, records
from pushplan.logging.cursor import DamageError
from pushplan.logging.declarations import Declarations
from pushplan.logging.items import Attachment, Item, Metadata
from pushplan.logging.records import Frame
from pushplan.logging.summary import SummaryCheck, repeated_declarations


class McapFile:
    """Reads one file once.

    Attributes:
        path: The file.
        recover: Go on behind damage and list it in `losses`, instead of raising an error.
        size: Of the file, bytes; known once reading has begun.
        losses: What could not be read, in words.
    """

    def __init__(self, path: Path, recover: bool = False) -> None:
        self.path = path
        self.recover = recover
        self.size = 0
        self.losses: list[str] = []
        self._declared = Declarations()
        self._check = SummaryCheck()

    def items(self) -> Iterator[Item]:
        """Yield what the file holds.

        Raises:
            RunLogError: When the file cannot be read, or is damaged and not to be recovered.
        """
        try:
            with open(_regular(self.path), "rb") as stream:
                self.size = os.fstat(stream.fileno()).st_size
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
        budget = records.Budget(self.size)
        try:
            for frame in records.frames(stream, self.size):
                budget.spend(1, 0, frame.offset)
                try:
                    if frame.opcode == opcodes.CHUNK:
                        yield from self._unpack(frame, budget)
                    self._check.note(frame)
                    item = self._item(frame)
                    if item is not None:
                        yield item
                except DamageError as damage:
                    self.lose(damage, f"{opcodes.PREFIX + len(frame.body)} bytes")
        except DamageError as damage:
            self.lose(damage, "everything from there on")

    def lose(self, damage: DamageError, lost: str) -> None:
        """Note that because of `damage` something is `lost`.

        Raises:
            RunLogError: When the file is not to be recovered.
        """
        if not self.recover:
            raise RunLogError(str(self.path), damage.what, damage.offset) from damage
        self.losses.append(f"{lost} at byte {damage.offset}: {damage.what}")
        self._check.counting = False

    def require(self, there: bool, what: str, vital: bool = False) -> None:
        """Note that `what` is missing unless it is `there`.

        Raises:
            RunLogError: When the file is not to be recovered, or cannot be without it.
        """
        if not there and (vital or not self.recover):
            raise RunLogError(str(self.path), f"the file ends without {what}", self.size)
        if not there:
            self.losses.append(what)

    def _unpack(self, chunk: Frame, budget: records.Budget) -> Iterator[Item]:
        """Yield the items of a chunk."""
        for record in records.chunk_frames(chunk, budget):
            self._check.count(record)
            item = self._item(record)
            if item is not None:
                yield item

    def _item(self, frame: Frame) -> Item | None:
        """Return what a record says to others; declarations are kept here, the rest is skipped."""
        match frame.opcode:
            case opcodes.MESSAGE:
                return self._declared.message(frame)
            case opcodes.ATTACHMENT:
                return Attachment(*records.attachment(frame), frame.offset)
            case opcodes.METADATA:
                cursor = frame.cursor
                return Metadata(cursor.text(), cursor.texts(), frame.offset)
            case opcodes.SCHEMA | opcodes.CHANNEL:
                self._declared.add(frame)
        return None


def _regular(path: Path) -> Path:
    """Return `path` if it is a file: reading a pipe or a device might never end."""
    if not stat.S_ISREG(path.stat().st_mode):
        raise RunLogError(str(path), "not a file")
    return path
