"""From a file's bytes to text that the YAML parser can take, with line and column of what it cannot."""

from __future__ import annotations

import re
from typing import NamedTuple

from pushplan.errors import Finding, PushplanError
from pushplan.util.names import LOG_MAGIC

MOST_BYTES = 1 << 20
"""Size up to which a file is read."""

# The line separators of YAML 1.1 are refused too: editors and YAML 1.2 do not count them as lines.
_UNPRINTABLE = re.compile("[^\t\n\r -~\xa0-\u2027\u202a-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_LINE_BREAK = re.compile("\r\n?|\n")


class DocumentError(PushplanError, ValueError):
    """A text is no document that pushplan reads; `findings` says why and where."""

    def __init__(self, findings: tuple[Finding, ...]) -> None:
        self.findings = findings
        super().__init__("; ".join(finding.what for finding in findings))


class Position(NamedTuple):
    """A place in a text, both counted from 1."""

    line: int
    column: int


def decode(data: bytes) -> str:
    """Return the text of a UTF-8 file; a byte order mark at its beginning is dropped.

    Raises:
        DocumentError: On too many bytes, bytes that are not UTF-8, or control characters.
    """
    if len(data) > MOST_BYTES:
        raise failure(f"the file is larger than the {MOST_BYTES} bytes allowed", Position(1, 1))
    if data.startswith(LOG_MAGIC):
        raise failure("this is a run log; `pushplan replay` reads it, and holds its scenario", Position(1, 1))
    data = data.removeprefix(b"\xef\xbb\xbf")
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        place = end_of(data[: error.start].decode("utf-8"))
        what = f"the byte 0x{data[error.start]:02x} is not UTF-8; save the file as UTF-8"
        raise failure(what, place) from error
    unprintable = _UNPRINTABLE.search(text)
    if unprintable:
        what = f"the control character U+{ord(unprintable[0]):04X} is not allowed"
        raise failure(what, end_of(text[: unprintable.start()]))
    return text


def end_of(text: str) -> Position:
    """Return the position just after `text`."""
    breaks = list(_LINE_BREAK.finditer(text))
    return Position(len(breaks) + 1, len(text) - (breaks[-1].end() if breaks else 0) + 1)


def failure(what: str, position: Position, where: str = "") -> DocumentError:
    """Return the error with one finding at `position`."""
    return DocumentError((Finding(where, what, *position),))
