"""A lazy field is worked out once, when it is asked for, and is like any other field otherwise."""

from __future__ import annotations

from dataclasses import dataclass

from pushplan.util.lazy_field import LazyField


@dataclass(frozen=True)
class Answer:
    known: int
    late: LazyField[int | None] = LazyField(None)


def test_a_function_is_called_once_and_not_before_it_is_asked() -> None:
    calls: list[int] = []

    def work() -> int:
        calls.append(1)
        return 42

    answer = Answer(1, work)
    assert not calls
    assert (answer.late, answer.late) == (42, 42)
    assert len(calls) == 1
