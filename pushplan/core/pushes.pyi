"""Pushes of the load by one contact between two poses, and the straight ways to the contact and back."""

from pushplan.core.collision import Scene
from pushplan.util.arrays import BoolArray, FloatArray

ARCS: int
"""Of a push, at most: the settling one, and those of a word."""

class PackedMode:
    """A contact and the pushes that it can make.

    Attributes:
        families: (f, 3, 3) left, straight and right twists in the contact's chain frame; f is at most
            `problem.MOST_FAMILIES`.
        contact: (3,) pose of that frame in the load's.
        robot: (3,) pose of the robot's frame in that frame.
        settling: (3,) twist of the straight push that a push begins with.
        settle: Its length, m.
        approach: Length of the straight way to the contact, m.
        retreat: Length of the straight way back from it, m.
        clearance: What is kept from everything, m.
        faster: How much faster than a push's cost grows the origin of the load's frame moves, at most.
    """

    def __init__(
        self,
        families: FloatArray,
        contact: FloatArray,
        robot: FloatArray,
        settling: FloatArray,
        settle: float,
        approach: float,
        retreat: float,
        clearance: float,
        faster: float,
    ) -> None: ...
    @property
    def families(self) -> FloatArray: ...
    @property
    def contact(self) -> FloatArray: ...
    @property
    def robot(self) -> FloatArray: ...
    @property
    def settling(self) -> FloatArray: ...
    @property
    def settle(self) -> float: ...
    @property
    def approach(self) -> float: ...
    @property
    def retreat(self) -> float: ...
    @property
    def clearance(self) -> float: ...
    @property
    def faster(self) -> float: ...
    def robot_at(self, load: FloatArray, behind: float) -> FloatArray:
        """Return the robot's pose (3,) so far behind the contact, m, with the load at a pose (3,)."""

def word_costs(
    mode: PackedMode, starts: FloatArray, goals: FloatArray, sofar: FloatArray, left: FloatArray, below: float
) -> FloatArray:
    """Return what the cheapest pushes from loads at `starts` (n, 3) to `goals` (m, 3) cost, whatever is in the way.

    A pair is left out (infinite) that cannot be part of a plan which costs less than `below`, as what comes before
    the start costs at least `sofar` (n,) and what comes after the goal `left` (m,).
    """

def find_push(scene: Scene, mode: PackedMode, start: FloatArray, goal: FloatArray) -> tuple[float, FloatArray]:
    """Find the cheapest free push between two poses of the load.

    Args:
        scene: The chain with this contact in the room.
        mode: The contact.
        start: (3,) pose of the load.
        goal: Likewise.

    Returns:
        Its cost, m, infinite if there is none; and (ARCS, 4) the twists, in the contact's frame, and lengths.
    """

def settles(scene: Scene, mode: PackedMode, load: FloatArray) -> bool:
    """Return whether the settling push is free with the load at a pose (3,)."""

def approaches_are_free(robot: Scene, mode: PackedMode, loads: FloatArray, back: bool) -> BoolArray:
    """Return (k,) whether the straight way to the contact, or back from it, is free with the load at poses (k, 3)."""
