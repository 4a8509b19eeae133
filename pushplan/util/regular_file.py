"""Read files that others name: regular ones only, since a pipe or a device might never end."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path


def read_regular(path: Path, most: int) -> bytes:
    """Return at most `most` bytes of a file.

    Raises:
        OSError: When it cannot be read or is no regular file.
    """
    # Opened without blocking: a named pipe that nobody writes to would hold the process in open().
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    with open(descriptor, "rb") as file:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise OSError(errno.EINVAL, "this is no regular file", str(path))
        return file.read(most)
