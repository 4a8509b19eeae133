"""How old runs are let go: so many are kept, and so much of them."""

from __future__ import annotations

import contextlib
import fcntl
import os
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Self

from pushplan.errors import OutputError
from pushplan.logging.runs.folder import recorded_logs
from pushplan.util.outputs.write import write_whole

COUNT, MEGABYTES = "PUSHPLAN_RUNS_COUNT", "PUSHPLAN_RUNS_MB"
"""Set the limits in the environment."""

_TOLD = ".told"
"""File of the folder that holds the sentence about retention which the user was told last."""


@dataclass(frozen=True)
class Retention:
    """How much is kept.

    Attributes:
        count: Runs, at most.
        megabytes: Of all of them together, at most.
    """

    count: int = 1000
    megabytes: float = 1000.0

    @classmethod
    def from_environment(cls) -> Self:
        """Return what the environment sets.

        Raises:
            OutputError: When that is no number of runs or megabytes.
        """
        return cls(int(_number(COUNT, cls.count, whole=True)), _number(MEGABYTES, cls.megabytes, whole=False))

    def let_go(self, folder: Path, newest: Path) -> str:
        """Remove the oldest runs beyond the limits, never `newest` nor one that is being written.

        Returns:
            What to tell the user, for the first time that anything is removed; else nothing.

        Raises:
            OutputError: When the folder cannot be read or written.
        """
        try:
            removed = self._remove(folder, newest)
        except OSError as error:
            raise OutputError(str(folder), f"cannot let old runs go: {error.strerror}") from error
        sentence = (
            f"old runs are let go: the last {self.count}, up to {self.megabytes:g} MB, are kept in {folder}; "
            f"{COUNT} and {MEGABYTES} set other limits"
        )
        if not removed or _text(folder / _TOLD) == sentence:
            return ""
        write_whole(folder / _TOLD, sentence.encode())
        return sentence

    def _remove(self, folder: Path, newest: Path) -> bool:
        room, size, removed = self.count, 0, False
        for entry in reversed(recorded_logs(folder)):
            size += entry.stat(follow_symlinks=False).st_size
            room -= 1
            if (room < 0 or size > 1e6 * self.megabytes) and not _is_in_use(entry, newest):
                os.unlink(entry.path)
                removed = True
        return removed


def is_being_written(path: str | Path) -> bool:
    """Tell whether a process is writing the log `path`."""
    with contextlib.suppress(FileNotFoundError):
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        finally:
            os.close(descriptor)
    return False


def _is_in_use(entry: os.DirEntry[str], newest: Path) -> bool:
    partial = entry.name.endswith(".partial")
    return entry.name == newest.name or (partial and is_being_written(entry.path))


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return ""


def _number(name: str, default: float, whole: bool) -> float:
    text = os.environ.get(name, "")
    with contextlib.suppress(ValueError):
        value = float(text or default)
        if isfinite(value) and value > 0.0 and not (whole and value % 1.0):
            return value
    raise OutputError(name, f"'{text}' is no limit; it must be a number above 0")
