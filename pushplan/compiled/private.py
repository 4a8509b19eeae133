"""All that the package uses of numba beyond its documented interface, for the versions that it was tried with.

With any other version the plain way is taken: same results, slower, and nothing is told of compiling.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import prod
from typing import Any

import numba
import numpy as np
from numba import types
from numba.core import config
from numba.extending import intrinsic

TRIED = ("0.68",)
"""Versions of numba that the tests have passed with."""

COMPILES = not config.DISABLE_JIT  # type: ignore[attr-defined]
"""Whether anything is compiled; not for debuggers and measurements of coverage."""

USED = COMPILES and numba.__version__.rpartition(".")[0] in TRIED
"""Whether the private parts are used."""

NO_REFCOUNT: dict[str, bool] = {"_nrt": False} if USED else {}
"""Option of `njit` that leaves the counting of references out."""

NO_WRAPPER: dict[str, bool] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True} if USED else {}
"""Options of `njit` that leave out what calls from Python and from C need."""

BYTES = 8
"""Of a number."""


def _stack_array(kind: Any, shape: tuple[Any, ...]) -> tuple[Any, Callable[..., Any]] | None:
    """Return numba's signature and code of an array whose shape (constants) is known while compiling."""
    from llvmlite import ir
    from numba.core import cgutils
    from numba.np.arrayobj import make_array, populate_array

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


def _scratch(rows: int, columns: int) -> Any:
    return np.empty((rows, columns))


def _scratch_integers(size: int) -> Any:
    return np.empty(size, dtype=np.int64)


if USED:

    @intrinsic
    def scratch(context: Any, rows: Any, columns: Any) -> Any:
        """Return an array (rows, columns) on the stack."""
        return _stack_array(types.float64, (rows, columns))

    @intrinsic
    def scratch_integers(context: Any, size: Any) -> Any:
        """Return an array (size,) of integers on the stack."""
        return _stack_array(types.int64, (size,))

else:
    scratch, scratch_integers = numba.njit(_scratch), numba.njit(_scratch_integers)


if USED:
    from numba.core.registry import CPUDispatcher

    class _Inner(CPUDispatcher):
        """Refuses calls from Python: without a wrapper they would end the process."""

        def __call__(self, *arguments: object) -> None:
            raise TypeError(
                f"{self.py_func.__name__} has no wrapper for calls from Python: it is declared as inner"
            )


def inner_of(function: Any) -> Any:
    """Return a function that was made with `NO_WRAPPER` such that calls from Python are refused."""
    if USED:
        function.__class__ = _Inner
    return function


def entry_point(function: Any, kinds: tuple[Any, ...]) -> Any:
    """Return a compiled function for arguments of given types, without numba's look-up of types at every call."""
    function.compile(kinds)  # or loads it
    return function.get_overload(kinds) if USED else function


@contextmanager
def on_compiling(act: Callable[[], None]) -> Iterator[None]:
    """Call `act` whenever a function begins to be compiled inside; code that the cache has is not compiled."""
    if not USED:
        yield
        return
    from numba.core.event import Event, Listener, install_listener

    class Starts(Listener):
        def on_start(self, event: Event) -> None:
            act()

        def on_end(self, event: Event) -> None:
            pass

    with install_listener("numba:compile", Starts()):
        yield
