"""The outlines of stated shapes."""

from __future__ import annotations

from typing import Protocol

from pushplan.geometry.polygon import simple_polygon
from pushplan.scenario.arrangement.stacking import box_outline
from pushplan.util.arrays import FloatArray


class BoxOrPolygon(Protocol):
    """What a scenario file states of an object, a part of the robot, or an obstacle that is no circle."""

    @property
    def box(self) -> tuple[float, float] | None:
        """Length and width, m."""

    @property
    def polygon(self) -> tuple[tuple[float, float], ...] | None:
        """Corners, m."""


def outline_of(stated: BoxOrPolygon) -> FloatArray:
    """Return the counter-clockwise outline (v, 2) of a box or polygon in its own frame, m."""
    return box_outline(*stated.box) if stated.box else simple_polygon(stated.polygon or (), "outline")
