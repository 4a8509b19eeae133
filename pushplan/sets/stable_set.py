"""Stable sets: the body twists of the pusher that keep every contact of a chain, under one interface.

A set is defined by its margin, a function of the twist's direction. Boundaries on the twist sphere, COR regions,
cones and radii follow from it by root finding.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from functools import cached_property, wraps
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import ArrayLike

from pushplan.errors import ExtensionError, PushplanError
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.sphere import POLE, Meridians, TurningRadii, by_direction, checked_twists, twists_at
from pushplan.sets.boundary import BoundaryProblem, RefinedMeridians, find_meridians, margin_peaks, refine_meridians
from pushplan.sets.cor import Window, cor_polygons
from pushplan.sets.intervals import inner_ends, maximise
from pushplan.util.arrays import BoolArray, FloatArray, IntArray, columns_of, frozen
from pushplan.util.naming import is_user_code, name_of, user_code

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry


class StableSet(ABC):
    """The twists that keep every contact, by one of the paper's algorithms.

    Attributes:
        chain: The pushed chain.
        name: Name of the algorithm: one of `names.STABLE_SETS`.
    """

    name: str

    def __init_subclass__(cls) -> None:
        """Add checks of results and errors to the methods of a user's set."""
        super().__init_subclass__()
        for method in ("__init__", "contact_margin_values", "margin_values"):
            if method in vars(cls) and is_user_code(cls):
                setattr(cls, method, _checked(cls, vars(cls)[method]))

    def __init__(self, chain: Chain) -> None:
        self.chain = chain
        self._meridians: dict[tuple[float, int], Meridians] = {}
        self._refined: dict[float, RefinedMeridians] = {}

    @property
    def loads_known(self) -> bool:
        """Whether the load distribution under every object is known, and with it the contact forces."""
        return self.chain.loads_known

    @abstractmethod
    def contact_margin_values(self, twists: FloatArray) -> FloatArray:
        """Return the margin (k, n) of each contact at checked twists (k, 3)."""

    def margin_values(self, twists: FloatArray, floor: float = -2.0) -> FloatArray:
        """Return the margins (k,) of checked twists (k, 3); results up to `floor` are upper bounds of the margin."""
        del floor
        return np.asarray(columns_of(self.contact_margin_values(twists)).min(axis=0), dtype=np.float64)

    def margin(self, twists: ArrayLike) -> FloatArray:
        """Return the margins (k,) of body twists (k, 3) in the chain frame, in [-1, 1]; stable where > 0.

        Raises:
            PushplanError: If twists are zero, not finite or not (k, 3).
        """
        return self._by_direction(self.margin_values, twists)

    def contains(self, twists: ArrayLike) -> BoolArray:
        """Return whether body twists (k, 3) in the chain frame are strictly stable, (k,)."""
        return self.margin(twists) > 0.0

    def contact_margins(self, twists: ArrayLike) -> FloatArray:
        """Return the margin (k, n) of each contact at body twists (k, 3) in the chain frame."""
        return self._by_direction(self.contact_margin_values, twists)

    def _by_direction(self, values: Callable[[FloatArray], FloatArray], twists: ArrayLike) -> FloatArray:
        return by_direction(values, checked_twists(twists), self.chain.characteristic_length)

    def meridians(self, minimum_margin: float = 0.0, count: int = 512) -> Meridians:
        """Return the stable intervals of latitude on `count` equally spaced meridians of the twist sphere.

        Args:
            minimum_margin: Margin that the ends of the intervals exceed.
            count: Number of longitudes, beginning at -pi.
        """
        if count < 1:
            raise PushplanError(f"count is {count}; it must be at least 1")
        key = float(minimum_margin), int(count)
        if key not in self._meridians:
            longitude = -np.pi + 2.0 * np.pi * np.arange(count) / count
            self._meridians[key] = self._find_meridians(longitude, key[0])
        return self._meridians[key]

    def refined_meridians(self, minimum_margin: float = 0.0) -> RefinedMeridians:
        """Return the stable intervals on meridians that are spaced as the boundary requires."""
        if minimum_margin not in self._refined:
            self._refined[minimum_margin] = self._refine_meridians(float(minimum_margin))
        return self._refined[minimum_margin]

    @cached_property
    def peaks(self) -> tuple[FloatArray, FloatArray]:
        """Local maxima of the margin: unit twists (m, 3) and their margins (m,)."""
        return margin_peaks(self.margin_values, self.chain.characteristic_length)

    def cor_region(self, sense: int = +1, window: Window | None = None) -> BaseGeometry:
        """Return the stable centres of rotation of one sense as a shapely geometry in the chain frame, m.

        Args:
            sense: +1 counter-clockwise, -1 clockwise.
            window: Window (xmin, ymin, xmax, ymax) that clips the region, m; None for four characteristic lengths
                around the origin. Regions reach to infinity if a translation is stable.
        """
        return cor_polygons(self.refined_meridians(), self.chain.characteristic_length, sense, window)

    def translation_cone(self, minimum_margin: float = 0.0) -> FloatArray | None:
        """Return the cone of stable translations as unit vectors [rightmost, leftmost] (2, 2); None if empty."""
        return translation_cone(self.margin_values, minimum_margin)

    def turning_radii(self, minimum_margin: float = 0.0) -> TurningRadii:
        """Return the smallest distance from the origin to a stable COR for each sense, m; inf if there is none."""
        meridians = self.refined_meridians(minimum_margin).meridians
        return turning_radii(meridians, self.chain.characteristic_length)

    def area(self) -> float:
        """Return the size of the set on the twist sphere, sr."""
        return sphere_area(self.refined_meridians())

    def _find_meridians(self, longitude: FloatArray, minimum: float) -> Meridians:
        return find_meridians(self._problem(minimum), longitude)

    def _refine_meridians(self, minimum: float) -> RefinedMeridians:
        return refine_meridians(self._problem(minimum))

    def _problem(self, minimum: float) -> BoundaryProblem:
        return BoundaryProblem(self.margin_values, self.chain.characteristic_length, minimum)


