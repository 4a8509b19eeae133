"""Supports: the load distribution of an object on the floor, known or unknown.

All lengths are in metres in the object's own frame; pressures and loads are fractions of the object's weight.
"""

from __future__ import annotations

import csv
import io
import math
from abc import ABC, abstractmethod
from array import array
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely

from pushplan.errors import SupportError
from pushplan.geometry.polygon import AreaMoments, area_moments, convex_hull, simple_polygon
from pushplan.util.arrays import FloatArray, frozen

FRACTION_TOLERANCE = 1e-6
"""Largest error of the sum of the feet's load fractions."""

CELLS = 100
"""Number of squares with the area of a support; they define the grid of its cells."""

_ROUNDING = 1e-12


class PointLoads(NamedTuple):
    """A known load on k points.

    Attributes:
        positions: Points (k, 2), m.
        fractions: Fractions (k,) of the weight on each point, with sum 1.
        stiffness: Shares (k,) of each point in a load that a push above the floor shifts, with sum 1.
    """

    positions: FloatArray
    fractions: FloatArray
    stiffness: FloatArray


class Support(ABC):
    """Interface of mechanics and simulators to a load on the floor.

    A user's support model provides `center`, `hull` and, if its load is known, `point_loads`; everything else follows
    from these. A pressure on a whole polygon has a closed form in `mechanics.packed`.
    """

    @property
    @abstractmethod
    def center(self) -> FloatArray:
        """Centre of pressure (2,) of the object at rest, m."""

    @property
    def known(self) -> bool:
        """Whether the load distribution is known, and not only its centre."""
        return True

    @property
    @abstractmethod
    def hull(self) -> FloatArray:
        """Corners (h, 2) of the convex hull of all points that can carry load, counter-clockwise, m."""

    @property
    def carriers(self) -> tuple[FloatArray, bool]:
        """Points (k, 2) that can carry load, m, and whether the whole convex polygon with these corners can."""
        return self.hull, len(self.hull) > 2

    @property
    def point_loads(self) -> PointLoads:
        """The load on points, if it is exactly that.

        Raises:
            SupportError: If the load is not known, or is a pressure on a whole polygon.
        """
        raise SupportError("the load is not known, or is not on points")

    def cells(self) -> tuple[FloatArray, FloatArray]:
        """Return the load's centre (m, 2) in every cell of a coarse grid, m, and its part (m,) there, with sum 1.

        The grid is fine enough for the effect of small pressure errors. Few points are kept as they are, many are
        collected in cells. A polygon is cut into cells with their exact parts of the load.

        Raises:
            SupportError: If the load is not known.
        """
        positions, fractions, _ = self.point_loads
        return _gathered(positions, fractions)

    def lean(self, direction: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return e . (x - g) / h (k,) at corners or points x, and the load (k,) that it is a share of; see `leaning`.

        Raises:
            SupportError: If the load is not known.
        """
        if not self.known:
            raise SupportError("a load that is not known cannot be shifted to one side")
        positions = self.point_loads.positions
        return _scaled((positions - self.center) @ direction), np.ones(len(positions))

    def most_lean(self, direction: FloatArray) -> float:
        """Return the largest share of `leaning` at which no load is negative."""
        lean, headroom = self.lean(direction)
        lost = np.maximum(-lean, 0.0)
        return float(np.min(headroom[lost > 0.0] / lost[lost > 0.0], initial=np.inf))

    def leaning(self, direction: FloatArray, share: float) -> Support:
        """Return the load with p(x) + share e . (x - g) / h in place of p(x); its centre moves accordingly.

        h is the largest magnitude of e . (x - g), so that the outermost load changes by the share. On a polygon it is
        a share of the mean pressure, and g is the centroid. On points it is a share of each point's load, and g is
        their centre.
        A load on a line perpendicular to e does not change.

        Args:
            direction: Unit vector e (2,) in the object's own frame.
            share: Change of the outermost load, as a share; can be negative.

        Raises:
            SupportError: If the load is not known, or would be negative at a point.
        """
        lean, _ = self.lean(direction)
        positions, fractions, _ = self.point_loads
        return FeetSupport(positions, fractions * (1.0 + share * lean))


@dataclass(frozen=True, eq=False)
class UniformSupport(Support):
    """Uniform pressure on a polygon, or the affine pressure whose centre is the given centre of mass.

    The pressure is p(x) = a + b . (x - centroid) with a = 1 / area and
    b = (second moments)^-1 (center_of_mass - centroid).

    Attributes:
        outline: Simple polygon (v, 2), convex or not, m; stored counter-clockwise.
        center_of_mass: Centre of mass (2,), m; None for the centroid.

    Raises:
        SupportError: If the polygon is not simple, or the pressure would be negative at a point of it.
    """

    outline: FloatArray
    center_of_mass: FloatArray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "outline", simple_polygon(self.outline, "outline of the support"))
        if self.center_of_mass is not None:
            object.__setattr__(self, "center_of_mass", frozen(self.center_of_mass, (2,), "center of mass"))
        corners = 1.0 / self.moments.area + (self.outline - self.moments.centroid) @ self.gradient
        worst = int(np.argmin(corners))
        if corners[worst] * self.moments.area < -_ROUNDING:
            raise SupportError(
                f"an affine pressure with its centre at {_point(self.center)} would be negative at "
                f"{_point(self.outline[worst])} ({corners[worst] * self.moments.area:.3g} of the mean); "
                f"bring center_of_mass closer to the centroid {_point(self.moments.centroid)}"
            )

    @cached_property
    def moments(self) -> AreaMoments:
        """Area, centroid and second moments of the outline."""
        return area_moments(self.outline)

    @cached_property
    def gradient(self) -> FloatArray:
        """Gradient b (2,) of the pressure of a unit load, 1/m^3."""
        if self.center_of_mass is None:
            return np.zeros(2)
        offset = self.center_of_mass - self.moments.centroid
        return np.asarray(np.linalg.solve(self.moments.second, offset), dtype=np.float64)

    @property
    def center(self) -> FloatArray:
        """Centre of pressure (2,), m."""
        return self.moments.centroid if self.center_of_mass is None else self.center_of_mass

    @cached_property
    def hull(self) -> FloatArray:
        """Convex hull (h, 2) of the outline, m."""
        return convex_hull(self.outline)

    def cells(self) -> tuple[FloatArray, FloatArray]:
        """See `Support.cells`; exact for affine pressures."""
        x, y = _grid(self.outline, self.moments.area)
        west, south = np.meshgrid(x[:-1], y[:-1])
        east, north = np.meshgrid(x[1:], y[1:])
        boxes = shapely.box(west.ravel(), south.ravel(), east.ravel(), north.ravel())
        pieces = shapely.intersection(boxes, shapely.Polygon(self.outline))
        areas = shapely.area(pieces)
        kept = areas > 1e-9 * self.moments.area
        points = shapely.get_coordinates(shapely.centroid(pieces[kept]))
        loads = np.maximum(areas[kept] * self._relative_pressure(points), 0.0)
        return points, np.asarray(loads / loads.sum(), dtype=np.float64)

    def _relative_pressure(self, points: FloatArray) -> FloatArray:
        """Return the pressure (k,) at points (k, 2) as a share of the mean pressure."""
        return np.asarray(1.0 + self.moments.area * (points - self.moments.centroid) @ self.gradient)

    def lean(self, direction: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See `Support.lean`: shares of the mean pressure, at the corners."""
        arms = self.outline - self.moments.centroid
        return _scaled(arms @ direction), self._relative_pressure(self.outline)

    def leaning(self, direction: FloatArray, share: float) -> UniformSupport:
        """See `Support.leaning`."""
        reach = float(np.abs((self.outline - self.moments.centroid) @ direction).max())
        shift = share * self.moments.second @ direction / (self.moments.area * reach)
        return UniformSupport(self.outline, self.center + shift)


@dataclass(frozen=True, eq=False)
class FeetSupport(Support):
    """A load on points.

    Attributes:
        positions: Feet (k, 2), m.
        fractions: Fractions (k,) of the weight on each foot, > 0, with sum 1; None if unknown.
        center_of_mass: Centre of mass (2,), m; required if the fractions are unknown, and None otherwise.

    Raises:
        SupportError: If loads are not positive or do not sum to 1, if the centre is outside the feet, or if both or
            neither of `fractions` and `center_of_mass` are given.
    """

    positions: FloatArray
    fractions: FloatArray | None = None
    center_of_mass: FloatArray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "positions", frozen(self.positions, (None, 2), "positions of the feet"))
        if len(self.positions) == 0:
            raise SupportError("a support on feet needs at least one foot")
        if (self.fractions is None) == (self.center_of_mass is None):
            raise SupportError("feet need either the load fraction of each foot or center_of_mass, not both")
        if self.fractions is not None:
            object.__setattr__(self, "fractions", _fractions(self.fractions, len(self.positions)))
        if self.center_of_mass is not None:
            object.__setattr__(self, "center_of_mass", frozen(self.center_of_mass, (2,), "center of mass"))
            _require_inside(self.center_of_mass, self.hull, "the convex hull of the feet")

    @property
    def center(self) -> FloatArray:
        """Centre of the load (2,), m."""
        if self.fractions is not None:
            return self.fractions @ self.positions
        assert self.center_of_mass is not None  # __post_init__ has checked this
        return self.center_of_mass

    @property
    def known(self) -> bool:
        """Whether the load fractions are given."""
        return self.fractions is not None

    @cached_property
    def hull(self) -> FloatArray:
        """Convex hull (h, 2) of the feet, m."""
        return convex_hull(self.positions)

    @property
    def carriers(self) -> tuple[FloatArray, bool]:
        """The feet, without the area between them."""
        return self.positions, False

    @property
    def point_loads(self) -> PointLoads:
        """The feet, which share a shifting load equally."""
        if self.fractions is None:
            return super().point_loads
        return PointLoads(self.positions, self.fractions, np.full(len(self.positions), 1.0 / len(self.positions)))


