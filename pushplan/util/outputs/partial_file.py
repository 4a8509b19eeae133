"""A file that gets its name only when it is whole: written as NAME.partial, renamed at the end.

Every write goes to the operating system at once, so a killed process loses nothing that was written.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import stat
from pathlib import Path

from pushplan.errors import OutputError
from pushplan.util.outputs.open_file import OpenFile
from pushplan.util.outputs.target import Target

SUFFIX = ".partial"


class PartialFile(OpenFile):
    """The file behind NAME.partial; one process at a time may hold it.

    What a killed run left under that name is overwritten.

    Args:
        target: What to write, no stream.
        new: Never replace a file of that name; then what is not whole yet is called NAME.new.partial.

    Attributes:
        final: The name that the file gets in the end.

    Raises:
        OutputError: When the file cannot be created, or another process is writing it.
    """

    def __init__(self, target: Target, new: bool = False) -> None:
        self.final = target.file
        self._new = new
        between = f".new{SUFFIX}" if new else SUFFIX
        super().__init__(target.path, self.final.with_name(self.final.name + between))
        with self._reporting("create"):
            self._descriptor = _open_for_writing(self.partial)
        try:
            self._claim()
        except BaseException:
            self.close()
            raise

    def _claim(self) -> None:
        """Lock the file and empty it, unless its writer holds it or has just given it the final name."""
        with self._reporting("create"):
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if not os.path.samestat(os.fstat(self._descriptor), os.stat(self.partial)):
                raise BlockingIOError
            os.ftruncate(self._descriptor, 0)

    def _give_back(self, size: int) -> None:
        with contextlib.suppress(OSError):
            os.ftruncate(self._descriptor, size)

    def discard(self) -> None:
        """Remove the file."""
        with contextlib.suppress(OSError):
            self.partial.unlink()
        self.close()

    def publish(self) -> None:
        """Give the file its final name once its bytes are on the disk, and see that the name is, too.

        Raises:
            OutputError: When the operating system refuses, or meanwhile the name is another thing's; the file
                keeps its partial name.
        """
        with self._reporting("finish"):
            os.fsync(self._descriptor)
            if self._new:
                os.link(self.partial, self.final)  # unlike a renaming, this never replaces a file
                self.partial.unlink()
            else:
                _require_no_other(self.path, self.final)
                os.replace(self.partial, self.final)
            _sync_directory(self.final.parent)
        self.close()


def _open_for_writing(partial: Path) -> int:
    how = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    descriptor = os.open(partial, how, 0o666)
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise FileExistsError(errno.EEXIST, f"{partial} is no file, and until it is whole it needs that name")
    return descriptor


def _require_no_other(path: Path, final: Path) -> None:
    """Refuse to replace what is no file: it has come while this one was written."""
    with contextlib.suppress(FileNotFoundError):
        if not stat.S_ISREG(os.lstat(final).st_mode):
            raise OutputError(str(path), "what has this name by now is no file")


def _sync_directory(directory: Path) -> None:
    descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
