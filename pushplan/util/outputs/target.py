"""What a name given for an output stands for, found out before anything is written.

A name may be a link, a pipe or a device. Renaming a finished file onto it would replace that, where the user meant
what it leads to.
"""

from __future__ import annotations

import contextlib
import os
import stat
from dataclasses import dataclass
from pathlib import Path

from pushplan.errors import OutputError

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


def look(path: Path) -> Target:
    """Return where an output called `path` goes.

    Raises:
        OutputError: When nothing can be written there, or writing would destroy what is no file.
    """
    found = _status(path)
    if found is not None and not stat.S_ISREG(found.st_mode):
        return _streamed(path, found.st_mode)
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


def _status(path: Path) -> os.stat_result | None:
    """Return what is there, behind all links; None when nothing is."""
    try:
        return path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (OSError, ValueError) as error:
        raise OutputError(str(path), getattr(error, "strerror", None) or str(error)) from error


def _streamed(path: Path, mode: int) -> Target:
    if not (stat.S_ISFIFO(mode) or stat.S_ISCHR(mode)):
        raise OutputError(str(path), _REFUSED.get(stat.S_IFMT(mode), "this is no file; name one"))
    if not os.access(path, os.W_OK):
        raise OutputError(str(path), "this pipe or device may not be written")
    return Target(path, path, streamed=True)


def _require_replaceable(path: Path, found: os.stat_result) -> None:
    """Refuse a file that is write-protected, or into which the program's own words go."""
    if not os.access(path, os.W_OK):
        raise OutputError(str(path), "this file is write-protected")
    for descriptor in _STANDARD_STREAMS:
        with contextlib.suppress(OSError):
            if os.path.samestat(found, os.fstat(descriptor)):
                raise OutputError(str(path), "what the command says goes into this file; name another one")
