"""Output of a command: results on stdout, notes and progress on stderr, colours on terminals.

All printed text is escaped, because names and reasons from other people's files could contain terminal commands. JSON
stays exact.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
import textwrap
import threading
import time
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import degrees
from pathlib import Path
from typing import TextIO

import click

from pushplan.util.printable import printable

DELAY = 1.0
"""Time before the first progress line, s."""

PERIOD = 10.0
"""Time between progress lines in a file, s."""

NARROWEST = 20
"""Smallest width of the last column of a table, letters."""

ERASE = "\r\x1b[2K"
"""Escape code that erases the current line of a terminal."""


class Progress:
    """Progress of work that takes more than a second: one updated line on a terminal, else a line every `PERIOD`."""

    def __init__(self, what: str) -> None:
        self._what, self._news, self._began = what, "", time.monotonic()
        self._over = threading.Event()
        self._lock = threading.Lock()
        self._live = _is_terminal(sys.stderr)
        self._shown = False
        self._thread = threading.Thread(target=self._watch, name="progress", daemon=True)

    def update(self, news: str) -> None:
        """Set the text at the end of the next line."""
        self._news = news

    def update_share(self, done: int, of: int) -> None:
        """Set a progress bar at the end of the next line."""
        self.update(f"[{'#' * round(20 * done / of):20}] {done} of {of}")

    def announce(self, sentence: str) -> None:
        """Print a sentence on its own line now."""
        with self._lock:
            self._erase()
            _write(sys.stderr, printable(sentence))

    def __enter__(self) -> Progress:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._over.set()
        self._thread.join()
        self._erase()

    def _watch(self) -> None:
        wait = DELAY
        while not self._over.wait(wait):
            spent = f"{time.monotonic() - self._began:.1f} s"
            line = printable("  ".join(part for part in (f"{self._what} ...", spent, self._news) if part))
            with self._lock:
                try:
                    if self._live:
                        sys.stderr.write(ERASE + line[: shutil.get_terminal_size().columns - 1])
                        sys.stderr.flush()
                        self._shown = True
                    else:
                        _write(sys.stderr, line)
                except (OSError, ValueError):  # stderr is closed; the work itself continues
                    return
            wait = 0.2 if self._live else PERIOD

    def _erase(self) -> None:
        if self._shown:
            sys.stderr.write(ERASE)
            sys.stderr.flush()
            self._shown = False


@dataclass
class Console:
    """Streams of one command.

    Attributes:
        json: Whether stdout gets one JSON object only; text then goes to stderr.
        verbose: Whether unexpected failures show their traceback.
    """

    json: bool = False
    verbose: bool = False

    def say(self, *parts: str | tuple[str, str]) -> None:
        """Print a line of the result; each part is a text, or a text with a style: `bold`, `dim` or a colour."""
        texts = (
            printable(part, "\n\t") if isinstance(part, str) else self._styled(printable(part[0]), part[1])
            for part in parts
        )
        _write(self._stream, "".join(texts))

    def note(self, text: str) -> None:
        """Print a note, a warning or an error on stderr."""
        _write(sys.stderr, printable(text, "\n\t"))

    def table(self, rows: Iterable[Sequence[str]], style: str = "dim") -> None:
        """Print a table, with its first column in a style and its last one wrapped to the terminal's width."""
        listed = [[printable(cell) for cell in row] for row in rows]
        if not listed:
            return
        widths = [2 + max(map(_width, column)) for column in zip(*listed, strict=True)][:-1]
        indent = 2 + sum(widths)
        room = max(NARROWEST, shutil.get_terminal_size().columns - indent)
        for *cells, last in listed:
            blanks = [" " * (width - _width(cell)) for cell, width in zip(cells, widths, strict=True)]
            cells[:1] = [self._styled(cell, style) for cell in cells[:1]]
            begin = "  " + "".join(map("".join, zip(cells, blanks, strict=True)))
            wrapped = textwrap.wrap(last, room, break_on_hyphens=False) if _is_terminal(self._stream) else [last]
            for line in wrapped or [""]:
                _write(self._stream, (begin + line).rstrip())
                begin = " " * indent

    def emit(self, document: Mapping[str, object]) -> None:
        """Print the JSON object in JSON mode."""
        if self.json:
            sys.stdout.write(json.dumps(document, allow_nan=False, default=_plain) + "\n")

    def working(self, what: str) -> Progress:
        """Return a context that shows the progress of `what` on stderr after the first second."""
        return Progress(what)

    @property
    def _stream(self) -> TextIO:
        return sys.stderr if self.json else sys.stdout

    def _styled(self, text: str, style: str) -> str:
        """Return a text in a style for a terminal, or unchanged for a file."""
        if not text or not style or not _is_terminal(self._stream):
            return text
        return click.style(text, **{style: True}) if style in ("bold", "dim") else click.style(text, fg=style)


def _width(text: str) -> int:
    """Return the width of a text on a terminal: some letters take two columns, accents none."""
    wide = sum(unicodedata.east_asian_width(letter) in "WF" for letter in text)
    return len(text) + wide - sum(unicodedata.combining(letter) > 0 for letter in text)


def _is_terminal(stream: TextIO) -> bool:
    """Return whether a stream is a terminal with escape codes, and NO_COLOR is not set."""
    return stream.isatty() and os.environ.get("TERM") != "dumb" and not os.environ.get("NO_COLOR")


def _write(stream: TextIO, line: str) -> None:
    stream.write(line + "\n")


def _plain(value: object) -> object:
    """Convert NumPy arrays, NumPy numbers and paths to JSON values."""
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no JSON form")


# --- numbers as text --------------------------------------------------------------------------------------------


def time_text(seconds: float) -> str:
    """Return a time in ms or s."""
    return f"{1e3 * seconds:.3g} ms" if seconds < 1.0 else f"{seconds:.2f} s"


def span_text(seconds: float) -> str:
    """Return a duration, rounded, in days, hours, minutes or seconds."""
    for unit, size in (("d", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{max(seconds, 0.0):.0f} s"


def counted(number: int, noun: str, plural: str = "") -> str:
    """Return a number with its noun, e.g. `1 arc`, `2 arcs`, or `2 feet` with its own plural."""
    return f"{number} {noun}" if number == 1 else f"{number} {plural or noun + 's'}"


def length_text(metres: float) -> str:
    """Return a length in m, or in mm below 1 m."""
    if abs(metres) >= 1.0:
        return f"{metres:.3g} m"
    return "below 1e-6 mm" if abs(metres) < 1e-9 else f"{1e3 * metres:.3g} mm"


def angle_text(radians: float) -> str:
    """Return an angle in degrees."""
    angle = degrees(radians)
    return "below 1e-6 deg" if abs(angle) < 1e-6 else f"{angle:.3g} deg"


def plain(number: float) -> float:
    """Return a number rounded to 9 decimals, without negative zero."""
    return round(number, 9) + 0.0
