"""YAML text as a tree of nodes that know their line and column; only what plain data need is accepted.

Anchors, aliases, tags, merge keys, repeated keys and several documents are refused: they hide what a file
says, and aliases let a small file grow without bounds. The parser's events are read one at a time, so that
size and depth are limited before anything is built.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import yaml

from pushplan.errors import Finding
from pushplan.scenario.yaml.node import Document, Entry, Node, Place, place_text, shorten
from pushplan.scenario.yaml.scalars import resolve
from pushplan.scenario.yaml.syntax import explain
from pushplan.scenario.yaml.text import DocumentError, Position, decode, failure

MOST_NODES = 100_000
MOST_DEPTH = 32

_FAST_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""LibYAML where PyYAML was built with it: 15 times as fast (1 MB of obstacles: 0.3 s, not 5)."""

_LONG = 100_000
"""Characters from which it reads a text. In one of a hundred mutated texts it is laxer (tabs, `a?b` in a list) or
puts an error elsewhere, so what people write by hand is read by the parser in Python, whose words `explain` knows."""


def read_document(data: bytes, written_by_hand: bool = True) -> Document:
    """Parse the bytes of a YAML file that holds one document; what a program wrote is read faster.

    Raises:
        DocumentError: On anything that keeps the tree from being built.
    """
    text = decode(data)
    loader = (yaml.SafeLoader if written_by_hand and len(text) <= _LONG else _FAST_LOADER)(text)
    builder = _Builder(loader)
    try:
        return builder.document()
    except DocumentError as error:
        raise DocumentError((*builder.faults.values(), *error.findings)) from error
    except (yaml.MarkedYAMLError, ValueError, OverflowError) as error:
        reached = loader.get_mark() if hasattr(loader, "get_mark") else builder.reached
        last = explain(error, reached)
        raise DocumentError((*builder.faults.values(), *last.findings)) from error


class _Builder:
    """Turns the parser's events into nodes.

    Attributes:
        reached: Where the parser stands.
        faults: What is wrong so far, by its place.
    """

    def __init__(self, loader: Any) -> None:
        self.reached = yaml.Mark("", 0, 0, 0, "", 0)
        self._events: Iterator[Any] = self._noting(loader)
        self._nodes = 0
        self.faults: dict[Place, Finding] = {}

    def _noting(self, loader: Any) -> Iterator[Any]:
        while (event := loader.get_event()) is not None:
            self.reached = event.end_mark
            yield event

    def document(self) -> Document:
        next(self._events)  # the stream starts
        start = next(self._events)
        if isinstance(start, yaml.StreamEndEvent):
            return Document(Node(Position(1, 1), None))
        root = self._node((), next(self._events))
        next(self._events)  # the document ends
        after = next(self._events)
        if not isinstance(after, yaml.StreamEndEvent):
            raise failure("a second document begins here; a file must hold one", _position(after))
        return Document(root, self.faults)

    def _node(self, place: Place, event: Any) -> Node:
        position = _position(event)
        self._limit_size(place, position)
        if isinstance(event, yaml.AliasEvent):
            alias = f"*{shorten(str(event.anchor))}"
            self._fault(place, position, f"aliases ({alias}) are not supported; write the value out")
            return Node(position, None)
        self._refuse_properties(place, event, position)
        if isinstance(event, yaml.SequenceStartEvent):
            return Node(position, self._list(place))
        if isinstance(event, yaml.MappingStartEvent):
            return Node(position, self._mapping(place))
        return Node(position, event.value if event.style else resolve(event.value))

    def _limit_size(self, place: Place, position: Position) -> None:
        self._nodes += 1
        if self._nodes > MOST_NODES:
            raise failure(f"the file holds more than the {MOST_NODES} values allowed", position)
        if len(place) > MOST_DEPTH:
            what = f"nested deeper than the {MOST_DEPTH} levels allowed"
            raise failure(what, position, place_text(place[:2]))

    def _refuse_properties(self, place: Place, event: Any, position: Position) -> None:
        for kind, sign, name in (("anchors", "&", event.anchor), ("tags", "", event.tag)):
            if name is not None:
                what = f"{kind} ({sign}{shorten(name)}) are not supported; leave it out"
                self._fault(place, position, what)

    def _list(self, place: Place) -> list[Node]:
        nodes: list[Node] = []
        while not isinstance(event := next(self._events), yaml.SequenceEndEvent):
            nodes.append(self._node((*place, len(nodes)), event))
        return nodes

    def _mapping(self, place: Place) -> dict[str, Entry]:
        entries: dict[str, Entry] = {}
        while not isinstance(event := next(self._events), yaml.MappingEndEvent):
            key, position = self._key(place, event), _position(event)
            node = self._node((*place, key), next(self._events))
            if key not in entries:
                entries[key] = Entry(position, node)
                continue
            first = entries[key].key.line
            self._fault((*place, key), position, f"the key stands twice, first in line {first}; keep one")
        return entries

    def _key(self, place: Place, event: Any) -> str:
        node = self._node((*place, "?"), event)
        key = event.value if isinstance(event, yaml.ScalarEvent) else "?"
        if isinstance(node.content, list | dict):
            self._fault((*place, key), node.position, "a key must be text, not a list or a mapping")
        if key == "<<":
            self._fault((*place, key), node.position, "merge keys (<<) are not supported; write the keys out")
        return key

    def _fault(self, place: Place, position: Position, what: str) -> None:
        self.faults.setdefault(place, Finding(place_text(place), what, *position))


def _position(event: yaml.Event) -> Position:
    mark = event.start_mark
    return Position(1, 1) if mark is None else Position(mark.line + 1, mark.column + 1)
