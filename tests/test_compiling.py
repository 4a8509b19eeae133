"""Users are told what takes long when code is compiled, and only then."""

from __future__ import annotations

from collections.abc import Callable
from threading import Event

import pytest
from numba import njit
from numba.core.event import trigger_event

from pushplan.compiled import announcement
from pushplan.compiled.announcement import ANNOUNCEMENT, announced


class Timer:
    """Stands for `threading.Timer`, whose time is over when the test says so."""

    last: Timer

    def __init__(self, seconds: float, tell: Callable[[str], None], words: list[str]) -> None:
        Timer.last = self
        self.seconds, self.ident, self.daemon, self._tell, self._words = seconds, 0, False, tell, words
        self._cancelled = False

    def start(self) -> None:
        assert not self.ident
        self.ident = 1

    def cancel(self) -> None:
        self._cancelled = True

    def end(self) -> None:
        if self.ident and not self._cancelled:
            self._tell(*self._words)


@pytest.fixture
def timer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("threading.Timer", Timer)


@pytest.mark.usefixtures("timer")
def test_compiling_for_long_is_told_once() -> None:
    told: list[str] = []
    with announced(told.append), trigger_event("numba:compile"), trigger_event("numba:compile"):
        assert Timer.last.seconds == announcement.PATIENCE
        Timer.last.end()
    assert told == [ANNOUNCEMENT]


@pytest.mark.usefixtures("timer")
def test_what_takes_long_without_compiling_is_not_told() -> None:
    told: list[str] = []
    with announced(told.append):
        Timer.last.end()
    with trigger_event("numba:compile"):
        Timer.last.end()
    assert not told


@pytest.mark.usefixtures("timer")
def test_a_short_compilation_is_not_told() -> None:
    told: list[str] = []
    with announced(told.append), trigger_event("numba:compile"):
        pass
    Timer.last.end()
    assert not told


def test_a_real_function_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(announcement, "PATIENCE", 0.0)
    told: list[str] = []
    heard = Event()

    def hear(sentence: str) -> None:
        told.append(sentence)
        heard.set()

    with announced(hear):
        assert njit(lambda x: x + 1)(1) == 2
        assert heard.wait(60.0)
    assert told == [ANNOUNCEMENT]


def test_how_many_functions_are_compiled_is_news_until_the_end() -> None:
    news: list[str] = []
    with (
        announced(lambda sentence: None, news.append),
        trigger_event("numba:compile"),
        trigger_event("numba:compile"),
    ):
        pass
    assert news == ["compiling function 1", "compiling function 2", ""]
