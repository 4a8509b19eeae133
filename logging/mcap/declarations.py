"""The schemas and channels that the messages of an MCAP file refer to by number."""

from __future__ import annotations

import hashlib
from collections.abc import Collection

from pushplan.logging.mcap import message_head, opcodes
from pushplan.logging.mcap.budget import Budget
from pushplan.logging.mcap.cursor import TEXT_LIMIT, DamageError
from pushplan.logging.mcap.items import Message
from pushplan.logging.mcap.records import Frame, Unwanted

_OVERHEAD = 512
"""Memory of a declaration beside its texts, bytes; of its schema only a hash is kept."""


class Declarations:
    """The schemas and channels of a file by their numbers.

    Attributes:
        unwanted: The channels of topics that nobody asked for.
    """

    def __init__(self, wanted: Collection[str] | None) -> None:
        self.unwanted = Unwanted(set())
        self._wanted = wanted
        self._schemas: dict[int, tuple[str, str, bytes]] = {}
        self._channels: dict[int, tuple[int, str, str]] = {}

    def add(self, frame: Frame, budget: Budget) -> None:
        """Take note of a schema or channel.

        Raises:
            DamageError: When its number stands for another one already, or a channel's schema is missing.
        """
        budget.keep(_OVERHEAD + min(4 * len(frame.body), TEXT_LIMIT), frame.offset)
        if frame.opcode == opcodes.SCHEMA:
            self._add_schema(frame)
        else:
            self._add_channel(frame)

    def _add_schema(self, frame: Frame) -> None:
        cursor = frame.cursor
        number = cursor.number("H")
        schema = (cursor.text(), cursor.text(), hashlib.sha256(cursor.take(cursor.number("I"))).digest())
        if self._schemas.setdefault(number, schema) != schema:
            raise DamageError(f"schema {number} is declared twice", frame.offset)

    def _add_channel(self, frame: Frame) -> None:
        cursor = frame.cursor
        number, schema = cursor.number("H"), cursor.number("H")
        channel = (schema, cursor.text(), cursor.text())
        if schema != 0 and schema not in self._schemas:
            raise DamageError(f"channel {number} has schema {schema}, which is not declared", frame.offset)
        if self._channels.setdefault(number, channel) != channel:
            raise DamageError(f"channel {number} is declared twice", frame.offset)
        if self._wanted is not None and channel[1] not in self._wanted:
            self.unwanted.channels.add(number)

    def message(self, frame: Frame) -> Message:
        """Return the message in `frame`.

        Raises:
            DamageError: When its channel is not declared.
        """
        if len(frame.body) < message_head.FIELDS.size:
            raise DamageError("a message without its number, channel and times", frame.offset)
        number, _, time, _ = message_head.FIELDS.unpack_from(frame.body)
        if number not in self._channels:
            raise DamageError(f"a message on channel {number}, which is not declared", frame.offset)
        schema, topic, encoding = self._channels[number]
        kind = self._schemas[schema][0] if schema and encoding == "protobuf" else ""
        return Message(topic, kind, time, frame.body[message_head.FIELDS.size :], frame.offset)
