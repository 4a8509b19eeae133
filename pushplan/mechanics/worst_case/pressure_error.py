"""What a pressure that is a little off can change in the wrench that moves an object.

Of a stated pressure p, of total 1, all that lie between (1 - s) p and (1 + s) p are p (1 + s theta) with |theta| <= 1
and integral of p theta = 0. With r(x) the value of a row where the floor pulls at x, and any number c,

    | integral of p theta r | = | integral of p theta (r - c) | <= integral of p |r - c| ,

with equality for the median c. Taken here with the mean, which is the median where r is symmetric, over the cells of
`load_cells`; a loss is for s = 1.
"""

from __future__ import annotations

import math

from pushplan.compiled import no_refcount
from pushplan.util.arrays import FloatArray

CELLS_MISS = (0.08, 0.015)
"""Share, and part of the load, added for what varies inside the cells; sums over 40 times as many stay below."""


@no_refcount
def center(pulls: FloatArray, cells: FloatArray, begin: int, end: int) -> None:
    """Take the mean of the pulls (c, 3) of one object's cells (c, 3) from each of them; see `PackedIntervals`."""
    for d in range(3):
        mean = 0.0
        for c in range(begin, end):
            mean += cells[c, 2] * pulls[c, d]
        for c in range(begin, end):
            pulls[c, d] -= mean


@no_refcount
def row_loss(
    pulls: FloatArray,
    cells: FloatArray,
    begin: int,
    end: int,
    gx: float,
    gy: float,
    gm: float,
    constant: float,
) -> float:
    """Return by how much a row g may be smaller, from centred pulls; `constant` is the part that cells may miss."""
    loss = 0.0
    for c in range(begin, end):
        loss += cells[c, 2] * abs(gx * pulls[c, 0] + gy * pulls[c, 1] + gm * pulls[c, 2])
    return (1.0 + CELLS_MISS[0]) * loss + constant


@no_refcount
def size_loss(pulls: FloatArray, cells: FloatArray, begin: int, end: int, constant: float) -> float:
    """Return by how much the length of the wrench may change; see `row_loss`."""
    loss = 0.0
    for c in range(begin, end):
        loss += cells[c, 2] * math.sqrt(pulls[c, 0] ** 2 + pulls[c, 1] ** 2 + pulls[c, 2] ** 2)
    return (1.0 + CELLS_MISS[0]) * loss + constant
