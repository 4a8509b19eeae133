"""Reads and writes files. An output replaces a file only when it is complete."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import stat
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from pushplan.errors import OutputError


def read_regular(path: Path, most: int) -> bytes:
    """Return at most `most` bytes of a file.

    Raises:
        OSError: If it cannot be read or is not a regular file.
    """
    # Opened without blocking, because open() would wait forever for a named pipe without a writer.
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    with open(descriptor, "rb") as file:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise OSError(errno.EINVAL, "this is not a regular file", str(path))
        return file.read(most)


PARTIAL = ".partial"
"""Suffix of an incomplete file."""

_REFUSED = {
    stat.S_IFDIR: "this is a folder; name a file in it",
    stat.S_IFBLK: "this is a block device; name a file",
    stat.S_IFSOCK: "this is a socket; name a file",
}

_STANDARD_STREAMS = (1, 2)


@dataclass(frozen=True)
class Target:
    """Target of an output.

    Attributes:
        path: Path as named by the user.
        file: File that is written: the target of `path` if that is a symbolic link, else `path`.
        streamed: Whether it is a pipe or a character device, which receives bytes and is never replaced.
    """

    path: Path
    file: Path
    streamed: bool


def check_output(path: Path) -> Target:
    """Return the target of an output called `path`, without writing to it.

    Raises:
        OutputError: If the target cannot be written, or is something that a file must not replace.
    """
    found = _status(path)
    if found is not None and not stat.S_ISREG(found.st_mode):
        if not (stat.S_ISFIFO(found.st_mode) or stat.S_ISCHR(found.st_mode)):
            raise OutputError(str(path), _REFUSED.get(stat.S_IFMT(found.st_mode), "this is not a file; name a file"))
        if not os.access(path, os.W_OK):
            raise OutputError(str(path), "you have no permission to write to this pipe or device")
        return Target(path, path, streamed=True)
    file = Path(os.path.realpath(path)) if path.is_symlink() else path
    now = found if file == path else _status(file)
    if (found is None) != (now is None) or (found and now and not os.path.samestat(found, now)):
        raise OutputError(str(path), "this link points to a deleted file")
    if not file.parent.is_dir():
        raise OutputError(str(path), f"there is no folder {file.parent}")
    if not os.access(file.parent, os.W_OK):
        raise OutputError(str(path), f"you have no permission to write in the folder {file.parent}")
    if found is not None:
        _require_replaceable(path, found)
    return Target(path, file, streamed=False)


def _require_replaceable(path: Path, found: os.stat_result) -> None:
    """Raise an error if a file is write-protected or receives the command's own output."""
    if not os.access(path, os.W_OK):
        raise OutputError(str(path), "this file is write-protected")
    for descriptor in _STANDARD_STREAMS:
        with contextlib.suppress(OSError):
            if os.path.samestat(found, os.fstat(descriptor)):
                raise OutputError(str(path), "the command's own output goes to this file; name another one")


def _status(path: Path) -> os.stat_result | None:
    """Return the status of the target behind all links; None if there is none."""
    try:
        return path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (OSError, ValueError) as error:
        raise OutputError(str(path), getattr(error, "strerror", None) or str(error)) from error


