"""Files: what may be read and written, and how output replaces a file only when it is whole."""

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
        OSError: If it cannot be read or is no regular file.
    """
    # Opened without blocking: a named pipe that nobody writes to would hold the process in open().
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    with open(descriptor, "rb") as file:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise OSError(errno.EINVAL, "this is no regular file", str(path))
        return file.read(most)


PARTIAL = ".partial"
"""Suffix of a file that is not whole yet."""

_REFUSED = {
    stat.S_IFDIR: "this is a folder; name a file in it",
    stat.S_IFBLK: "this is a block device; name a file",
    stat.S_IFSOCK: "this is a socket; name a file",
}

_STANDARD_STREAMS = (1, 2)


@dataclass(frozen=True)
class Target:
    """Where an output goes.

    Attributes:
        path: As it was named.
        file: What is written: where `path` is a symbolic link to a file, or to none yet, what it leads to.
        streamed: It is a pipe or a character device, which takes bytes and is never replaced.
    """

    path: Path
    file: Path
    streamed: bool


def check_output(path: Path) -> Target:
    """Return where an output called `path` goes; nothing is written.

    Raises:
        OutputError: If nothing can be written there, or writing would destroy what is no file.
    """
    found = _status(path)
    if found is not None and not stat.S_ISREG(found.st_mode):
        if not (stat.S_ISFIFO(found.st_mode) or stat.S_ISCHR(found.st_mode)):
            raise OutputError(str(path), _REFUSED.get(stat.S_IFMT(found.st_mode), "this is no file; name one"))
        if not os.access(path, os.W_OK):
            raise OutputError(str(path), "this pipe or device may not be written")
        return Target(path, path, streamed=True)
    file = Path(os.path.realpath(path)) if path.is_symlink() else path
    now = found if file == path else _status(file)
    if (found is None) != (now is None) or (found and now and not os.path.samestat(found, now)):
        raise OutputError(str(path), "this link leads to a file that has no name any more")
    if not file.parent.is_dir():
        raise OutputError(str(path), f"there is no folder {file.parent}")
    if not os.access(file.parent, os.W_OK):
        raise OutputError(str(path), f"nothing may be written in the folder {file.parent}")
    if found is not None:
        _require_replaceable(path, found)
    return Target(path, file, streamed=False)


def _require_replaceable(path: Path, found: os.stat_result) -> None:
    """Refuse a file that is write-protected, or into which the program's own words go."""
    if not os.access(path, os.W_OK):
        raise OutputError(str(path), "this file is write-protected")
    for descriptor in _STANDARD_STREAMS:
        with contextlib.suppress(OSError):
            if os.path.samestat(found, os.fstat(descriptor)):
                raise OutputError(str(path), "what the command says goes into this file; name another one")


def _status(path: Path) -> os.stat_result | None:
    """Return what is there, behind all links; None when nothing is."""
    try:
        return path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (OSError, ValueError) as error:
        raise OutputError(str(path), getattr(error, "strerror", None) or str(error)) from error


class Output:
    """An output being written, unbuffered; errors name it.

    Args:
        path: Its name.
        new: Refuse a name that there is already, of whatever kind.

    Attributes:
        path: As the user named it.
        partial: The name under which it can be found until `publish`.

    Raises:
        OutputError: If it cannot be written, nobody reads the pipe, or another process is writing the file.
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
            try:  # without O_NONBLOCK this would wait for a reader, perhaps for ever
                self._descriptor = os.open(self.path, os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)
            except OSError as error:
                if error.errno == errno.ENXIO:
                    what = "nobody reads this pipe; begin with its reader, or name a file"
                    raise OutputError(str(self.path), what) from error
                raise
        if os.isatty(self._descriptor):
            self.close()
            raise OutputError(str(self.path), "this is a terminal; name a file or a pipe")
        os.set_blocking(self._descriptor, True)

    def _open_file(self) -> None:
        """Open the partial file, lock and empty it, unless its writer holds it or has just given it its name."""
        how = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
        try:
            with self._reporting("create"):
                self._descriptor = os.open(self.partial, how, 0o666)
                if not stat.S_ISREG(os.fstat(self._descriptor).st_mode):
                    what = f"{self.partial} is no file, and until it is whole it needs that name"
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
        """Turn an error of the operating system into an OutputError."""
        try:
            yield
        except OSError as error:
            busy = isinstance(error, BlockingIOError)
            why = "another process is writing it" if busy else error.strerror
            raise OutputError(str(self.path), f"cannot {action} the file: {why}") from error

    def write(self, data: bytes | bytearray | memoryview) -> int:
        """Append `data`; after a write that failed nothing is appended any more.

        Raises:
            OutputError: If the operating system takes no more (disk full, ...), and ever after.
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
        """Do nothing: nothing is held back."""

    def close(self) -> None:
        """Release the file under the name that it has."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    def discard(self) -> None:
        """Close the file and remove it; the reader of a stream finds that it ends too soon."""
        if not self._target.streamed:
            with contextlib.suppress(OSError):
                self.partial.unlink()
        self.close()

    def publish(self) -> None:
        """End the file, which is whole: its bytes and its final name are on the disk when this returns.

        Raises:
            OutputError: If the operating system refuses, or meanwhile the name is another thing's; the file keeps
                its partial name.
        """
        if not self._target.streamed:
            self._rename(self._target.file)
        self.close()

    def _rename(self, final: Path) -> None:
        with self._reporting("finish"):
            os.fsync(self._descriptor)
            if self._new:
                os.link(self.partial, final)  # unlike a renaming, this never replaces a file
                self.partial.unlink()
            else:
                with contextlib.suppress(FileNotFoundError):
                    if not stat.S_ISREG(os.lstat(final).st_mode):
                        raise OutputError(str(self.path), "what has this name by now is no file")
                os.replace(self.partial, final)
            folder = os.open(final.parent, os.O_RDONLY | os.O_DIRECTORY)
            try:
                os.fsync(folder)
            finally:
                os.close(folder)


def write_whole(path: Path | str, data: bytes, *, new: bool = False) -> None:
    """Write an output of `data` that appears under its name when it is whole.

    Args:
        path: Its name.
        data: What it holds.
        new: See `Output`.

    Raises:
        OutputError: If it cannot be written; nothing is left behind.
    """
    write_pieces(path, [data], new=new)


def write_pieces(path: Path | str, pieces: Iterable[bytes], *, new: bool = False) -> None:
    """Write an output of `pieces` that appears under its name when it is whole.

    Raises:
        OutputError: If it cannot be written; nothing is left behind.
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