def _checked(kind: type[StableSet], method: Callable[..., Any]) -> Callable[..., Any]:
    """Return a method of a user's set with checks; errors and invalid results name the set."""

    @wraps(method)
    def checked(self: StableSet, *args: Any, **kwargs: Any) -> Any:
        with user_code("stable set", kind):
            values = method(self, *args, **kwargs)
            if method.__name__ == "__init__":
                return values
            array = np.asarray(values, dtype=np.float64)
        twists = args[0] if args else kwargs["twists"]
        contacts = (len(self.chain.contacts),) * (method.__name__ == "contact_margin_values")
        if array.shape != (len(twists), *contacts) or np.isnan(array).any():
            what = "NaN" if array.shape == (len(twists), *contacts) else f"an array {array.shape}"
            raise ExtensionError(
                f"the stable set {name_of(kind)} returns {what} from {method.__name__} for {len(twists)} twists and "
                f"{len(self.chain.contacts)} contacts; allowed: numbers {(len(twists), *contacts)}"
            )
        return array

    return checked


_DIRECTIONS = 720


def translation_cone(margin_values: Callable[[FloatArray], FloatArray], minimum: float) -> FloatArray | None:
    """Return unit directions [rightmost, leftmost] (2, 2) of the translations with margin > `minimum`.

    Each contact allows a convex cone of directions, so their intersection is one cone.
    """

    def excess(member: IntArray, lon: FloatArray) -> FloatArray:
        del member
        return margin_values(twists_at(lon, np.zeros_like(lon), 1.0)) - minimum

    lon = -np.pi + 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    step = lon[1] - lon[0]
    middle = lon[[int(np.argmax(excess(np.arange(len(lon)), lon)))]]
    best, value = maximise(excess, middle - step, middle + step, 0.0, 40)
    if value[0] <= 0.0:
        return None
    offsets = step * np.arange(1, _DIRECTIONS)
    ends = []
    for side in (-1.0, +1.0):
        ring = best[0] + side * offsets
        values = excess(np.arange(len(ring)), ring)
        first = int(np.argmax(values <= 0.0))
        inside = ring[first - 1] if first else best[0]
        f_inside = values[first - 1] if first else value[0]
        bracket = np.array([[inside, ring[first], f_inside, values[first]]])
        ends.append(float(inner_ends(excess, bracket)[0]))
    return frozen([[np.cos(end), np.sin(end)] for end in ends], (2, 2), "translation cone")


