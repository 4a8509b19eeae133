"""The least of every contact condition over all that loads and frictions may be."""

from pushplan.core.contacts import PackedChain
from pushplan.util.arrays import BoolArray, FloatArray, IntArray

class PackedLoads:
    """The loads and contacts of n objects.

    Attributes:
        units: Those objects whose load is known, with a unit friction load.
        unit: (n,) where an object is among `units`, -1 where it is not.
        points: (p, 4) x, y (m), least and largest part of the load of what is uncertain on points.
        first: (n + 1,) where the points of each object begin.
        total: (n,) what the parts of an object's points sum to.
        miss: (n, 2) share, and part of the load, by which points miss what varies between them.
        centers: (n, 8) of objects of which only the centre is known: its place x, y (m), least shift h mu (m), the
            nudge that takes it off edges between loads (2), how much more the shift may be (m), and by how much the
            centre may be off along x and y (m).
        free: (n,) 0 for objects of other kinds, 1 for feet, 2 for a whole outline that carries the load.
        corners: (c, 2) feet, or corners of the convex outline, counter-clockwise, about that centre, m.
        corner: (n + 1,) where the corners of each object begin.
        centred: Whether of any object only the centre is known.
        loads: (n, 2) least and largest friction load of every object, N.
        carried: (n, n) whether contact k carries object i.
        facets: (n, 4, 3) unit facets g of the contacts, g . (f_x, f_y, m / length) > 0.
        length: Characteristic length of the chain, m.

    Raises:
        ValueError: On arrays that do not fit together.
    """

    def __init__(
        self,
        *,
        units: PackedChain,
        unit: IntArray,
        points: FloatArray,
        first: IntArray,
        total: FloatArray,
        miss: FloatArray,
        centers: FloatArray,
        free: IntArray,
        corners: FloatArray,
        corner: IntArray,
        centred: bool,
        loads: FloatArray,
        carried: BoolArray,
        facets: FloatArray,
        length: float,
    ) -> None: ...
    @property
    def points(self) -> FloatArray: ...
    @property
    def first(self) -> IntArray: ...
    @property
    def total(self) -> FloatArray: ...
    @property
    def free(self) -> IntArray: ...
    @property
    def carried(self) -> BoolArray: ...
    @property
    def facets(self) -> FloatArray: ...
    @property
    def length(self) -> float: ...
    def without_miss(self) -> PackedLoads:
        """Return the same with a `miss` of 0."""

def margins_of(packed: PackedLoads, twists: FloatArray, floor: float) -> FloatArray:
    """Return the smallest margins (m,) at many twists (m, 3), none 0; any number up to `floor` for smaller ones."""

def rows_of(packed: PackedLoads, twists: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the least rows (m, n, 4) and bounds of the wrenches (m, n), N, at many twists (m, 3), none of them 0."""

def sloped_rows_of(packed: PackedLoads, twists: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the same, and (m, n, 4, n) how much a metre by which an object's centre moves takes from a row, N/m."""

def forces_of(packed: PackedLoads, twists: FloatArray) -> FloatArray:
    """Return the forces (m, 3) that slide all objects together at twists (m, 3), none of them 0.

    Each is x, y in the middle of what it may be, and by how much it may differ at most, N. No load may be known by
    its centre alone.
    """

def inertia_forces_of(packed: PackedLoads, masses: FloatArray, known: FloatArray, pulls: FloatArray) -> FloatArray:
    """Return likewise the forces (m, 3) that inertia asks for; see `inertia_rows_of`."""

def inertia_rows_of(
    packed: PackedLoads, masses: FloatArray, known: FloatArray, pulls: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the least that inertia adds to the rows (m, n, 4), and its largest wrenches (m, n), N.

    The wrench of a mass point is a polynomial of its place, so that points miss next to nothing of it.

    Args:
        packed: The chain, nothing of it known by its centre alone, its `miss` 0.
        masses: (n, 2) least and largest, kg.
        known: (m, n, 3) that 1 kg of each object with a known load asks for, N, moments about the origin, N m.
        pulls: (m, p, 3) that 1 kg on each of the points asks for.
    """
