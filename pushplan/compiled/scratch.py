"""Small arrays for compiled functions to work on that live on the stack, not on the heap.

`no_refcount` functions can make no other ones. Such an array is gone when the function that made it returns: it may
be handed down, but not returned.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pushplan.util.arrays import FloatArray, IntArray

if TYPE_CHECKING:

    def scratch(rows: int, columns: int) -> FloatArray:
        """Return an array (rows, columns) that holds anything; both numbers are constants."""

    def scratch_integers(size: int) -> IntArray:
        """Return an array (size,) of integers that holds anything; its size is a constant."""

else:
    from pushplan.compiled.private import scratch, scratch_integers

__all__ = ["scratch", "scratch_integers"]
