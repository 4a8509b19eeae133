"""A set of cells in compiled code: their keys in a table with open addressing."""

from __future__ import annotations

from pushplan.arrays import IntArray
from pushplan.compiled import inlined


@inlined
def cell_key(i: int, j: int, k: int) -> int:
    """Key above 0 of a cell: columns i and rows j from 0 to 2^20, headings k likewise."""
    return (((i << 20) + j) << 20) + k + 1


@inlined
def free_slot(table: IntArray, key: int) -> int:
    """Slot of a table (a power of two up to 2^23,) for a key, -1 if it holds the key already; 0 marks free slots."""
    last = table.shape[0] - 1
    slot = ((key * 0x9E3779B97F4A7C1) >> 40) & last  # columns do not change the bits below
    while table[slot] != 0:
        if table[slot] == key:
            return -1
        slot = (slot + 1) & last
    return int(slot)
