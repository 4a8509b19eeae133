"""Array types and the read-only copies that the frozen dataclasses hold."""

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
"""(1,) state of a compiled random generator."""


def plain_number(value: Any) -> Any:
    """Return one of NumPy's numbers as Python's `int` or `float`, and anything else as it is.

    What NumPy's numbers are compared with becomes NumPy's, too, and neither OMPL nor JSON takes that.
    """
    return value.item() if isinstance(value, np.generic) else value


def numbers(values: ArrayLike, name: str) -> FloatArray:
    """Return a copy of `values` as floats.

    Raises:
        PushplanError: If they are none.
    """
    try:
        return np.array(values, dtype=np.float64, copy=True)
    except (TypeError, ValueError, OverflowError) as error:
        raise PushplanError(f"{name} cannot be read as numbers: {error}") from error


def parameters(values: ArrayLike, name: str) -> FloatArray:
    """Return parameters along a path or a trajectory, infinite ones too, as floats.

    Raises:
        PushplanError: If one is no number.
    """
    found = numbers(values, name)
    if np.isnan(found).any():
        raise PushplanError(f"{name} hold NaN; allowed: numbers")
    return found


def frozen(values: ArrayLike, shape: Sequence[int | None], name: str) -> FloatArray:
    """Return a read-only float copy of `values`, checked for shape and finiteness.

    Args:
        values: Anything NumPy can turn into floats.
        shape: Expected shape; None stands for any length.
        name: What the values are, for the error.

    Raises:
        PushplanError: On a wrong shape or a number that is not finite, or where there are no numbers.
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
    """Return the different ones of numbers (k,), in order.

    `np.unique` would load numpy.ma to ask whether some are masked, a fortieth of the time that a first plan takes.
    """
    values = np.sort(values, axis=None)
    return values[np.flatnonzero(np.diff(values, prepend=np.nan))]


def columns_of(rows: FloatArray) -> FloatArray:
    """Return the columns of an array (m, n), each in one piece (n, m): NumPy is slow along short rows."""
    return np.ascontiguousarray(rows.T)
