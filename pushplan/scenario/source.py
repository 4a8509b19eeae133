"""A YAML file as a tree of nodes with line and column, and the errors found in it.

Only plain data are accepted. Anchors, aliases, tags, merge keys, repeated keys and several documents are refused:
they obscure the content, and aliases let a small file grow without bounds. The parser's events are read one at a
time, so that size and depth are limited before the tree is built.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from pushplan.errors import Finding, PushplanError
from pushplan.util.names import LOG_MAGIC

MOST_BYTES = 1 << 20
"""Largest size of a file, bytes."""

MOST_NODES = 100_000
MOST_DEPTH = 32

Scalar = str | int | float | bool | None

Place = tuple[str | int, ...]
"""Path from the root to a node: keys and 0-based indices."""

_FAST_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""LibYAML, if PyYAML was built with it: it reads 1 MB of obstacles in 0.3 s instead of 5 s."""

_LONG = 100_000
"""Length from which LibYAML reads a text, characters. For one in a hundred mutated texts it accepts more (tabs, `a?b`
in a list) or reports another place. The Python parser therefore reads files written by hand; `_HINTS` matches it."""

# The line separators of YAML 1.1 are refused too, because editors and YAML 1.2 do not count them as lines.
_UNPRINTABLE = re.compile("[\0-\x08\v\f\x0e-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff\ufffe\uffff]")
_LINE_BREAK = re.compile("\r\n?|\n")


class DocumentError(PushplanError, ValueError):
    """A text is not a document that pushplan can read; `findings` holds the errors and their places."""

    def __init__(self, findings: tuple[Finding, ...]) -> None:
        self.findings = findings
        super().__init__("; ".join(finding.what for finding in findings))


class Position(NamedTuple):
    """Line and column in a text, from 1."""

    line: int
    column: int


class Entry(NamedTuple):
    """A value of a mapping and the position of its key."""

    key: Position
    node: Node


@dataclass(frozen=True, slots=True)
class Node:
    """A scalar, list or mapping, and the position where it begins."""

    position: Position
    content: Scalar | list[Node] | dict[str, Entry]

    def plain(self) -> Any:
        """Return the node as numbers, texts, lists and dictionaries."""
        if isinstance(self.content, dict):
            return {key: entry.node.plain() for key, entry in self.content.items()}
        if isinstance(self.content, list):
            return [node.plain() for node in self.content]
        return self.content

    def path(self, place: Place) -> list[Entry]:
        """Return the entries along the path to `place`, as far as they exist."""
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


