"""The tree that a YAML file is read into: every node knows where it stands in the text."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

from pushplan.errors import Finding
from pushplan.yaml_scalars import Scalar
from pushplan.yaml_text import Position

Place = tuple[str | int, ...]
"""The way from the root to a node: keys and 0-based indices."""


class Entry(NamedTuple):
    """A value of a mapping and where its key stands."""

    key: Position
    node: Node


@dataclass(frozen=True)
class Node:
    """A scalar, a list of nodes or a mapping to entries, and where it begins."""

    position: Position
    content: Scalar | list[Node] | dict[str, Entry]

    def plain(self) -> Any:
        """Return the node as numbers, texts, lists and dictionaries."""
        if isinstance(self.content, dict):
            return {key: entry.node.plain() for key, entry in self.content.items()}
        if isinstance(self.content, list):
            return [node.plain() for node in self.content]
        return self.content

    def locate(self, place: Place, at_key: bool = False) -> Position:
        """Return where `place` begins (or its key does), or the innermost node on the way that exists."""
        node, position = self, self.position
        for step in place:
            if isinstance(node.content, dict) and isinstance(step, str) and step in node.content:
                position, node = node.content[step]
            elif isinstance(node.content, list) and isinstance(step, int) and 0 <= step < len(node.content):
                position = (node := node.content[step]).position
            else:
                return node.position
        return position if at_key else node.position


@dataclass(frozen=True)
class Document:
    """A file's tree, and what was found wrong without making it unreadable.

    Attributes:
        root: The outermost node.
        faults: Finding for each place whose node is not to be trusted.
    """

    root: Node
    faults: dict[Place, Finding] = field(default_factory=dict)


def place_text(place: Place) -> str:
    """Return a place as people write it, e.g. `objects[1].shape.box`."""
    text = ""
    for step in place:
        text += f"[{step}]" if isinstance(step, int) else f".{shorten(step)}"
    return text.removeprefix(".")


def shorten(text: str, most: int = 40) -> str:
    """Return `text` in a form and length that fit a message."""
    text = text if text.isprintable() else ascii(text)[1:-1]
    return text if len(text) <= most else text[: most - 3] + "..."
