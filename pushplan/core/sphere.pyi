"""Many places on the sphere of twist directions at once."""

from pushplan.util.arrays import FloatArray, IntArray

def directions(twists: FloatArray, length: float) -> tuple[IntArray, IntArray]:
    """Return the number of the direction that each twist (m, 3) has, (m,), and the first twist of each (d,).

    Neighbours whose components, as shares of the largest one, differ by at most 1e-12 have one direction.

    Args:
        twists: None of them zero.
        length: By which angular velocities are multiplied to be compared with the others, m.
    """

def twists_on(
    east: FloatArray, north: FloatArray, length: float, member: IntArray, latitude: FloatArray
) -> FloatArray:
    """Return the unit twists (k, 3) at latitudes (k,) of meridians `member` (k,), given by their directions (m,)."""

def neighbours(at: FloatArray, step: FloatArray, live: IntArray, turn: float) -> FloatArray:
    """Return unit vectors (8 m, 3) at angles `step` (k,) around those m of the unit vectors (k, 3) that are `live`.

    Args:
        at: Unit vectors.
        step: rad.
        live: (m,) indices.
        turn: Of the first neighbour's direction, rad.
    """

def move(
    at: FloatArray, values: FloatArray, step: FloatArray, live: IntArray, around: FloatArray, found: FloatArray
) -> None:
    """Go to the highest of the neighbours, or look closer.

    Args:
        at: (k, 3) unit vectors; changed in place, as `values` and `step`.
        values: (k,) at them.
        step: (k,) rad.
        live: (m,) indices of those that move.
        around: (8 m, 3) their neighbours.
        found: (8 m,) values at these.
    """
