"""The room of a scenario: the workspace and the obstacles."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import shapely

from pushplan.util.arrays import FloatArray, frozen


@dataclass(frozen=True)
class Workspace:
    """The rectangle, in the world, that pusher and objects do not leave, m."""

    xmin: float
    xmax: float
    ymin: float
    ymax: float

    @property
    def outline(self) -> FloatArray:
        """(4, 2) its corners, counter-clockwise."""
        x, y = [self.xmin, self.xmax, self.xmax, self.xmin], [self.ymin, self.ymin, self.ymax, self.ymax]
        return np.stack([x, y], axis=1)


@dataclass(frozen=True, eq=False)
class PolygonObstacle:
    """A simple polygon that stands still.

    Attributes:
        outline: (v, 2) corners in the world, m, counter-clockwise.
        unknown: It stands for a part of a map of which nothing is known; it is drawn as such.
    """

    outline: FloatArray
    unknown: bool = False
    radius: ClassVar[float] = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "outline", frozen(self.outline, (None, 2), "outline of an obstacle"))

    @cached_property
    def core(self) -> shapely.Polygon:
        """What all of its points are no farther from than `radius`, in the world: itself."""
        return shapely.Polygon(self.outline)

    @cached_property
    def box(self) -> FloatArray:
        """(2, 2) lower left and upper right corner of the box around it, in the world, m."""
        return frozen([self.outline.min(axis=0), self.outline.max(axis=0)], (2, 2), "box")

    def document(self) -> dict[str, Any]:
        """Return it in the form that it has in a file."""
        return {"polygon": self.outline.tolist(), **({"unknown": "obstacle"} if self.unknown else {})}

    def __str__(self) -> str:
        """Say where it is."""
        return _obstacle_at(self.box.mean(axis=0))


@dataclass(frozen=True, eq=False)
class CircleObstacle:
    """A disc that stands still.

    Attributes:
        center: (2,) in the world, m.
        radius: m.
    """

    center: FloatArray
    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", frozen(self.center, (2,), "centre of an obstacle"))

    @cached_property
    def core(self) -> shapely.Point:
        """What all of its points are no farther from than `radius`, in the world: its centre."""
        return shapely.Point(self.center)

    @cached_property
    def box(self) -> FloatArray:
        """(2, 2) lower left and upper right corner of the box around it, in the world, m."""
        return frozen([self.center - self.radius, self.center + self.radius], (2, 2), "box")

    def document(self) -> dict[str, Any]:
        """Return it in the form that it has in a file."""
        return {"circle": self.radius, "center": self.center.tolist()}

    def __str__(self) -> str:
        """Say where it is."""
        return _obstacle_at(self.center)


def _obstacle_at(place: FloatArray) -> str:
    return f"the obstacle at ({place[0]:.2f}, {place[1]:.2f}) m"


Obstacle = PolygonObstacle | CircleObstacle
