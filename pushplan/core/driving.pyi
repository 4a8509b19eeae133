"""How the robot drives alone: shortest words of its wheels (Reeds-Shepp for a car), and what it must not touch."""

from enum import Enum

from pushplan.core.collision import Scene
from pushplan.util.arrays import FloatArray

class WheelKind(Enum):
    """What the wheels of a robot can do."""

    OMNIDIRECTIONAL = 0
    DIFFERENTIAL = 1
    CAR = 2

class Wheels:
    """How the robot can move alone.

    Attributes:
        kind: What its wheels can do.
        axle: (3,) pose in the robot's frame of the point that words are about: the axle's middle with +x forward;
            of an omnidirectional robot, its middle.
        radius: Smallest turning radius of the axle's middle, m (of a car only).
    """

    def __init__(self, kind: WheelKind, axle: FloatArray, radius: float) -> None: ...
    @property
    def kind(self) -> WheelKind: ...
    @property
    def axle(self) -> FloatArray: ...
    @property
    def radius(self) -> float: ...

class Surroundings:
    """What the robot must not touch when it drives alone.

    Attributes:
        room: The robot among what stands in the room.
        load: The robot among the objects, these in the frame of the load.
        place: (3,) pose of that frame in the world.
    """

    def __init__(self, room: Scene, load: Scene, place: FloatArray) -> None: ...
    @property
    def room(self) -> Scene: ...
    @property
    def load(self) -> Scene: ...
    @property
    def place(self) -> FloatArray: ...

def find_reeds_shepp(x: float, y: float, phi: float) -> list[tuple[FloatArray, FloatArray]]:
    """Return the words of a car that lead from the origin to a pose, in turning radii and rad (Reeds and Shepp 1990).

    Of each word its letters (k,), signs of the curvature: 1 left, 0 straight, -1 right; and their lengths (k,), < 0
    backwards.
    """

def find_drives(wheels: Wheels, start: FloatArray, goal: FloatArray) -> list[FloatArray]:
    """Return the arcs (k, 4) of every word between two poses (3,) of the robot, whatever is in the way."""

def shortest_drives(wheels: Wheels, starts: FloatArray, goals: FloatArray) -> FloatArray:
    """Return (n, m) costs of cheapest words from poses (n, 3) of the robot to poses (m, 3) in an empty room, m."""
