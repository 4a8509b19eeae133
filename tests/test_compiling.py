"""Users are told what takes long when code is compiled, and only then."""

from __future__ import annotations

import time

import pytest
from numba import njit
from numba.core.event import trigger_event

from pushplan.compiled import announcement
from pushplan.compiled.announcement import ANNOUNCEMENT, announced


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(announcement, "PATIENCE", 0.1)


def test_compiling_for_long_is_told_once() -> None:
    told: list[str] = []
    with announced(told.append), trigger_event("numba:compile"), trigger_event("numba:compile"):
        time.sleep(0.3)
    assert told == [ANNOUNCEMENT]


def test_what_takes_long_without_compiling_is_not_told() -> None:
    told: list[str] = []
    with announced(told.append):
        time.sleep(0.3)
    with trigger_event("numba:compile"):
        time.sleep(0.3)
    assert not told


def test_a_short_compilation_is_not_told() -> None:
    told: list[str] = []
    with announced(told.append), trigger_event("numba:compile"):
        pass
    time.sleep(0.3)
    assert not told


def test_a_real_function_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(announcement, "PATIENCE", 0.0)
    told: list[str] = []
    with announced(told.append):
        assert njit(lambda x: x + 1)(1) == 2
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