class Source:
    """The document of one file and the errors found in it.

    Args:
        data: Content of the file.
        path: Name for messages.
        by_hand: Whether a person wrote the file; files from programs are read faster.

    Attributes:
        root: Root node.

    Raises:
        DocumentError: If the tree cannot be built.
    """

    def __init__(self, data: bytes, path: str | Path = "", by_hand: bool = True) -> None:
        self.data, self.path = data, Path(path)
        self._found: list[tuple[Place, Finding]] = []
        self._moved: Callable[[Place], Place] = lambda place: place
        self.root = _Parser(_decoded(data), by_hand, self._found).document()

    def moved(self, moved: Callable[[Place], Place]) -> Source:
        """Return the document of a part of the problem; `take` takes its findings over.

        Args:
            moved: Function that maps a place in the part to its place in the file.
        """
        part = copy(self)
        part._found, part._moved = [], moved
        return part

    def take(self, part: Source, *but: str) -> None:
        """Take over the findings of a part, except those in the sections `but`."""
        self._found += [found for found in part._found if not (found[0] and found[0][0] in but)]

    def error(self, place: Place, what: str, at_key: bool = False) -> None:
        """Record an error at a place; if the text leaves it out, at the last node of its path that exists."""
        place = self._moved(place)
        self._found.append((place, self.finding(place, what, at_key)))

    def finding(self, place: Place, what: str, at_key: bool = False) -> Finding:
        """Return a finding about a place."""
        path = self.root.path(place)
        position = path[-1].node.position if path else self.root.position
        if at_key and path and len(path) == len(place):
            position = path[-1].key
        return Finding(place_text(place), what, *position)

    def holds(self, place: Place) -> bool:
        """Return whether the document has a value at a place."""
        return len(self.root.path(place)) == len(place)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All findings without repetitions, in the order of the text."""
        found = dict.fromkeys(finding for _, finding in self._found)
        return tuple(sorted(found, key=lambda finding: (finding.line or 0, finding.column or 0)))

    @property
    def wrong(self) -> tuple[Place, ...]:
        """Places of all errors."""
        return tuple(place for place, _ in self._found)


def place_text(place: Place) -> str:
    """Return a place as text, e.g. `objects[1].shape.box`."""
    text = "".join(f"[{step}]" if isinstance(step, int) else f".{shorten(step)}" for step in place)
    return text.removeprefix(".")


def shorten(text: str, most: int = 40) -> str:
    """Return `text` in printable form, shortened for a message."""
    text = text if text.isprintable() else ascii(text)[1:-1]
    return text if len(text) <= most else text[: most - 3] + "..."


def _decoded(data: bytes) -> str:
    """Return the text of a UTF-8 file without its byte order mark."""
    if len(data) > MOST_BYTES:
        raise _failure(f"the file is larger than the {MOST_BYTES} bytes allowed", Position(1, 1))
    if data.startswith(LOG_MAGIC):
        raise _failure("this is a run log, not a scenario; read it with `pushplan replay`", Position(1, 1))
    data = data.removeprefix(b"\xef\xbb\xbf")
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        what = f"the byte 0x{data[error.start]:02x} is not UTF-8; save the file as UTF-8"
        raise _failure(what, _end_of(data[: error.start].decode("utf-8"))) from error
    unprintable = _UNPRINTABLE.search(text)
    if unprintable:
        what = f"the control character U+{ord(unprintable[0]):04X} is not allowed"
        raise _failure(what, _end_of(text[: unprintable.start()]))
    return text


def _end_of(text: str) -> Position:
    breaks = list(_LINE_BREAK.finditer(text))
    return Position(len(breaks) + 1, len(text) - (breaks[-1].end() if breaks else 0) + 1)


def _failure(what: str, position: Position, where: str = "") -> DocumentError:
    return DocumentError((Finding(where, what, *position),))


class _Parser:
    """Builds nodes from the parser's events, and records refused constructs that still let it build the tree."""

    def __init__(self, text: str, by_hand: bool, found: list[tuple[Place, Finding]]) -> None:
        self._loader: Any = (yaml.SafeLoader if by_hand and len(text) <= _LONG else _FAST_LOADER)(text)
        self._reached = yaml.Mark("", 0, 0, 0, "", 0)
        self._events: Iterator[Any] = self._noting()
        self._nodes, self._found = 0, found

    def _noting(self) -> Iterator[Any]:
        while (event := self._loader.get_event()) is not None:
            self._reached = event.end_mark
            yield event

    def document(self) -> Node:
        """Return the tree of the document.

        Raises:
            DocumentError: If the tree cannot be built; it also holds the findings so far.
        """
        try:
            return self._document()
        except DocumentError as error:
            last = error
        except (yaml.MarkedYAMLError, ValueError, OverflowError) as error:
            get_mark = getattr(self._loader, "get_mark", None)
            last = _explained(error, get_mark() if get_mark else self._reached)
        raise DocumentError((*(finding for _, finding in self._found), *last.findings))

    def _document(self) -> Node:
        next(self._events)  # the stream starts
        if isinstance(next(self._events), yaml.StreamEndEvent):
            return Node(Position(1, 1), None)
        root = self._node((), next(self._events))
        next(self._events)  # the document ends
        after = next(self._events)
        if not isinstance(after, yaml.StreamEndEvent):
            raise _failure("a second document begins here; a file must hold one", _position(after))
        return root

    def _node(self, place: Place, event: Any) -> Node:
        position = _position(event)
        self._nodes += 1
        if self._nodes > MOST_NODES:
            raise _failure(f"the file holds more than the {MOST_NODES} values allowed", position)
        if len(place) > MOST_DEPTH:
            what = f"nested deeper than the {MOST_DEPTH} levels allowed"
            raise _failure(what, position, place_text(place[:2]))
        if isinstance(event, yaml.AliasEvent):
            alias = f"*{shorten(str(event.anchor))}"
            self._fault(place, position, f"aliases ({alias}) are not supported; write the value out")
            return Node(position, None)
        for kind, sign, name in (("anchors", "&", event.anchor), ("tags", "", event.tag)):
            if name is not None:
                self._fault(place, position, f"{kind} ({sign}{shorten(name)}) are not supported; leave it out")
        if isinstance(event, yaml.SequenceStartEvent):
            nodes: list[Node] = []
            while not isinstance(event := next(self._events), yaml.SequenceEndEvent):
                nodes.append(self._node((*place, len(nodes)), event))
            return Node(position, nodes)
        if isinstance(event, yaml.MappingStartEvent):
            return Node(position, self._mapping(place))
        return Node(position, event.value if event.style else resolve(event.value))

    def _mapping(self, place: Place) -> dict[str, Entry]:
        entries: dict[str, Entry] = {}
        while not isinstance(event := next(self._events), yaml.MappingEndEvent):
            key, position = self._key(place, event), _position(event)
            node = self._node((*place, key), next(self._events))
            if key not in entries:
                entries[key] = Entry(position, node)
                continue
            first = entries[key].key.line
            self._fault((*place, key), position, f"the key is repeated, first in line {first}; keep one")
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
        if all(place != other for other, _ in self._found):
            self._found.append((place, Finding(place_text(place), what, *position)))


