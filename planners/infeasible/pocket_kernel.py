"""Compiled outer approximation of the poses that stable pushes lead to: cells that a body may reach, none left out.

From a cell, a step of a fixed travel leads to no other cells than those that its bounds allow, whatever stable twists
it is made of, however often they change. A cell is left out only where the body at every pose in it touches
something. So all that can be reached, seen once a step, lies in the cells found.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from pushplan.compiled import inlined, no_refcount
from pushplan.planners.collision.separation import Scene, separation
from pushplan.planners.search.cell_table import cell_key, slot_of
from pushplan.util.arrays import FloatArray, IntArray

CLOSED, MET, OPEN = 0, 1, 2
"""How spreading ends: no more cells, near the other pose, or with too many cells to tell."""

ORIGIN = 1 << 19
"""Column and row of the cell around the pose where it begins."""


class Steps(NamedTuple):
    """Cells, and what a step can do; seen from the body's middle, which moves ahead, +x, in every stable push.

    Attributes:
        side: Of a cell, m.
        headings: Cells of a full turn.
        sign: 1 for steps ahead, -1 for steps back.
        travel: Of the body's middle ahead in a step, m.
        longest: Bound on the way of the body's middle in a step or a part of one, m.
        near: Distance of cells' middles, m, that a step or a part of one bridges at most.
        turned: Turn, rad, likewise.
        ahead: (2,) least and most travel along the heading at its beginning, m.
        turn: Cells of heading to the first row of `aside`.
        aside: (k, 2) least and most travel to the left (m) with each turn; the first is larger where there is none.
        touching: The body at every pose of a cell touches something if its distance at the cell's middle is below, m.
    """

    side: float
    headings: int
    sign: float
    travel: float
    longest: float
    near: float
    turned: float
    ahead: FloatArray
    turn: int
    aside: FloatArray
    touching: float


@inlined
def _bounds(steps: Steps, row: int, c: float, s: float) -> tuple[float, float, float, float]:
    """Box (xmin, ymin, xmax, ymax) around the displacements of a step with a turn, in cells; c, s of its heading."""
    xmin = ymin = math.inf
    xmax = ymax = -math.inf
    for i in range(2):
        for j in range(2):
            ahead, aside = steps.sign * steps.ahead[i], steps.sign * steps.aside[row, j]
            x, y = c * ahead - s * aside, s * ahead + c * aside
            xmin, xmax, ymin, ymax = min(xmin, x), max(xmax, x), min(ymin, y), max(ymax, y)
    return xmin / steps.side, ymin / steps.side, xmax / steps.side, ymax / steps.side


@inlined
def _position(begin: FloatArray, steps: Steps, i: int, j: int) -> tuple[float, float]:
    """Middle of a column and row in the world, m."""
    c, s = math.cos(begin[2]), math.sin(begin[2])
    x, y = steps.side * (i - ORIGIN), steps.side * (j - ORIGIN)
    return begin[0] + c * x - s * y, begin[1] + s * x + c * y


@inlined
def _may_hold(scene: Scene, begin: FloatArray, steps: Steps, cell: tuple[int, int, int], near: float) -> bool:
    """Whether the body may be free at some pose in a cell."""
    i, j, k = cell
    x, y = _position(begin, steps, i, j)
    theta = begin[2] + 2.0 * math.pi * k / steps.headings
    c, s = math.cos(theta), math.sin(theta)
    middle = scene.body_bound
    x, y = x - c * middle[0] + s * middle[1], y - s * middle[0] - c * middle[1]
    return separation(scene, x, y, theta, near) >= steps.touching


@no_refcount
def spread(
    scene: Scene,
    begin: FloatArray,
    steps: Steps,
    other: FloatArray,
    table: IntArray,
    cells: IntArray,
) -> tuple[int, int]:
    """Find the cells that can be reached, step by step, until there are no more.

    Args:
        scene: The body and what it must not touch.
        begin: (3,) position of the body's middle and heading to begin at, world; a cell's middle.
        steps: What a step can do.
        other: (3,) the like of the pose that is looked for.
        table: (2 n,) zeros, a power of two.
        cells: (n, 3) filled with column, row and heading of the cells found; n cells are looked at, at most.

    Returns:
        (end, count): how it ended, and the cells found.
    """
    table[slot_of(table, cell_key(ORIGIN, ORIGIN, 0))] = cell_key(ORIGIN, ORIGIN, 0)
    cells[0, 0], cells[0, 1], cells[0, 2] = ORIGIN, ORIGIN, 0
    # `separation` may stop at a distance it is told: a little more than what is compared with decides as well.
    near = max(steps.touching, 0.0) + steps.side
    # Most cells that steps may lead to are known already: after 64 looks for each slot of the table it is given up.
    count, done, looked, left = 1, 0, 1, 64 * table.shape[0]
    while done < count:
        i, j, k = cells[done, 0], cells[done, 1], cells[done, 2]
        done += 1
        x, y = _position(begin, steps, i, j)
        theta = 2.0 * math.pi * k / steps.headings
        turn = abs((begin[2] + theta - other[2] + math.pi) % (2.0 * math.pi) - math.pi)
        if math.hypot(x - other[0], y - other[1]) < steps.near and turn < steps.turned:
            return MET, count
        if left < 0:
            return OPEN, count
        c, s = math.cos(theta), math.sin(theta)
        for row in range(steps.aside.shape[0]):
            if steps.aside[row, 0] > steps.aside[row, 1]:
                continue
            xmin, ymin, xmax, ymax = _bounds(steps, row, c, s)
            heading = (k + steps.turn + row) % steps.headings
            # From anywhere within half a cell to anywhere within half a cell: one cell more to either side.
            for column in range(math.ceil(i - 1.0 + xmin), math.floor(i + 1.0 + xmax) + 1):
                for line in range(math.ceil(j - 1.0 + ymin), math.floor(j + 1.0 + ymax) + 1):
                    left -= 1
                    key = cell_key(column, line, heading)
                    slot = slot_of(table, key)
                    if table[slot] == key:
                        continue
                    looked += 1
                    if looked > cells.shape[0]:
                        return OPEN, count
                    table[slot] = key
                    if _may_hold(scene, begin, steps, (column, line, heading), near):
                        cells[count, 0], cells[count, 1], cells[count, 2] = column, line, heading
                        count += 1
    return CLOSED, count
