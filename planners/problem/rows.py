"""Rows of tables written in compiled code."""

from __future__ import annotations

from pushplan.compiled import no_refcount
from pushplan.util.arrays import FloatArray


@no_refcount
def put(target: FloatArray, source: FloatArray) -> None:
    """Copy the numbers of `source` (k,) to the first ones of `target` (k or more,)."""
    for i in range(source.shape[0]):
        target[i] = source[i]


@no_refcount
def put_rows(target: FloatArray, source: FloatArray) -> None:
    """Copy the rows of `source` (k, c) to the first ones of `target` (k or more, c)."""
    for i in range(source.shape[0]):
        put(target[i], source[i])