@dataclass(frozen=True, eq=False)
class PressureMapSupport(Support):
    """A measured pressure distribution as many points with loads.

    Attributes:
        points: Points (k, 2), m.
        fractions: Fractions (k,) of the weight on each point, > 0, with sum 1.
    """

    points: FloatArray
    fractions: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", frozen(self.points, (None, 2), "points of the pressure map"))
        if len(self.points) == 0:
            raise SupportError("a pressure map needs at least one point")
        object.__setattr__(self, "fractions", _fractions(self.fractions, len(self.points)))

    @classmethod
    def from_bytes(cls, data: bytes, path: str) -> PressureMapSupport:
        """Read a CSV table with the columns x, y (m) and pressure (any unit, >= 0); `path` is its name in messages.

        Every row represents the same area, and the pressures are scaled to the sum 1. Rows with pressure 0 are
        ignored.

        Raises:
            SupportError: If a value is invalid; the message has file and line.
        """
        rows = parse_pressure_map(data, path)
        loaded = rows[rows[:, 2] > 0.0]
        if len(loaded) == 0:
            raise SupportError(f"{path}: no row has a pressure > 0")
        return cls(loaded[:, :2], loaded[:, 2] / loaded[:, 2].sum())

    @property
    def center(self) -> FloatArray:
        """Centre of pressure (2,), m."""
        return self.fractions @ self.points

    @cached_property
    def hull(self) -> FloatArray:
        """Convex hull (h, 2) of the loaded points, m."""
        return convex_hull(self.points)

    @property
    def point_loads(self) -> PointLoads:
        """The points, which share a shifting load in proportion to their own."""
        return PointLoads(self.points, self.fractions, self.fractions)

    def leaning(self, direction: FloatArray, share: float) -> PressureMapSupport:
        """See `Support.leaning`."""
        return PressureMapSupport(self.points, self.fractions * (1.0 + share * self.lean(direction)[0]))


