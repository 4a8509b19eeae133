"""Text of files made fit for terminals, which obey control characters and turn lines around at others."""

from __future__ import annotations

import re

_UNSAFE = re.compile(
    "[\x00-\x1f\x7f-\x9f"  # C0, DEL and C1: escape sequences begin with one of them
    "\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069"  # what turns the direction of writing
    "\u2028\u2029\ufeff\ud800-\udfff]"  # breaks of lines, a byte order mark, halves of characters
)


def printable(text: str, keep: str = "") -> str:
    r"""Return `text` with control and bidirectional characters escaped as Python writes them (`\x1b`, `\u202e`).

    Args:
        text: From anywhere.
        keep: Characters that may stay, such as the breaks of lines of a text of ours.
    """
    return _UNSAFE.sub(
        lambda found: found[0] if found[0] in keep else found[0].encode("unicode_escape").decode(), text
    )


def cut(text: str, letters: int) -> str:
    """Return `text` in at most so many letters, its middle left out if it is longer: names differ at their ends."""
    if len(text) <= letters:
        return text
    behind = (letters - 1) // 2
    return f"{text[: letters - 1 - behind]}…{text[len(text) - behind :]}"
