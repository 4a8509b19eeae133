"""A line on stderr that tells that something is going on, for whatever takes more than a second."""

from __future__ import annotations

from threading import Event, Lock, Thread
from time import monotonic
from types import TracebackType
from typing import TextIO

from pushplan.util.printable import printable

DELAY = 1.0
"""Seconds of silence before the first line."""
_PERIOD_LIVE, _PERIOD_PLAIN = 0.2, 10.0


class Progress:
    """Writes `what`, the time it has taken and the latest news, from a thread of its own.

    A terminal gets one line that is rewritten and wiped at the end; a file gets a line now and then.
    """

    def __init__(self, what: str, stream: TextIO, live: bool) -> None:
        self._what, self._stream, self._live = what, stream, live
        self._news = ""
        self._shown = False
        self._lock = Lock()
        self._done = Event()
        self._begin = monotonic()
        self._thread = Thread(target=self._watch, name="progress", daemon=True)

    def tell(self, news: str) -> None:
        """Set the text that the next line ends with."""
        self._news = news

    def tell_share(self, done: int, of: int) -> None:
        """Let the next line end with a bar of what is done."""
        self.tell(f"[{'#' * round(20 * done / of):20}] {done} of {of}")

    def announce(self, sentence: str) -> None:
        """Write a sentence of its own, at once."""
        with self._lock:
            self._wipe()
            self._write(f"{printable(sentence)}\n")

    def __enter__(self) -> Progress:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._done.set()
        self._thread.join()
        self._wipe()

    def _watch(self) -> None:
        wait = DELAY
        while not self._done.wait(wait):
            with self._lock:
                self._wipe()
                self._write(self._line() if self._live else f"{self._line()}\n")
                self._shown = self._live
            wait = _PERIOD_LIVE if self._live else _PERIOD_PLAIN

    def _line(self) -> str:
        spent = f"{monotonic() - self._begin:.1f} s"
        line = "  ".join(part for part in (f"{self._what} ...", spent, self._news) if part)
        return printable(line)

    def _wipe(self) -> None:
        if self._shown:
            self._write("\r\x1b[K")  # back to the beginning of the line, which is cleared
            self._shown = False

    def _write(self, text: str) -> None:
        try:
            self._stream.write(text)
            self._stream.flush()
        except (OSError, ValueError):  # nobody reads any more; the work itself goes on
            self._done.set()
