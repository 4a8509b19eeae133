"""What an MCAP file says, item by item in file order: messages with their topics, attachments, metadata."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from pushplan.errors import RunLogError
from pushplan.logging import records
from pushplan.logging.cursor import DamageError
from pushplan.logging.declarations import Declarations
from pushplan.logging.items import Attachment, Item, Metadata
from pushplan.logging.records import Frame
from pushplan.logging.summary import SummaryCheck, intact_summary


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
        for frame in intact_summary(stream, self.size):
            if frame.opcode in Declarations.OPCODES:
                self._declared.add(frame)

    def _walk(self, stream: BinaryIO) -> Iterator[Item]:
        budget = records.Budget(self.size)
        try:
            for frame in records.frames(stream, self.size):
                try:
                    budget.spend(1, 0, frame.offset)
                    yield from self._unpack(frame, budget)
                except DamageError as damage:
                    self.lose(f"{records.PREFIX + len(frame.body)} bytes", damage)
        except DamageError as damage:
            self.lose("everything from there on", damage)

    def lose(self, lost: str, damage: DamageError) -> None:
        """Note that `lost` cannot be read.

        Raises:
            RunLogError: When the file is not to be recovered.
        """
        if not self.recover:
            raise RunLogError(str(self.path), damage.what, damage.offset) from damage
        self.losses.append(f"{lost} at byte {damage.offset}: {damage.what}")

    def _unpack(self, frame: Frame, budget: records.Budget) -> Iterator[Item]:
        """Yield the items of one record of the file."""
        chunk = frame.opcode == records.CHUNK
        inner = records.chunk_frames(frame, budget) if chunk else []
        for record in (frame, *inner):
            if not (self.recover and record.opcode == records.STATISTICS):
                self._check.note(record)
            yield from self._item(record)

    def _item(self, frame: Frame) -> Iterator[Item]:
        if frame.opcode == records.MESSAGE:
            yield self._declared.message(frame)
        elif frame.opcode == records.ATTACHMENT:
            name, content = records.attachment(frame)
            yield Attachment(name, content, frame.offset)
        elif frame.opcode == records.METADATA:
            cursor = frame.cursor
            yield Metadata(cursor.text(), cursor.texts(), frame.offset)
        elif frame.opcode in Declarations.OPCODES:
            self._declared.add(frame)


def _regular(path: Path) -> Path:
    """Return `path` if it is a file: reading a pipe or a device might never end."""
    if not stat.S_ISREG(path.stat().st_mode):
        raise RunLogError(str(path), "not a file")
    return path