@dataclass(frozen=True, eq=False)
class UnknownSupport(Support):
    """Any pressure on a polygon that has the given centre.

    Attributes:
        outline: Simple polygon (v, 2), m; stored counter-clockwise.
        center_of_mass: Centre of mass (2,), m; None for the centroid of the outline.

    Raises:
        SupportError: If the polygon is not simple, or the centre is outside its convex hull.
    """

    outline: FloatArray
    center_of_mass: FloatArray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "outline", simple_polygon(self.outline, "outline of the support"))
        if self.center_of_mass is not None:
            object.__setattr__(self, "center_of_mass", frozen(self.center_of_mass, (2,), "center of mass"))
            _require_inside(self.center_of_mass, self.hull, "the convex hull of the support")

    @cached_property
    def center(self) -> FloatArray:
        """Centre of pressure (2,), m."""
        return area_moments(self.outline).centroid if self.center_of_mass is None else self.center_of_mass

    @property
    def known(self) -> bool:
        """Always False."""
        return False

    @cached_property
    def hull(self) -> FloatArray:
        """Convex hull (h, 2) of the outline, m."""
        return convex_hull(self.outline)


def _gathered(points: FloatArray, fractions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the centres and loads of points (k, 2) by cells of a grid; few points are returned unchanged."""
    if len(points) <= CELLS:
        return points, fractions
    x, y = _grid(points, float(np.prod(np.ptp(points, axis=0))))
    columns = np.clip(np.searchsorted(x, points[:, 0], side="right") - 1, 0, len(x) - 2)
    rows = np.clip(np.searchsorted(y, points[:, 1], side="right") - 1, 0, len(y) - 2)
    _, cell = np.unique(rows * len(x) + columns, return_inverse=True)
    loads = np.bincount(cell, fractions)
    sums = np.stack([np.bincount(cell, fractions * points[:, d]) for d in (0, 1)], axis=1)
    return sums / loads[:, None], np.asarray(loads, dtype=np.float64)


def _grid(points: FloatArray, area: float) -> tuple[FloatArray, FloatArray]:
    """Return the lines x (m,) and y (n,) of a grid of nearly square cells that covers points (k, 2)."""
    low, size = points.min(axis=0), np.ptp(points, axis=0)
    side = max(float(np.sqrt(area / CELLS)), float(size.max()) / 400)
    counts = np.maximum(np.ceil(size / side), 1.0).astype(np.int64)
    x, y = (low[d] + size[d] * np.arange(counts[d] + 1) / counts[d] for d in (0, 1))
    return x, y


def _scaled(along: FloatArray) -> FloatArray:
    """Return coordinates (k,) as shares of the largest one; 0 if all coordinates are 0."""
    reach = float(np.abs(along).max())
    return along / reach if reach > 1e-9 else np.zeros_like(along)


def _point(point: FloatArray) -> str:
    return f"({point[0]:.6g}, {point[1]:.6g})"


def _fractions(fractions: FloatArray, count: int) -> FloatArray:
    """Return `fractions` checked and scaled to a sum of exactly 1."""
    values = frozen(fractions, (count,), "load fractions")
    if (values <= 0.0).any():
        raise SupportError(f"load fraction {values.min():.6g} of point {values.argmin()} must be > 0")
    total = float(values.sum())
    if abs(total - 1.0) > FRACTION_TOLERANCE:
        raise SupportError(f"load fractions sum to {total:.9g}; they must sum to 1")
    return frozen(values / total, (count,), "load fractions")


def _require_inside(point: FloatArray, hull: FloatArray, name: str) -> None:
    """Raise SupportError if `point` is outside the convex `hull` by more than rounding errors."""
    distance = shapely.MultiPoint(hull).convex_hull.distance(shapely.Point(point))
    if distance > 1e-12 * float(np.abs(hull).max()):
        raise SupportError(f"center_of_mass {_point(point)} is outside {name}")


def parse_pressure_map(data: bytes, path: str) -> FloatArray:
    """Return the (k, 3) rows x (m), y (m), pressure (>= 0) of a CSV file with those three named columns.

    Raises:
        SupportError: If a value is invalid; the message has `path` and line.
    """
    try:
        reader = csv.reader(io.StringIO(data.decode("utf-8"), newline=""))
        header = [cell.strip().lower() for cell in next(filter(None, reader), [])]
    except (UnicodeDecodeError, csv.Error) as error:
        raise SupportError(f"{path}: cannot read the pressure map: {error}") from error
    if sorted(header) != ["pressure", "x", "y"]:
        raise SupportError(f"{path}:1: the header is {','.join(header)!r}; it must name x, y and pressure")
    order = [header.index(name) for name in ("x", "y", "pressure")]
    numbers = array("d")  # a list of lists takes 600 MB for a map of 16 MB
    try:
        for cells in filter(None, reader):
            numbers.extend(_map_row(path, reader.line_num, cells, order))
    except csv.Error as error:
        raise SupportError(f"{path}: cannot read the pressure map: {error}") from error
    return np.array(numbers, dtype=np.float64).reshape(-1, 3)


def _map_row(path: str, number: int, cells: list[str], order: list[int]) -> list[float]:
    if len(cells) != 3:
        raise SupportError(f"{path}:{number}: {len(cells)} cells; there must be 3 (x, y, pressure)")
    try:
        values = [float(cells[i]) for i in order]
    except ValueError as error:
        raise SupportError(f"{path}:{number}: {error}") from error
    if not all(map(math.isfinite, values)) or values[2] < 0.0:
        raise SupportError(f"{path}:{number}: x, y and pressure must be finite and pressure >= 0: {values}")
    return values
