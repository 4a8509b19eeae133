"""The robot's way alone between two poses: a direct word, or trees from both ends (Kuffner and LaValle 2000)."""

from pushplan.core.driving import Surroundings, Wheels
from pushplan.util.arrays import FloatArray, RandomState

def find_transit(
    around: Surroundings,
    wheels: Wheels,
    start: FloatArray,
    goal: FloatArray,
    box: tuple[float, float, float, float],
    spread: float,
    state: RandomState,
    iterations: int,
) -> FloatArray | None:
    """Find a free way between two poses of the robot.

    Args:
        around: What not to touch.
        wheels: How the robot moves.
        start: (3,) pose.
        goal: (3,) pose.
        box: (xmin, ymin, xmax, ymax) of poses that are drawn.
        spread: How far from the ends others are drawn, m.
        state: Of the random numbers.
        iterations: Poses that are drawn, at most.

    Returns:
        The arcs (k, 4), none where both poses are the same; None if no way was found.
    """

def shortened(
    around: Surroundings, wheels: Wheels, start: FloatArray, arcs: FloatArray, state: RandomState, attempts: int
) -> FloatArray:
    """Join random pairs of places on a way (k, 4) anew where that is cheaper; return the arcs that it has then.

    Args:
        around: What not to touch.
        wheels: How the robot moves.
        start: (3,) pose.
        arcs: (k, 4) a free way from there.
        state: Of the random numbers.
        attempts: Pairs, at most.
    """
