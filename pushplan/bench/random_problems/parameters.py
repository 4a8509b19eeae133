"""What random push problems are like: the ranges that their numbers are drawn from."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pushplan.errors import PushplanError
from pushplan.util.names import MOST_FRICTION

SHAPES = ("box", "polygon")
SUPPORTS = ("uniform", "feet")
DRIVES = ("omnidirectional", "differential", "car")
OBSTACLE_SHAPES = ("box", "polygon", "circle")

MOST_OBJECTS = 8
MOST_OBSTACLES = 1000

Range = tuple[float, float]


class GeneratorError(PushplanError, ValueError):
    """Random problems cannot be made with these parameters."""


@dataclass(frozen=True)
class ProblemParameters:
    """Ranges (low, high), all inclusive, and words to choose from. SI units.

    Attributes:
        objects: Number of objects in the chain.
        shapes: Of the objects; polygons are convex with flush edges in front and behind.
        size: Length and width of an object, m.
        mass: Of an object, kg.
        supports: How loads rest on the floor.
        floor_friction: Coefficient.
        contact_friction: Coefficient, of each contact between objects.
        pusher_friction: Coefficient.
        drives: What the pusher can do.
        turning_radius: Chains can turn about centres this far to their left and right, m, or, where that takes
            too much (long chains before wheels), as near to it as a few tries give; workspace and obstacles are
            larger then, in proportion.
        workspace: Side of the square workspace, m.
        room: Length kept free ahead of the start and behind the goal, m.
        obstacles: Number of obstacles, at most: those that find no place are left out.
        obstacle_shapes: Of the obstacles.
        obstacle_size: Length and width of an obstacle, m.
        density: Share of the workspace that obstacles cover; no more are added once it is reached. None
            leaves it to the number.
        gap: Width of a gap in a wall between start and goal, in widths of the chain; None for no wall.
        robot: How far the robot stands from the chain at first, m; its plate has a body behind it, and the goal is
            reached by several pushes. None for one push, with the plate in contact.
    """

    objects: tuple[int, int] = (1, 5)
    shapes: tuple[str, ...] = SHAPES
    size: Range = (0.08, 0.2)
    mass: Range = (0.3, 3.0)
    supports: tuple[str, ...] = ("uniform",)
    floor_friction: Range = (0.2, 0.5)
    contact_friction: Range = (0.2, 0.5)
    pusher_friction: Range = (0.3, 0.7)
    drives: tuple[str, ...] = ("omnidirectional",)
    turning_radius: float = 1.0
    workspace: Range = (3.0, 4.0)
    room: float = 0.3
    obstacles: tuple[int, int] = (0, 30)
    obstacle_shapes: tuple[str, ...] = OBSTACLE_SHAPES
    obstacle_size: Range = (0.1, 0.4)
    density: Range | None = None
    gap: Range | None = None
    robot: Range | None = None

    def __post_init__(self) -> None:
        for name, low, high in _BOUNDS:
            self._check_range(name, low, high)
        for name, words in _WORDS:
            self._check_words(name, words)
        for name in ("turning_radius", "room"):
            value = getattr(self, name)
            if not (math.isfinite(value) and 0.0 < value <= 100.0):
                raise GeneratorError(f"{name} is {value!r}; allowed: a length above 0 m, up to 100 m")

    def _check_range(self, name: str, low: float, high: float) -> None:
        value = getattr(self, name)
        if value is None and name in ("density", "gap", "robot"):
            return
        if not (len(value) == 2 and low <= value[0] <= value[1] <= high):
            raise GeneratorError(f"{name} is {list(value)}; allowed: [low, high] from {low:g} to {high:g}")

    def _check_words(self, name: str, words: tuple[str, ...]) -> None:
        chosen = getattr(self, name)
        if not chosen or any(word not in words for word in chosen):
            raise GeneratorError(f"{name} is {list(chosen)}; allowed: one or more of {', '.join(words)}")


_BOUNDS: tuple[tuple[str, float, float], ...] = (
    ("objects", 1, MOST_OBJECTS),
    ("size", 0.01, 10.0),
    ("mass", 1e-3, 1e3),
    ("floor_friction", 1e-3, MOST_FRICTION),
    ("contact_friction", 0.0, MOST_FRICTION),
    ("pusher_friction", 0.0, MOST_FRICTION),
    ("workspace", 0.1, 1e3),
    ("obstacles", 0, MOST_OBSTACLES),
    ("obstacle_size", 0.005, 100.0),
    ("density", 0.0, 0.9),
    ("gap", 1.05, 100.0),
    ("robot", 0.05, 100.0),
)

_WORDS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("shapes", SHAPES),
    ("supports", SUPPORTS),
    ("drives", DRIVES),
    ("obstacle_shapes", OBSTACLE_SHAPES),
)
