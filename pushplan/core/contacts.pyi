"""Contacts of chains whose loads are known: the floor's friction, what contacts transmit, how far it is from slip."""

from pushplan.util.arrays import ComplexArray, FloatArray, IntArray

ORDER: int
"""Highest power of |omega| radius / |v0| that the series keeps."""
REACH: float
"""Largest |omega| radius / |v0| at which the series is used: REACH^(ORDER + 1) is below rounding."""
TERMS: int
"""Numbers in a row of the series."""
UNIFORM: int
AFFINE: int
POINTS: int
"""Kinds of support."""

class PackedChain:
    """Objects and contacts in the chain frame.

    Attributes:
        objects: (n, 11) friction load mu N (N), anchor x, y, radius (m), density a and gradient b (2) of
            the base pressure of a unit weight, h mu (m), stiffness moments S_xx, S_xy, S_yy. The anchor is
            the centroid of a polygon, the stiffness centre of points.
        parts: (e, 5) polygon edges about the anchor: t_x, t_y, n . p, t . p and length, p being the first vertex;
            or points about the anchor: x, y, fraction of the weight, stiffness, 0.
        series: (5 n, TERMS) power series of the polygons (see `packed.series_coefficients`); zero for points.
        links: (n, 4) kind, first part, one past the last part, pushing object (an earlier one) or -1.
        rows: (n, 4, 3) unit facets g of the contacts, g . (f_x, f_y, m / length) > 0; (0, 4, 3) without contacts.
        length: Characteristic length of the chain, m.

    Raises:
        ValueError: On arrays that do not fit together.
    """

    def __init__(
        self,
        *,
        objects: FloatArray,
        parts: FloatArray,
        series: ComplexArray,
        links: IntArray,
        rows: FloatArray,
        length: float,
    ) -> None: ...
    @property
    def objects(self) -> FloatArray: ...
    @property
    def parts(self) -> FloatArray: ...
    @property
    def series(self) -> ComplexArray: ...
    @property
    def links(self) -> IntArray: ...
    @property
    def rows(self) -> FloatArray: ...
    @property
    def length(self) -> float: ...

def margins_of(packed: PackedChain, twists: FloatArray, floor: float = -2.0) -> FloatArray:
    """Return the smallest margin (k,) over the contacts at many body twists (k, 3) in the chain frame.

    It is in [-1, 1], > 0 exactly when the twist keeps all contacts, and 0 at the zero twist. As soon as a contact's
    margin is at most `floor`, that one is returned.
    """

def wrenches_of(packed: PackedChain, twists: FloatArray) -> FloatArray:
    """Return the wrenches (k, n, 3) that contacts transmit at many twists (k, 3): f_x, f_y (N), moment (N m) about 0.

    Only a twist's direction matters; the zero twist gives zero wrenches.
    """

def contact_margins_of(packed: PackedChain, wrenches: FloatArray) -> FloatArray:
    """Return the margins (k, n) of transmitted wrenches (k, n, 3), in [-1, 1]; 0 for no wrench."""

def facet_rows(facets: FloatArray, wrenches: FloatArray, length: float) -> tuple[FloatArray, FloatArray]:
    """Return the rows g . w (k, n, 4) of facets (n, 4, 3) and wrenches (k, n, 3), and the wrenches' sizes (k, n).

    Moments are divided by `length`, m.
    """

def object_wrenches_of(packed: PackedChain, twists: FloatArray) -> FloatArray:
    """Return the wrenches (k, 3) that move the first object at many twists (k, 3), none of them zero."""

def moved_wrenches_of(packed: PackedChain, twists: FloatArray, moves: FloatArray) -> FloatArray:
    """Return by how much each object's wrench (m, n, 3) changes where its load's centre is moved by (m, n, 2), m.

    Args:
        packed: The objects.
        twists: (m, 3) body twists with which they slide, none of them 0.
        moves: Beside what the friction of the object itself moves; in the chain frame.
    """

def inertia_per_object(
    table: tuple[FloatArray, FloatArray, FloatArray], twists: FloatArray, rates: FloatArray
) -> FloatArray:
    """Return the wrench (m, n, 3) that each object's inertia asks for, about the chain frame's origin.

    By Newton and Euler (m a(c), I domega/dt + c x m a(c)) with the acceleration of the centre of mass

        a(c) = dv/dt + domega/dt J c + omega J (v + omega J c).

    Args:
        table: An `InertiaTable`: masses (n,), centres (n, 2), moments of inertia (n,).
        twists: (m, 3) body twists V in the chain frame.
        rates: (m, 3) their time derivatives dV/dt.
    """

def sum_over_carried(per_object: FloatArray, pushers: IntArray) -> None:
    """Add to what each object has (m, n, 3) that of all objects that its contact carries.

    Args:
        per_object: Changed in place.
        pushers: (n,) the object that pushes each one, -1 for the plate.
    """
