"""Array types, and checked read-only copies for frozen dataclasses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pushplan.errors import PushplanError

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]
ComplexArray = NDArray[np.complex128]
Number = TypeVar("Number", bound=np.number)
RandomState = NDArray[np.uint64]
"""State (1,) of a compiled random generator."""


def plain_number(value: Any) -> Any:
    """Return a NumPy number as Python's `int` or `float`, and any other object unchanged.

    Results of NumPy numbers are NumPy objects, which OMPL and JSON do not accept.
    """
    return value.item() if isinstance(value, np.generic) else value


def numbers(values: ArrayLike, name: str) -> FloatArray:
    """Return a copy of `values` as floats.

    Raises:
        PushplanError: If they are not numbers.
    """
    try:
        return np.array(values, dtype=np.float64, copy=True)
    except (TypeError, ValueError, OverflowError) as error:
        raise PushplanError(f"{name} cannot be read as numbers: {error}") from error


def parameters(values: ArrayLike, name: str) -> FloatArray:
    """Return parameters along a path or a trajectory as floats; infinite ones are allowed.

    Raises:
        PushplanError: If one is not a number.
    """
    found = numbers(values, name)
    if np.isnan(found).any():
        raise PushplanError(f"{name} hold NaN; allowed: numbers")
    return found


def frozen(values: ArrayLike, shape: Sequence[int | None], name: str) -> FloatArray:
    """Return a read-only float copy of `values`, checked for shape and finiteness.

    Args:
        values: Values that NumPy can convert to floats.
        shape: Expected shape; None for any length.
        name: Noun for the values, for errors.

    Raises:
        PushplanError: If the shape is wrong, or a value is not a finite number.
    """
    array = numbers(values, name)
    fits = array.ndim == len(shape) and all(
        want is None or want == have for want, have in zip(shape, array.shape, strict=True)
    )
    if not fits:
        wanted = ", ".join("any" if n is None else str(n) for n in shape)
        raise PushplanError(f"{name} has shape {array.shape}; it must be ({wanted})")
    if not np.isfinite(array).all():
        raise PushplanError(f"{name} holds a number that is not finite")
    array.setflags(write=False)
    return array


def distinct(values: NDArray[Number]) -> NDArray[Number]:
    """Return the distinct values of numbers (k,), in order.

    `np.unique` would load numpy.ma to check for masked arrays, which takes 1/40 of the time of a first plan.
    """
    values = np.sort(values, axis=None)
    return values[np.flatnonzero(np.diff(values, prepend=np.nan))]


def columns_of(rows: FloatArray) -> FloatArray:
    """Return the columns of an array (m, n) as contiguous rows (n, m), because NumPy is slow along short rows."""
    return np.ascontiguousarray(rows.T)
