"""Small arrays for compiled functions to work on that live on the stack, not on the heap.

`lean` functions can make no other ones. Such an array is gone when the function that made it returns: it may be
handed down, but not returned.
"""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils, config
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array

from pushplan.arrays import FloatArray, IntArray

BYTES = 8
"""Of a number."""


def _stack_array(kind: Any, shape: tuple[Any, ...]) -> tuple[Any, Callable[..., Any]] | None:
    """Return numba's signature and code of an array whose shape (constants) is known while compiling."""
    if not all(isinstance(size, types.IntegerLiteral) for size in shape):
        return None
    sizes = [size.literal_value for size in shape]
    array = types.Array(kind, len(shape), "C")

    def write_code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        del signature, arguments
        number = context.get_data_type(kind)
        data = cgutils.alloca_once(builder, number, size=prod(sizes))  # type: ignore[no-untyped-call]
        made = make_array(array)(context, builder)  # type: ignore[no-untyped-call]
        word = context.get_value_type(types.intp)
        steps = [BYTES * prod(sizes[k + 1 :]) for k in range(len(sizes))]
        populate_array(  # type: ignore[no-untyped-call]
            made,
            data=builder.bitcast(data, ir.PointerType(number)),
            shape=cgutils.pack_array(builder, [word(size) for size in sizes]),  # type: ignore[no-untyped-call]
            strides=cgutils.pack_array(builder, [word(step) for step in steps]),  # type: ignore[no-untyped-call]
            itemsize=word(BYTES),
            meminfo=None,
        )
        return made._getvalue()

    return array(*shape), write_code


if TYPE_CHECKING or config.DISABLE_JIT:

    def scratch(rows: int, columns: int) -> FloatArray:
        """Return an array (rows, columns) that holds anything; both numbers are constants."""
        return np.empty((rows, columns))

    def scratch_integers(size: int) -> IntArray:
        """Return an array (size,) of integers that holds anything; its size is a constant."""
        return np.empty(size, dtype=np.int64)

else:

    @intrinsic
    def scratch(context: Any, rows: Any, columns: Any) -> Any:
        """Return an array (rows, columns) that holds anything; both numbers are constants."""
        return _stack_array(types.float64, (rows, columns))

    @intrinsic
    def scratch_integers(context: Any, size: Any) -> Any:
        """Return an array (size,) of integers that holds anything; its size is a constant."""
        return _stack_array(types.int64, (size,))
