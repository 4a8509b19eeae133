"""ROS 2 messages as bytes: CDR, little-endian, with plain nested dictionaries for messages.

Numbers are aligned to their size, counted from behind the four bytes that say which encoding follows.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Any

from pushplan.logging.export.bag.messages import TYPES, key_of

_ENCODING = b"\x00\x01\x00\x00"

_NUMBERS = {
    "bool": "?", "uint8": "B", "int32": "i", "uint32": "I", "float32": "f", "float64": "d",
}  # fmt: skip


def encode(name: str, message: Mapping[str, Any]) -> bytes:
    """Return the bytes of a message of the type `name`; fields that it leaves out are zero or empty.

    Raises:
        KeyError: When the message has a field that its type has not.
    """
    out = bytearray()
    _put_message(out, key_of(name), message)
    return _ENCODING + bytes(out)


def _put_message(out: bytearray, key: str, message: Mapping[str, Any]) -> None:
    fields = [field.split() for field in TYPES[key]]
    unknown = set(message) - {name for _, name in fields}
    if unknown:
        raise KeyError(f"{key} has no field {sorted(unknown)[0]!r}")
    for kind, name in fields:
        _put(out, kind, message.get(name))


def _put(out: bytearray, kind: str, value: Any) -> None:
    """Append one field; None stands for zero or empty."""
    if kind.endswith("[]"):
        elements = value or ()
        _put_number(out, "I", len(elements))
        for element in elements:
            _put(out, kind.removesuffix("[]"), element)
    elif kind == "string":
        data = (value or "").encode() + b"\0"
        _put_number(out, "I", len(data))
        out += data
    elif kind in _NUMBERS:
        _put_number(out, _NUMBERS[kind], value or 0)
    else:
        _put_message(out, kind, value or {})


def _put_number(out: bytearray, kind: str, value: float) -> None:
    size = struct.calcsize(f"<{kind}")
    out += bytes(-len(out) % size)
    out += struct.pack(f"<{kind}", value)
