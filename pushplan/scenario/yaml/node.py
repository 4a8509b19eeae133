"""The tree that a YAML file is read into: every node knows where it stands in the text."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

from pushplan.errors import Finding
from pushplan.scenario.yaml.scalars import Scalar
from pushplan.scenario.yaml.text import Position

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

    def holds(self, place: Place) -> bool:
        """Tell whether there is a node at `place`."""
        return len(self._path(place)) == len(place)

    def locate(self, place: Place, at_key: bool = False) -> Position:
        """Return where `place` begins (or its key does), or the innermost node on the way that exists."""
        path = self._path(place)
        if len(path) == 0:
            return self.position
        return path[-1].key if at_key and len(path) == len(place) else path[-1].node.position

    def _path(self, place: Place) -> list[Entry]:
        """Return the entries on the way to `place`, as far as they exist."""
        path: list[Entry] = []
        content = self.content
        for step in place:
            if isinstance(content, dict) and isinstance(step, str) and step in content:
                path.append(content[step])
            elif isinstance(content, list) and isinstance(step, int) and 0 <= step < len(content):
                path.append(Entry(content[step].position, content[step]))
            else:
                break
            content = path[-1].node.content
        return path


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
