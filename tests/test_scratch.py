"""Arrays on the stack hold what is written to them, and functions that count no references leave counts alone."""

from __future__ import annotations

import sys
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
from numba.core import config
from numba.core.errors import NumbaError

from pushplan.compiled import compiled, no_refcount
from pushplan.compiled.scratch import scratch, scratch_integers
from pushplan.util.arrays import FloatArray

ROWS, COLUMNS = 7, 3

pytestmark = pytest.mark.skipif(bool(config.DISABLE_JIT), reason="nothing is compiled")  # type: ignore[attr-defined]


def anew(decorated: Any) -> Any:
    """Compile a function as it is decorated, but not from the cache, which does not know what else has changed."""
    return numba.jit(**decorated.targetoptions)(decorated.py_func)


class Pair(NamedTuple):
    one: FloatArray
    other: FloatArray


@anew
@no_refcount
def _halves(size: float) -> float:
    """Work on two arrays at once, the second one in an inner function."""
    table, total = scratch(ROWS, COLUMNS), 0.0
    for i in range(ROWS):
        for j in range(COLUMNS):
            table[i, j] = size * (i * COLUMNS + j)
    for i in range(ROWS):
        total += _of_row(table[i])
    return total


@anew
@no_refcount
def _of_row(row: FloatArray) -> float:
    order, total = scratch_integers(COLUMNS), 0.0
    for j in range(COLUMNS):
        order[j] = COLUMNS - 1 - j
    for j in range(COLUMNS):
        total += 0.5 * row[order[j]]
    return total


@anew
@no_refcount
def _sum_of(pair: Pair) -> float:
    total = 0.0
    for k in range(pair.one.shape[0]):
        row = pair.other[k]
        total += pair.one[k] * row[0]
    return total


@anew
@compiled
def _looped(pair: Pair, count: int) -> float:
    total = 0.0
    for _ in range(count):
        total += _sum_of(pair)
    return total


def test_scratch_holds_what_is_written() -> None:
    expected = 0.5 * sum(range(ROWS * COLUMNS))
    assert _halves(1.0) == expected
    assert sum(_halves(float(k)) for k in range(1000)) == expected * sum(range(1000))


def test_its_size_must_be_a_constant() -> None:
    def sized(n: int) -> float:
        return float(scratch(n, 2)[0, 0])

    with pytest.raises(NumbaError):
        anew(no_refcount(sized))(3)


def test_arrays_outlive_lean_functions() -> None:
    """Called many times on arrays that Python holds and drops, they are neither freed early nor kept for ever."""
    one, other = np.arange(4.0), np.ones((4, 1))
    before = sys.getrefcount(one), sys.getrefcount(other)
    for _ in range(100):
        assert _looped(Pair(one, other), 50) == 300.0
    assert (sys.getrefcount(one), sys.getrefcount(other)) == before
    for _ in range(100):
        assert _sum_of(Pair(np.arange(4.0), np.ones((4, 1)))) == 6.0
