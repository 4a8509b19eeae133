"""Escapes text for terminals, which obey control characters and change the direction of writing at others."""

from __future__ import annotations

import re

_UNSAFE = re.compile(
    "[\x00-\x1f\x7f-\x9f"  # C0, DEL and C1: escape sequences begin with one of them
    "\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069"  # characters that change the direction of writing
    "\u2028\u2029\ufeff\ud800-\udfff]"  # line breaks, the byte order mark, surrogates
)


def printable(text: str, keep: str = "") -> str:
    r"""Return `text` with control and bidirectional characters escaped as Python writes them (`\x1b`, `\u202e`).

    Args:
        text: Text from an untrusted source.
        keep: Characters to keep, such as line breaks.
    """
    return _UNSAFE.sub(
        lambda found: found[0] if found[0] in keep else found[0].encode("unicode_escape").decode(), text
    )


def cut(text: str, letters: int) -> str:
    """Return `text` in at most `letters` characters, without its middle if it is longer: names differ at the ends."""
    if len(text) <= letters:
        return text
    behind = (letters - 1) // 2
    return f"{text[: letters - 1 - behind]}…{text[len(text) - behind :]}"
