"""What an MCAP file can say."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple


class Message(NamedTuple):
    """A message: `kind` is its full protobuf type, `offset` the place of its chunk in the file."""

    topic: str
    kind: str
    time: int
    data: memoryview
    offset: int


@dataclass(frozen=True)
class Attachment:
    """A file inside the file; its name is never used as a path."""

    name: str
    data: bytes
    offset: int


@dataclass(frozen=True)
class Metadata:
    """Words under a name."""

    name: str
    words: dict[str, str]
    offset: int


Item = Message | Attachment | Metadata
