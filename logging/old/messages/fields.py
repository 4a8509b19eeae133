"""The fields of a protobuf message by name, numbers as arrays, so that two messages can be compared."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from google.protobuf.message import Message

from pushplan.logging.old.messages import blocks
from pushplan.logging.old.messages.schemas import Array, MessageClass
from pushplan.util.arrays import FloatArray

Value = FloatArray | tuple[Any, ...]
"""Numbers (k,), or texts, truth values and bytes."""


def flattened(message: MessageClass) -> dict[str, Value]:
    """Return what a message says: dotted names of fields, and the values that the field has in all its places."""
    found: dict[str, list[Any]] = {}
    for name, value in _leaves(message, ""):
        found.setdefault(name, []).append(value)
    return {name: _joined(values) for name, values in found.items()}


def _leaves(message: MessageClass, prefix: str) -> Iterator[tuple[str, Any]]:
    if message.DESCRIPTOR.full_name == Array.DESCRIPTOR.full_name and message.planes:
        yield prefix + message.name, blocks.decode(message).ravel()
        return
    for field in message.DESCRIPTOR.fields:
        if field.has_presence and not message.HasField(field.name):
            continue
        value, name = getattr(message, field.name), prefix + field.name
        members = [value] if isinstance(value, str | bytes | int | float | Message) else list(value)
        if field.message_type is not None:
            for member in members:
                yield from _leaves(member, f"{name}.")
        elif field.cpp_type in (field.CPPTYPE_STRING, field.CPPTYPE_BOOL, field.CPPTYPE_ENUM):
            yield name, tuple(members)
        else:
            yield name, np.array(members, dtype=np.float64)


def _joined(values: list[Any]) -> Value:
    if isinstance(values[0], np.ndarray):
        return np.concatenate(values)
    return tuple(member for value in values for member in value)
