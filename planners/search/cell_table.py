"""A set of cells in compiled code: their keys in a table with open addressing."""

from __future__ import annotations

import math

from pushplan.compiled import inlined
from pushplan.util.arrays import FloatArray, IntArray


@inlined
def cell_key(i: int, j: int, k: int) -> int:
    """Key above 0 of a cell: columns i and rows j from 0 to 2^20, headings k likewise."""
    return (((i << 20) + j) << 20) + k + 1


@inlined
def pose_key(box: FloatArray, side: float, angle: float, x: float, y: float, theta: float) -> int:
    """Key of the cell, `side` (m) wide and `angle` (rad) high, that a pose is in; 0 outside the box (4,)."""
    if x < box[0] or y < box[1] or x > box[2] or y > box[3]:
        return 0
    return cell_key(
        int((x - box[0]) / side), int((y - box[1]) / side), int((theta % (2.0 * math.pi)) / angle)
    )


@inlined
def slot_of(table: IntArray, key: int) -> int:
    """Slot of a table (a power of two up to 2^23,) that holds a key, or is free for it; 0 marks free slots."""
    last = table.shape[0] - 1
    slot = ((key * 0x9E3779B97F4A7C1) >> 40) & last  # columns do not change the bits below
    while table[slot] != 0 and table[slot] != key:
        slot = (slot + 1) & last
    return int(slot)
