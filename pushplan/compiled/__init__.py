"""The decorators of compiled functions, their cache on disk, and what the user is told while they are compiled."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np
from numba import njit

from pushplan.compiled import private
from pushplan.compiled.cache import discard_stale_cache

discard_stale_cache()

compiled = njit(cache=True, error_model="numpy")
"""Compile a function on its first call, or load it from the cache; x / 0 is infinite as in NumPy."""

if TYPE_CHECKING:
    no_refcount = compiled
else:
    no_refcount = njit(cache=True, error_model="numpy", **private.NO_REFCOUNT)
"""Compile a function that makes no arrays but those of `scratch`: it counts no references to the ones it is given.

Counting takes more than half of the time of short functions that look into tuples of arrays. `compiled` gives the
same results, slower.
"""

if TYPE_CHECKING:
    inner = compiled
else:

    def inner(function):
        """Compile as `no_refcount` does a function that only compiled code calls: no call from Python is prepared.

        Taking dozens of arrays apart takes longer to compile than many a function: without it, the slipping simulator
        compiles in three quarters of the time.
        """
        options = private.NO_REFCOUNT | private.NO_WRAPPER
        return private.inner_of(njit(cache=True, error_model="numpy", **options)(function))


inlined = njit(inline="always", error_model="numpy")
"""Compile a function into its caller instead, for code with one caller.

LLVM optimises a function anew with everything it calls at each level of calls, so every level above a large one costs
compile time.
"""

in_threads = njit(cache=True, error_model="numpy", nogil=True)
"""Compile a long-running function that several threads may be in at the same time."""


def any_integer(value: int) -> int:
    """Return a constant for compiled code that passes it on: for a plain one numba compiles the called one anew."""
    return cast(int, np.int64(value))