def _position(event: yaml.Event) -> Position:
    mark = event.start_mark
    return Position(1, 1) if mark is None else Position(mark.line + 1, mark.column + 1)


# Parser errors, explained for people who do not know YAML's grammar.
_HINTS = (
    ("found character '\\t'", "a tab is not allowed here; indent with spaces"),
    (
        "mapping values are not allowed",
        "a ':' is not allowed here; indent the line like its neighbours, or quote the text",
    ),
    ("could not find expected ':'", "a key without ':' and value"),
    ("expected <block end>, but found", "the line is not indented like its neighbours, or there is an extra bracket"),
    ("expected ',' or ']'", "a list in [...] lacks a ',' or its ']'"),
    ("expected ',' or '}'", "a mapping in {...} lacks a ',' or its '}'"),
    ("unexpected end of stream", "a quoted text lacks its closing quote"),
    ("unexpected document separator", "a quoted text lacks its closing quote"),
    ("unknown escape character", "an unknown escape in a double-quoted text; write \\\\ for a backslash"),
    ("expected the node content", "a value is missing here"),
    ("incompatible YAML document", "the file declares another YAML version; leave the %YAML line out"),
    ("expected '<document start>'", "something follows the end of the document; a file must hold one"),
)


def _explained(error: Exception, reached: yaml.Mark) -> DocumentError:
    """Return the error of the parser with its place; the parser has read the text up to `reached`.

    The parser also raises errors of Python's conversions, for example on an escape beyond the range of Unicode.
    """
    mark, problem = reached, "a number or an escape is out of range"
    if isinstance(error, yaml.MarkedYAMLError):
        mark = error.problem_mark or error.context_mark or reached
        problem = error.problem or str(error)
    hint = next((hint for sign, hint in _HINTS if sign in problem), problem)
    return _failure(f"not valid YAML: {hint}", Position(mark.line + 1, mark.column + 1))


# Plain scalars follow the core schema of YAML 1.2.2, section 10.3.2. PyYAML follows YAML 1.1, in which `1e-3` is text
# and `no` is false.
_MOST_DIGITS = 200  # 16^200 still fits a double
_INTEGERS = ((r"[-+]?[0-9]+", 10), (r"0o[0-7]+", 8), (r"0x[0-9a-fA-F]+", 16))
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_WORDS: dict[str, Scalar] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **{sign + word: float(sign + "inf") for sign in ("", "+", "-") for word in (".inf", ".Inf", ".INF")},
    **dict.fromkeys((".nan", ".NaN", ".NAN"), float("nan")),
}


def resolve(text: str) -> Scalar:
    """Return the value of an unquoted scalar: null, a boolean, a number or text.

    A number too large for a double becomes infinite, which fields of finite numbers refuse.
    """
    if text in _WORDS:
        return _WORDS[text]
    for pattern, base in _INTEGERS:
        if re.fullmatch(pattern, text):
            if len(text) > _MOST_DIGITS:
                return float("-inf") if text.startswith("-") else float("inf")
            return int(text, base)
    return float(text) if _FLOAT.fullmatch(text) else text
