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
    """Rectangle in the world that robot and objects stay in, m."""

    xmin: float
    xmax: float
    ymin: float
    ymax: float

    @property
    def outline(self) -> FloatArray:
        """Corners (4, 2), counter-clockwise."""
        x, y = [self.xmin, self.xmax, self.xmax, self.xmin], [self.ymin, self.ymin, self.ymax, self.ymax]
        return np.stack([x, y], axis=1)


@dataclass(frozen=True, eq=False)
class PolygonObstacle:
    """A fixed simple polygon.

    Attributes:
        outline: Corners (v, 2) in the world, m, counter-clockwise.
        unknown: Whether it is an unknown part of a map, which is drawn differently.
    """

    outline: FloatArray
    unknown: bool = False
    radius: ClassVar[float] = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "outline", frozen(self.outline, (None, 2), "outline of an obstacle"))

    @cached_property
    def core(self) -> shapely.Polygon:
        """Geometry in the world that `radius` inflates to the obstacle: the polygon itself."""
        return shapely.Polygon(self.outline)

    @cached_property
    def box(self) -> FloatArray:
        """Lower left and upper right corner (2, 2) of the bounding box in the world, m."""
        return frozen([self.outline.min(axis=0), self.outline.max(axis=0)], (2, 2), "box")

    def document(self) -> dict[str, Any]:
        """Return the obstacle in the form of a scenario file."""
        return {"polygon": self.outline.tolist(), **({"unknown": "obstacle"} if self.unknown else {})}

    def __str__(self) -> str:
        """Return a noun phrase with the obstacle's position."""
        return _obstacle_at(self.box.mean(axis=0))


@dataclass(frozen=True, eq=False)
class CircleObstacle:
    """A fixed disc.

    Attributes:
        center: Centre (2,) in the world, m.
        radius: Radius, m.
    """

    center: FloatArray
    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", frozen(self.center, (2,), "centre of an obstacle"))

    @cached_property
    def core(self) -> shapely.Point:
        """Geometry in the world that `radius` inflates to the obstacle: the centre."""
        return shapely.Point(self.center)

    @cached_property
    def box(self) -> FloatArray:
        """Lower left and upper right corner (2, 2) of the bounding box in the world, m."""
        return frozen([self.center - self.radius, self.center + self.radius], (2, 2), "box")

    def document(self) -> dict[str, Any]:
        """Return the obstacle in the form of a scenario file."""
        return {"circle": self.radius, "center": self.center.tolist()}

    def __str__(self) -> str:
        """Return a noun phrase with the obstacle's position."""
        return _obstacle_at(self.center)


def _obstacle_at(place: FloatArray) -> str:
    return f"the obstacle at ({place[0]:.2f}, {place[1]:.2f}) m"


Obstacle = PolygonObstacle | CircleObstacle
