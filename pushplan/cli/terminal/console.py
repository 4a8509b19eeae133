"""Where a command's words go: results to stdout, remarks and progress to stderr, colours to terminals.

Everything that people read passes here, and whatever a terminal would obey in it (names, reasons and lines come from
files of other hands) is escaped; JSON stays exact.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from pushplan.cli.terminal.progress import Progress
from pushplan.util.printable import printable

_MARK = f"\x1b{os.urandom(8).hex()}"
"""Begins a style in text to be written. Drawn anew in each process, so that no file can hold it."""

_CODES = {"bold": "1", "dim": "2", "red": "31", "green": "32", "yellow": "33"}


@dataclass(frozen=True)
class Console:
    """The streams of one command.

    Attributes:
        json: stdout is left to one JSON object; what people read goes to stderr.
        verbose: Failures that are not the user's show their traceback.
    """

    json: bool = False
    verbose: bool = False

    def say(self, text: str = "") -> None:
        """Write a line of the result, for people."""
        _write_line(self._people, text)

    def note(self, text: str) -> None:
        """Write a line beside the result: a remark, a warning, an error."""
        _write_line(sys.stderr, text)

    def table(self, rows: Iterable[tuple[str, str]]) -> None:
        """Write labels and values in two columns."""
        listed = list(rows)
        width = max((len(label) for label, _ in listed), default=0)
        for label, value in listed:
            self.say(f"  {self.paint(label.ljust(width), 'dim')}  {_escaped(value)}".rstrip())

    def emit(self, document: Mapping[str, object]) -> None:
        """Write the JSON object, in JSON mode only."""
        if self.json:
            sys.stdout.write(json.dumps(document, allow_nan=False, default=_plain) + "\n")

    def paint(self, text: str, style: str) -> str:
        """Return `text` in a style of `_CODES` when the result goes to a terminal."""
        plain = _escaped(text)
        return f"{_MARK}{_CODES[style]}m{plain}{_MARK}0m" if takes_colour(self._people) else plain

    @contextmanager
    def working(self, what: str) -> Iterator[Progress]:
        """Show on stderr that `what` goes on, once it has taken more than a second."""
        with Progress(what, sys.stderr, live=takes_colour(sys.stderr)) as progress:
            yield progress

    @contextmanager
    def computing(self, what: str) -> Iterator[Progress]:
        """Show the same of work with stable sets, and tell when their code is being compiled."""
        with self.working(what) as progress:
            from pushplan.compiled.announcement import announced

            with announced(progress.announce, progress.tell):
                yield progress

    @property
    def _people(self) -> TextIO:
        return sys.stderr if self.json else sys.stdout


def takes_colour(stream: TextIO) -> bool:
    """Tell whether a stream is a terminal that takes escape codes, and the user (NO_COLOR) has not said no."""
    return stream.isatty() and os.environ.get("TERM") != "dumb" and not os.environ.get("NO_COLOR")


def _escaped(text: str, keep: str = "") -> str:
    """Return `text` with what a terminal would obey escaped, but for styles and what is to be kept."""
    return _MARK.join(printable(piece, keep) for piece in text.split(_MARK))


def _write_line(stream: TextIO, text: str) -> None:
    stream.write(_escaped(text, "\n\t").replace(_MARK, "\x1b[") + "\n")


def _plain(value: object) -> object:
    """Turn NumPy's arrays and numbers, and paths, into what JSON knows."""
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no JSON form")
