"""Poses that no push leads out of, or into: what can be reached on a grid, step by step."""

from pushplan.core.collision import Scene
from pushplan.util.arrays import FloatArray, IntArray

CLOSED: int
MET: int
OPEN: int
"""How spreading ends: no more cells, near the other pose, or with too many cells to tell."""
ORIGIN: int
"""Column and row of the cell around the pose where it begins."""

class Steps:
    """Cells, and what a step can do; seen from the body's middle, which moves ahead, +x, in every stable push.

    Args:
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

    def __init__(
        self,
        side: float,
        headings: int,
        sign: float,
        travel: float,
        longest: float,
        near: float,
        turned: float,
        ahead: FloatArray,
        turn: int,
        aside: FloatArray,
        touching: float,
    ) -> None: ...
    @property
    def side(self) -> float: ...
    @property
    def headings(self) -> int: ...
    @property
    def sign(self) -> float: ...
    @property
    def travel(self) -> float: ...
    @property
    def longest(self) -> float: ...

def spread(scene: Scene, begin: FloatArray, steps: Steps, other: FloatArray, slots: int) -> tuple[int, IntArray]:
    """Find the cells that can be reached, step by step, until there are no more.

    Args:
        scene: The body and what it must not touch.
        begin: (3,) position of the body's middle and heading to begin at, world; a cell's middle.
        steps: What a step can do.
        other: (3,) the like of the pose that is looked for.
        slots: Of the table of cells, a power of two; half as many cells are looked at.

    Returns:
        (end, cells): how it ended; (n, 3) column, row and heading of the cells found.

    Raises:
        ValueError: On another number of slots.
    """
