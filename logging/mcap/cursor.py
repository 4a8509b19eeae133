"""Fields of a record, read one after another and never beyond its end."""

from __future__ import annotations

import struct

TEXT_LIMIT = 1 << 20
"""Longest text and list of words in a record, bytes."""


class DamageError(Exception):
    """Bytes that cannot be what they claim; `offset` counts from the beginning of the file."""

    def __init__(self, what: str, offset: int) -> None:
        self.what = what
        self.offset = offset
        super().__init__(what, offset)


class Cursor:
    """Reads little-endian fields from `data`, whose first byte is byte `offset` of the file.

    Every method raises DamageError when the bytes left do not suffice.
    """

    def __init__(self, data: memoryview, offset: int) -> None:
        self.data = data
        self._begin = offset
        self._at = 0

    @property
    def offset(self) -> int:
        """Place of the next byte in the file."""
        return self._begin + self._at

    @property
    def left(self) -> int:
        """Number of bytes not read yet."""
        return len(self.data) - self._at

    def take(self, count: int) -> memoryview:
        """Return the next `count` bytes."""
        if count > self.left:
            raise DamageError(f"a field claims {count} bytes of the {self.left} left", self.offset)
        self._at += count
        return self.data[self._at - count : self._at]

    def number(self, kind: str) -> int:
        """Return the next unsigned number: `kind` is B, H, I or Q (1, 2, 4 or 8 bytes)."""
        (value,) = struct.unpack(f"<{kind}", self.take(struct.calcsize(f"<{kind}")))
        return int(value)

    def text(self) -> str:
        """Return the next string, which begins with its length."""
        at = self.offset
        try:
            return str(self._limited(), "utf-8")
        except UnicodeDecodeError as error:
            raise DamageError("a text that is not UTF-8", at) from error

    def _limited(self) -> memoryview:
        """Return the bytes of a text or a list of words, behind their number."""
        at, size = self.offset, self.number("I")
        if TEXT_LIMIT < size <= self.left:
            raise DamageError(f"a text of {size} bytes; at most {TEXT_LIMIT} are allowed", at)
        return self.take(size)

    def texts(self) -> dict[str, str]:
        """Return the next map of strings, which begins with its length."""
        at = self.offset
        inner = Cursor(self._limited(), at + 4)
        pairs: dict[str, str] = {}
        while inner.left:
            key = inner.text()
            if key in pairs:
                raise DamageError(f"key {key!r} twice in one map", at)
            pairs[key] = inner.text()
        return pairs