def turning_radii(meridians: Meridians, length: float) -> TurningRadii:
    """Return the smallest distance from the origin to a COR on meridians for each sense, m.

    `length` is the characteristic length, m.
    """
    highest = np.concatenate([[0.0], meridians.upper]).max()
    lowest = np.concatenate([[0.0], meridians.lower]).min()
    return TurningRadii(left=_radius(highest, length), right=_radius(-lowest, length))


def _radius(latitude: float, length: float) -> float:
    return length * max(float(np.tan(POLE - latitude)), 0.0) if latitude > 0.0 else np.inf


def sphere_area(refined: RefinedMeridians) -> float:
    """Return the solid angle of the twists on refined meridians, sr.

    Between refined meridians at a distance d, the boundary is a great circle from latitude a to b. The area between
    this great circle and the equator is 2 atan(tan(d / 2) sin((a + b) / 2) / cos((a - b) / 2)).
    """
    rows = refined.meridians
    first = np.append(np.searchsorted(rows.longitude, refined.longitude), len(rows))
    count, spacing = np.diff(first), np.diff(refined.longitude)
    gaps = np.flatnonzero(count[:-1] == count[1:])  # all other gaps are at most SMALLEST_GAP wide
    area = 0.0
    for j in range(count.max(initial=0)):
        k = gaps[count[gaps] > j]
        for end, sign in ((rows.upper, +1.0), (rows.lower, -1.0)):
            a, b = end[first[k] + j], end[first[k + 1] + j]
            height = np.sin(0.5 * (a + b)) / np.cos(0.5 * (a - b))
            area += sign * float(2.0 * np.arctan(np.tan(0.5 * spacing[k]) * height).sum())
    return area


_SHOWN_RADII = 2.2
"""Extent of the window to each side, as a multiple of the smallest turning radius."""
_SHOWN_RADIUS = 1.3
"""Extent of the window towards the tightest stable turn of the drive, as a multiple of its radius."""
_ASPECT = 0.7
"""Smallest ratio of the window's width and height."""
_PAD = 0.04


def default_window(chain: Chain, sets: Iterable[StableSet]) -> Window:
    """Return a window around the chain and the tightest turns to both sides, for all `sets` and the drive."""
    sets, drive = list(sets), chain.pusher.drive
    outlines = [body.outline for body in chain.bodies]
    radii = [each.turning_radii() for each in sets]
    left = [_SHOWN_RADII * r.left for r in radii if isfinite(r.left)]
    right = [_SHOWN_RADII * r.right for r in radii if isfinite(r.right)]
    turns = np.array([[0.0, max(left, default=0.0)], [0.0, -max(right, default=0.0)]])
    window = _around([*outlines, turns])
    wider, far = grown(window, 0.5), 2.0 * float(np.hypot(window[2] - window[0], window[3] - window[1]))
    for sense, line in zip((+1, -1), drive.turning_centres(far), strict=False):
        regions = [each.cor_region(sense, wider).intersection(shapely.LineString(line)) for each in sets]
        nearest = min((one.distance(shapely.Point(line[0])) for one in regions if not one.is_empty), default=0.0)
        outlines.append(line[0] + _SHOWN_RADIUS * nearest * (line[1] - line[0]) / np.hypot(*(line[1] - line[0])))
    return _around([*outlines, turns])


def _around(outlines: list[FloatArray]) -> Window:
    points = np.concatenate([np.atleast_2d(outline) for outline in outlines])
    low, high = points.min(axis=0), points.max(axis=0)
    width, height = (1.0 + 2.0 * _PAD) * (high - low)
    (x, y), width = 0.5 * (low + high), max(width, _ASPECT * height)
    return (float(x - width / 2), float(y - height / 2), float(x + width / 2), float(y + height / 2))


def grown(window: Window, share: float) -> Window:
    """Return the window with `share` of its width and height added on every side."""
    dx, dy = share * (window[2] - window[0]), share * (window[3] - window[1])
    return (window[0] - dx, window[1] - dy, window[2] + dx, window[3] + dy)
