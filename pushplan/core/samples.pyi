"""Poses of the load between which pushes may lead: random ones, and descents that shorten whole sequences."""

from collections.abc import Sequence

from pushplan.core.pushes import PackedMode
from pushplan.util.arrays import FloatArray, IntArray, RandomState

def pushed_at_random(mode: PackedMode, pose: FloatArray, sense: float, state: RandomState) -> FloatArray:
    """Return where a random push by a contact brings a load at a pose (3,), or, with sense -1, brings it from."""

def descend(
    modes: Sequence[PackedMode],
    sequence: IntArray,
    ends: FloatArray,
    poses: FloatArray,
    scale: float,
    moves: int,
    state: RandomState,
) -> float:
    """Move the poses between pushes so that these get cheaper; return the sum of the pushes' costs.

    Args:
        modes: All contacts.
        sequence: (k,) contact of each push.
        ends: (2, 3) first and last pose of the load.
        poses: (k - 1, 3) between the pushes; changed.
        scale: Of the first moves, m.
        moves: Tried, at most.
        state: Of the random numbers.
    """

def random_descent(
    modes: Sequence[PackedMode],
    start: FloatArray,
    goals: FloatArray,
    firsts: IntArray,
    lasts: IntArray,
    most: int,
    changes: FloatArray,
    below: float,
    state: RandomState,
) -> FloatArray:
    """Draw a sequence of contacts and the poses between its pushes, and descend.

    Args:
        modes: All contacts.
        start: (3,) pose of the load.
        goals: (g, 3).
        firsts: Contacts that a first push can have.
        lasts: Likewise a last one.
        most: Pushes, at most.
        changes: (m, m) the least that changes of the contact cost.
        below: What the whole has to cost less than, m.
        state: Of the random numbers.

    Returns:
        The poses (k, 3) between the pushes; none where the sequence costs too much.
    """
