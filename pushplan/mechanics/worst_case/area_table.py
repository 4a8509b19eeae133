"""One object's load area as a single table, the form in which compiled code works on it.

A table holds, one below the other, the object's constants, the question asked of it, three basic loads, its
corners with the edges that start there, and a pool of loads. One array keeps compiled calls cheap.
"""

from __future__ import annotations

import numpy as np

from pushplan.mechanics.worst_case.load_area import LoadArea
from pushplan.util.arrays import FloatArray

WIDTH = 21

HEAD = 0
"""Row of constants: centre g, shift h mu, size around g, nudge, number of corners, 1 for a polygon, 0 for feet."""
G_X, G_Y, SHIFT, SIZE, NUDGE_X, NUDGE_Y, COUNT, SOLID = range(8)

ASKED = 1
"""Row of the question: twist, row (gamma, kappa), the row that the edges see, 1 where c lies in the polygon."""
V_X, V_Y, OMEGA, ROW, SEEN, INSIDE = 0, 1, 2, 3, 6, 9

BASIS = 2
"""First of three rows of basic loads: x - h mu u about g, place x, direction u, height q, the row of its edge,
the column of its stretch there (0 at a corner), s on the edge, 1 when it may enter.

The pool is made of loads too: three rows for a corner and the two stretches of its edge, and so on, and a
last one for the centre of rotation, which has no edge.
"""
Y_X, Y_Y, X_X, X_Y, U_X, U_Y, Q, EDGE, PART, AT, FILLED = range(11)
LOAD = FILLED
"""Number of columns that a basic load takes over from the pool."""

CORNERS = 5
"""First row of the corners: place, tangent and length of the edge, then what `edge_kernel` finds there."""
C_X, C_Y, T_X, T_Y, LENGTH, FOUND = range(6)
STRETCH, PARTS = FOUND + 7, 4
"""First of the columns that describe the convex stretches of an edge, and their number for each of the two."""

_GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


def pack_area(area: LoadArea, rows: int) -> FloatArray:
    """Return the table (rows, WIDTH) of a load area; `rows` is at least `table_rows` of it.

    The nudge moves the centre towards a point inside, in the direction of no diagonal, so that it lies on no
    edge between basic loads.
    """
    count = len(area.points)
    weights = 1.0 + (np.arange(1, count + 1) * _GOLDEN) % 1.0
    nudge = 1e-10 * (weights @ area.points / weights.sum() - area.center)
    size = max(np.linalg.norm(area.points - area.center, axis=1).max(), 1e-9)
    step = np.roll(area.points, -1, axis=0) - area.points
    length = np.linalg.norm(step, axis=1, keepdims=True)
    table = np.zeros((rows, WIDTH))
    table[HEAD, : SOLID + 1] = [*area.center, area.shift, size, *nudge, count, area.solid]
    table[CORNERS : CORNERS + count, :FOUND] = np.hstack(
        [area.points, step / np.where(length > 0.0, length, 1.0), length]
    )
    pool = table[CORNERS + count : CORNERS + 4 * count + 1]
    pool[:, EDGE] = [*np.repeat(np.arange(CORNERS, CORNERS + count), 3), -1]
    pool[:, PART] = [*np.tile([0, STRETCH, STRETCH + PARTS], count), 0]
    return table


def table_rows(area: LoadArea) -> int:
    """Return how many rows the table of a load area needs."""
    return CORNERS + 4 * len(area.points) + 1
