"""Pushes of the load by one contact between two poses, and the straight ways to the contact and back."""

from pushplan.core.collision import Scene
from pushplan.util.arrays import BoolArray, FloatArray, IntArray

ARCS: int
"""Of a push, at most: the settling one, and those of a word."""

class PackedMode:
    """A contact and the pushes that it can make.

    Attributes:
        families: (f, 3, 3) left, straight and right twists in the contact's chain frame; f is at most 3.
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

def push_costs(
    rooms: list[Scene],
    contacts: list[tuple[Scene, PackedMode]],
    start: FloatArray,
    goals: FloatArray,
    asked: BoolArray,
) -> FloatArray:
    """Return what single pushes cost from a pose of the load, with room for approach and retreat, (r, m, g), m.

    Args:
        rooms: r times the robot among what stands there.
        contacts: m times the chain with a contact in any room, and the contact.
        start: (3,) pose of the load.
        goals: (g, 3) likewise.
        asked: (m, g) which of them are looked for; the others cost infinitely much, as those that are not free.
    """

def find_passings(
    mode: PackedMode, load: FloatArray, inner: FloatArray, goals: FloatArray, within: FloatArray, far: float
) -> tuple[FloatArray, IntArray]:
    """Return where turns and straight pushes pass by goals, (k, 3) poses of the load, and by which, (k,) rows.

    Args:
        mode: The contact.
        load: (3,) pose that the pushes begin at.
        inner: (3,) pose in the load's frame of the frame that the goals are of.
        goals: (g, 3) poses of it.
        within: (2,) how far from a goal counts, m and rad.
        far: Length of each push, m; 400 poses along it are looked at, and the nearest to a goal is taken.
    """

def settles(scene: Scene, mode: PackedMode, load: FloatArray) -> bool:
    """Return whether the settling push is free with the load at a pose (3,)."""

def approaches_are_free(robot: Scene, mode: PackedMode, loads: FloatArray, back: bool) -> BoolArray:
    """Return (k,) whether the straight way to the contact, or back from it, is free with the load at poses (k, 3)."""
