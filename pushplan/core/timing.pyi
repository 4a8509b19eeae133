"""Blended twists as pieces of quadratics of time, and bounds of what they use of their limits."""

from pushplan.util.arrays import FloatArray, IntArray

def step_sum(levels: FloatArray, centers: FloatArray, widths: FloatArray) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return the twist that passes through `levels`, one smooth step after the other.

    V(t) = V_0 + sum_j (V_j+1 - V_j) b_j(t), where b_j is a step from 0 to 1: a jump at its centre, averaged over both
    of its windows. With `wider_steps`, a convex set that contains the levels contains V.

    Args:
        levels: (m + 1, 3) body twists.
        centers: (m,) times of the steps between them, never decreasing, s; at least one.
        widths: (m, 2) their long and short windows, s; those of a step between equal levels do not matter.

    Returns:
        Durations (q,) of the pieces, s; (q, 3, 3) coefficients of the twist from the beginning of each piece on,
        lowest order first; and (q,) the level that each belongs to, that of the last step that is over.

    Raises:
        ValueError: On other shapes.
    """

def wider_steps(centers: FloatArray, widths: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return which steps have to be wider (w,) for the levels' weights to stay positive, and within which bounds.

    Args:
        centers: (m,) times of the steps, s.
        widths: (m, 2) their long and short windows, s; zero where there is no step.

    Returns:
        Their indices (w,), and bounds (w, 2) on the first and the second derivative of a step from 0 to 1, 1/s and
        1/s^2, within which the fastest one is just wide enough.

    Raises:
        ValueError: On other shapes.
    """

def poses_after(start: FloatArray, coefficients: FloatArray, durations: FloatArray) -> FloatArray:
    """Return the poses (q + 1, 3) at the ends of pieces with twists `coefficients` (q, 3, 3), from `start` on."""

def limit_use(
    durations: FloatArray, coefficients: FloatArray, sides: FloatArray, jerk: float, angular_jerk: float
) -> FloatArray:
    """Return bounds on the share of its limits that each piece of a trajectory uses.

    Args:
        durations: (q,) of the pieces, s.
        coefficients: (q, 3, 3) of the twist, lowest order first.
        sides: (4, 2) limits of speed, acceleration, angular speed and angular acceleration, each where the quantity
            is negative and where it is not.
        jerk: Limit of the jerk, m/s^3.
        angular_jerk: Limit of the angular jerk, rad/s^3.

    Returns:
        (q, 3): of speed, acceleration and jerk, the larger of the linear and the angular share.
    """

def instants(durations: FloatArray, coefficients: FloatArray) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return twists and their rates (k, 3) where pieces begin and half-way, unless at rest, and (k,) which pieces."""

def contact_use(
    floor: tuple[FloatArray, FloatArray],
    inertia: tuple[FloatArray, FloatArray],
    steady: tuple[FloatArray, FloatArray],
    piece: IntArray,
    pieces: int,
    margin: float,
    room: float,
) -> tuple[FloatArray, FloatArray]:
    """Return what pieces use of their contacts.

    What inertia asks for at a steady twist stays when the twist changes more slowly; the rest shrinks in proportion.

    Args:
        floor: Rows (k, n, 4) and sizes (k, n) of what contacts transmit without inertia, N; see `Wrenches`.
        inertia: The like of what inertia adds.
        steady: The like of what it adds where the twist does not change.
        piece: (k,) pieces that the instants are on.
        pieces: How many pieces there are, q.
        margin: Share of the size that every row keeps.
        room: Share of what a row has to spare above that which inertia may use up.

    Returns:
        Shares (q,) of what there is to spare, 0 where nothing is known of; and (q,) the factor by which the same
        twists have to change more slowly for the contacts to hold.
    """
