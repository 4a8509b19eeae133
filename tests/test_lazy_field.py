"""A lazy field is worked out once, when it is asked for, and is like any other field otherwise."""

from __future__ import annotations

import pickle
from dataclasses import dataclass, replace
from functools import partial

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


def test_values_and_the_default_are_taken_as_they_are() -> None:
    assert Answer(1).late is None
    assert Answer(1, 7).late == 7
    assert replace(Answer(1, lambda: 8), known=2) == Answer(2, 8)


def test_what_is_not_worked_out_yet_can_be_sent_to_another_process() -> None:
    assert pickle.loads(pickle.dumps(Answer(1, partial(int, "5")))).late == 5
