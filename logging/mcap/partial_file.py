"""A file that gets its name only when it is whole: written as NAME.partial, renamed at the end.

Every write goes to the operating system at once, so a killed process loses nothing that was written.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from pushplan.errors import RunLogError

SUFFIX = ".partial"


class PartialFile:
    """The unbuffered stream behind NAME.partial; one process at a time may hold it.

    Attributes:
        final: The name that the file gets in the end.
        partial: The name that it has until then; what a killed run left there is overwritten.

    Raises:
        RunLogError: When the file cannot be created, or another process is writing it.
    """

    def __init__(self, final: Path) -> None:
        self.final = final
        self.partial = final.with_name(final.name + SUFFIX)
        self._size = 0
        self._full: OSError | None = None
        with self._reporting("create"):
            self._descriptor = _open_for_writing(final, self.partial)
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

    @contextlib.contextmanager
    def _reporting(self, action: str) -> Iterator[None]:
        """Turn an error of the operating system into a RunLogError."""
        try:
            yield
        except OSError as error:
            busy = isinstance(error, BlockingIOError)
            why = "another process is writing it" if busy else error.strerror
            raise RunLogError(str(self.final), f"cannot {action} the file: {why}") from error

    def write(self, data: bytes | bytearray | memoryview) -> int:
        """Append `data`, all of it or nothing.

        Raises:
            RunLogError: When the operating system takes no more (disk full, ...), and ever after.
        """
        rest = memoryview(data)
        with self._reporting("write"):
            try:
                if self._full is not None:
                    raise self._full
                while rest:
                    rest = rest[os.write(self._descriptor, rest) :]
            except OSError as error:
                self._full = error
                with contextlib.suppress(OSError):
                    os.ftruncate(self._descriptor, self._size)
                raise
        self._size += len(data)
        return len(data)

    def tell(self) -> int:
        """Return the number of bytes written."""
        return self._size

    def flush(self) -> None:
        """Do nothing: every write has reached the operating system."""

    def close(self) -> None:
        """Release the file under the name that it has."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    def discard(self) -> None:
        """Remove the file."""
        with contextlib.suppress(OSError):
            self.partial.unlink()
        self.close()

    def publish(self) -> None:
        """Give the file its final name once its bytes are on the disk, and see that the name is, too.

        Raises:
            RunLogError: When the operating system refuses; the file keeps its partial name.
        """
        with self._reporting("finish"):
            os.fsync(self._descriptor)
            os.replace(self.partial, self.final)
            _sync_directory(self.final.parent)
        self.close()


def write_whole(path: Path, data: bytes) -> None:
    """Write a file of `data` that appears under its name when it is whole.

    Raises:
        RunLogError: When it cannot be written; nothing is left behind.
    """
    write_pieces(path, [data])


def write_pieces(path: Path, pieces: Iterable[bytes]) -> None:
    """Write a file of `pieces` that appears under its name when it is whole.

    Raises:
        RunLogError: When it cannot be written; nothing is left behind.
    """
    file = PartialFile(path)
    try:
        for piece in pieces:
            file.write(piece)
        file.publish()
    except BaseException:
        file.discard()
        raise


def _open_for_writing(final: Path, partial: Path) -> int:
    if not final.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, f"the folder {final.parent} does not exist")
    if final.is_dir():
        raise IsADirectoryError(errno.EISDIR, "a folder has this name")
    return os.open(partial, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)


def _sync_directory(directory: Path) -> None:
    descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
