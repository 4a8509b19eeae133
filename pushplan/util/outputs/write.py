"""Writes outputs: what is named is looked at, and then replaced as a whole, created, or streamed into."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from pushplan.errors import OutputError
from pushplan.util.outputs.open_file import OpenFile
from pushplan.util.outputs.partial_file import PartialFile
from pushplan.util.outputs.stream import Stream
from pushplan.util.outputs.target import look


def open_output(path: Path | str, *, new: bool = False) -> OpenFile:
    """Open an output.

    A file, or nothing as yet: written aside and renamed when it is published. A symbolic link: what it leads to is
    written. A pipe or character device: streamed into. Anything else is refused.

    Args:
        path: Its name.
        new: Refuse a name that there is already, of whatever kind.

    Raises:
        OutputError: When it cannot be written.
    """
    path = Path(path)
    if new and os.path.lexists(path):
        raise OutputError(str(path), "this file exists already; choose another name or remove it")
    target = look(path)
    return Stream(target) if target.streamed else PartialFile(target, new)


def write_whole(path: Path | str, data: bytes, *, new: bool = False) -> None:
    """Write an output of `data` that appears under its name when it is whole.

    Args:
        path: Its name.
        data: What it holds.
        new: See `open_output`.

    Raises:
        OutputError: When it cannot be written; nothing is left behind.
    """
    write_pieces(path, [data], new=new)


def write_pieces(path: Path | str, pieces: Iterable[bytes], *, new: bool = False) -> None:
    """Write an output of `pieces` that appears under its name when it is whole.

    Raises:
        OutputError: When it cannot be written; nothing is left behind.
    """
    file = open_output(path, new=new)
    try:
        for piece in pieces:
            file.write(piece)
        file.publish()
    except BaseException:
        file.discard()
        raise
