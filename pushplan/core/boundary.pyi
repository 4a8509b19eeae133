"""The boundary of stable sets on and between meridians: brackets of ends, and where to look for them."""

from pushplan.util.arrays import BoolArray, FloatArray, IntArray

TOLERANCE: float
"""Width of the bracket in which a root is enclosed."""
FLATNESS: float
"""Largest angle by which the boundary may leave the great circle between neighbouring meridians, rad."""

_Table = tuple[FloatArray, IntArray, FloatArray, FloatArray]  # a `meridians.Table`
_Gaps = tuple[IntArray, IntArray, FloatArray]  # a `sets.boundary.Gaps`

class _Search:
    """Asks members (n,) of a family of functions at places (n,), until it is false."""

    @property
    def member(self) -> IntArray: ...
    @property
    def x(self) -> FloatArray: ...
    def take(self, values: FloatArray) -> None:
        """Take the values (n,) of what is asked now, and ask what comes next."""

    def __bool__(self) -> bool: ...

class RootSearch(_Search):
    """The last points with f > 0 on the way from the inside (f > 0) to the outside (f <= 0).

    ITP method (Oliveira & Takahashi 2020): superlinear on smooth functions, never worse than bisection by
    more than a few steps, jumps included.

    Args:
        brackets: (m, 4) places inside and outside, and the values there.
    """

    def __init__(self, brackets: FloatArray) -> None: ...
    @property
    def ends(self) -> FloatArray:
        """(m,) the innermost places that are known to be inside."""

class PeakSearch(_Search):
    """Golden-section searches of maxima; each stops once above `goal`.

    Args:
        low: (m,) where to begin.
        high: (m,) where to end.
        goal: Value that is enough.
        iterations: Most values asked for after the first two.
        ends: (m,) values at `low` and `high`. With them, a search is given up where a rise by 4 times what a concave
            function could still have would not reach the goal.
    """

    def __init__(
        self,
        low: FloatArray,
        high: FloatArray,
        goal: float,
        iterations: int,
        ends: tuple[FloatArray, FloatArray] | None = None,
    ) -> None: ...
    @property
    def best(self) -> tuple[FloatArray, FloatArray]:
        """The best places and the values there, (m,) each."""

def fans(table: _Table, gaps: _Gaps, chosen: IntArray) -> tuple[IntArray, FloatArray]:
    """Return gaps (k,) and latitudes (k,) around the intervals to both sides of chosen gaps, and the poles.

    A fan opens with the distance in longitude, as intervals may lean. Where gaps are wide, there are more.
    """

def probes(table: _Table, gaps: _Gaps, chosen: IntArray, wider: float) -> tuple[IntArray, FloatArray]:
    """Return gaps (k,) and latitudes (k,) that tell whether as many intervals as to both sides are as expected.

    They are, for each interval, outside and inside of its lower end, its middle, inside and outside of the upper one;
    and one between two intervals.
    """

def followed(x: FloatArray, value: FloatArray, member: IntArray) -> tuple[IntArray, FloatArray]:
    """Return the members (c,) of the intervals that are as expected, and brackets (c, 2, 4) of their ends.

    Args:
        x: (k,) latitudes; see `probes`.
        value: (k,) excess there.
        member: (k,) whose it is.
    """

def bends(table: _Table, gaps: _Gaps, found: _Table) -> tuple[FloatArray, BoolArray]:
    """Return the bends (g, c, 2) of meridians found in gaps, and in which gaps (g,) the boundary is not flat yet."""