class Output:
    """An unbuffered output; its errors contain its name.

    Args:
        path: Path of the output.
        new: Whether an existing file, or anything else of this name, is an error.

    Attributes:
        path: Path as named by the user.
        partial: Path of the incomplete file until `publish`.

    Raises:
        OutputError: If it cannot be written, the pipe has no reader, or another process is writing the file.
    """

    def __init__(self, path: Path | str, *, new: bool = False) -> None:
        self.path, self._new = Path(path), new
        if new and os.path.lexists(self.path):
            raise OutputError(str(path), "this file exists already; choose another name or remove it")
        self._target = check_output(self.path)
        file, between = self._target.file, f".new{PARTIAL}" if new else PARTIAL
        self.partial = self.path if self._target.streamed else file.with_name(file.name + between)
        self._descriptor, self._size = -1, 0
        self._full: OSError | None = None
        if self._target.streamed:
            self._open_stream()
        else:
            self._open_file()

    def _open_stream(self) -> None:
        with self._reporting("open"):
            try:  # without O_NONBLOCK this would wait for a reader
                self._descriptor = os.open(self.path, os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)
            except OSError as error:
                if error.errno == errno.ENXIO:
                    what = "this pipe has no reader; start the reader first, or name a file"
                    raise OutputError(str(self.path), what) from error
                raise
        if os.isatty(self._descriptor):
            self.close()
            raise OutputError(str(self.path), "this is a terminal; name a file or a pipe")
        os.set_blocking(self._descriptor, True)

    def _open_file(self) -> None:
        """Open, lock and empty the partial file; fail if another process is writing or has just published it."""
        how = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
        try:
            with self._reporting("create"):
                self._descriptor = os.open(self.partial, how, 0o666)
                if not stat.S_ISREG(os.fstat(self._descriptor).st_mode):
                    what = f"{self.partial} exists and is not a file, but the incomplete output needs this name"
                    raise FileExistsError(errno.EEXIST, what)
                fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if not os.path.samestat(os.fstat(self._descriptor), os.stat(self.partial)):
                    raise BlockingIOError
                os.ftruncate(self._descriptor, 0)
        except BaseException:
            self.close()
            raise

    @contextlib.contextmanager
    def _reporting(self, action: str) -> Iterator[None]:
        """Convert an error of the operating system to an OutputError."""
        try:
            yield
        except OSError as error:
            busy = isinstance(error, BlockingIOError)
            why = "another process is writing it" if busy else error.strerror
            raise OutputError(str(self.path), f"cannot {action} the file: {why}") from error

    def write(self, data: bytes | bytearray | memoryview) -> int:
        """Append `data`; after a failed write, every further write fails.

        Raises:
            OutputError: If the operating system cannot write, for example because the disk is full.
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
                if not self._target.streamed:
                    with contextlib.suppress(OSError):
                        os.ftruncate(self._descriptor, self._size)
                raise
        self._size += len(data)
        return len(data)

    def tell(self) -> int:
        """Return the number of bytes written."""
        return self._size

    def flush(self) -> None:
        """Do nothing, because there is no buffer."""

    def close(self) -> None:
        """Close the file and keep its current name."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    def discard(self) -> None:
        """Close the file and remove it; a stream ends early."""
        if not self._target.streamed:
            with contextlib.suppress(OSError):
                self.partial.unlink()
        self.close()

    def publish(self) -> None:
        """Finish the complete file: when this returns, its bytes and final name are on the disk.

        Raises:
            OutputError: If the operating system cannot finish it, or its name now belongs to something that is not a
                file. The output keeps its partial name.
        """
        if not self._target.streamed:
            self._rename(self._target.file)
        self.close()

    def _rename(self, final: Path) -> None:
        with self._reporting("finish"):
            os.fsync(self._descriptor)
            if self._new:
                os.link(self.partial, final)  # unlike os.replace, this never replaces a file
                self.partial.unlink()
            else:
                with contextlib.suppress(FileNotFoundError):
                    if not stat.S_ISREG(os.lstat(final).st_mode):
                        raise OutputError(str(self.path), "this name now belongs to something that is not a file")
                os.replace(self.partial, final)
            folder = os.open(final.parent, os.O_RDONLY | os.O_DIRECTORY)
            try:
                os.fsync(folder)
            finally:
                os.close(folder)


def write_whole(path: Path | str, data: bytes, *, new: bool = False) -> None:
    """Write `data` to an output that appears under its name when it is complete.

    Args:
        path: Path of the output.
        data: Content of the output.
        new: See `Output`.

    Raises:
        OutputError: If it cannot be written; the incomplete file is removed.
    """
    write_pieces(path, [data], new=new)


def write_pieces(path: Path | str, pieces: Iterable[bytes], *, new: bool = False) -> None:
    """Write `pieces` to an output that appears under its name when it is complete.

    Raises:
        OutputError: If it cannot be written; the incomplete file is removed.
    """
    file = Output(path, new=new)
    try:
        for piece in pieces:
            file.write(piece)
        file.publish()
    except BaseException:
        file.discard()
        raise


def is_being_written(path: str | Path) -> bool:
    """Return whether a process is writing the partial file `path`."""
    with contextlib.suppress(FileNotFoundError):
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        finally:
            os.close(descriptor)
    return False
