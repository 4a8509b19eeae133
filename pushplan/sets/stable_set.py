"""Stable sets: the body twists of the pusher that keep every contact of a chain, under one interface.

A set is known by its margin, a function of the twist's direction; everything else (boundaries on the twist
sphere, COR regions, cones, radii) follows from it by root finding.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from pushplan.errors import PushplanError
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.sphere import Meridians, TurningRadii, by_direction, checked_twists
from pushplan.sets.boundary_following import RefinedMeridians, find_meridians, refine_meridians
from pushplan.sets.cor import Window, cor_polygons
from pushplan.sets.meridians import Asked, margin_peaks
from pushplan.sets.stable_extent import sphere_area, translation_cone, turning_radii
from pushplan.util.arrays import BoolArray, FloatArray, columns_of

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry


class StableSet(ABC):
    """The twists that keep every contact, by one of the paper's algorithms.

    Attributes:
        chain: The chain that is pushed.
        name: Which algorithm: one of `names.STABLE_SETS`.
    """

    name: str

    def __init__(self, chain: Chain) -> None:
        self.chain = chain
        self._remember()

    def _remember(self) -> None:
        self._meridians = lru_cache(maxsize=8)(self._equally_spaced)
        self._refined = lru_cache(maxsize=8)(self._refine_meridians)

    def __getstate__(self) -> dict[str, Any]:
        """Leave out what is remembered: it cannot be pickled, and is made again when it is asked for."""
        return {name: value for name, value in vars(self).items() if name not in ("_meridians", "_refined")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._remember()

    @property
    def loads_known(self) -> bool:
        """Whether the load distribution under every object is known, so that contact forces are."""
        return self.chain.loads_known

    @abstractmethod
    def contact_margin_values(self, twists: FloatArray) -> FloatArray:
        """Return the margin (k, n) of each contact at checked twists (k, 3)."""

    def margin_values(self, twists: FloatArray, floor: float = -2.0) -> FloatArray:
        """Return the margins (k,) of checked twists (k, 3); any number up to `floor` for smaller ones."""
        del floor
        return np.asarray(columns_of(self.contact_margin_values(twists)).min(axis=0), dtype=np.float64)

    def margin(self, twists: ArrayLike) -> FloatArray:
        """Return the margins (k,) of body twists (k, 3) in the chain frame, in [-1, 1]; stable where > 0.

        Raises:
            PushplanError: On twists that are zero, not finite or not (k, 3).
        """
        return self._by_direction(self.margin_values, twists)

    def contains(self, twists: ArrayLike) -> BoolArray:
        """Return (k,) whether body twists (k, 3) in the chain frame are strictly stable."""
        return self.margin(twists) > 0.0

    def contact_margins(self, twists: ArrayLike) -> FloatArray:
        """Return the margin (k, n) of each contact at body twists (k, 3) in the chain frame."""
        return self._by_direction(self.contact_margin_values, twists)

    def _by_direction(self, values: Callable[[FloatArray], FloatArray], twists: ArrayLike) -> FloatArray:
        return by_direction(values, checked_twists(twists), self.chain.characteristic_length)

    def meridians(self, minimum_margin: float = 0.0, count: int = 512) -> Meridians:
        """Return the stable intervals of latitude on `count` equally spaced meridians of the twist sphere.

        Args:
            minimum_margin: The margin exceeds it at every end returned.
            count: Number of longitudes, from -pi on.
        """
        if count < 1:
            raise PushplanError(f"count is {count}; it must be at least 1")
        return self._meridians(float(minimum_margin), int(count))

    def refined_meridians(self, minimum_margin: float = 0.0) -> RefinedMeridians:
        """Return the stable intervals on meridians as close together as the boundary needs."""
        return self._refined(float(minimum_margin))

    @cached_property
    def peaks(self) -> tuple[FloatArray, FloatArray]:
        """Local maxima of the margin: unit twists (m, 3) and their margins (m,)."""
        return margin_peaks(self.margin_values, self.chain.characteristic_length)

    def cor_region(self, sense: int = +1, window: Window | None = None) -> BaseGeometry:
        """Return the stable centres of rotation of one sense as a shapely geometry in the chain frame, m.

        Args:
            sense: +1 counter-clockwise, -1 clockwise.
            window: (xmin, ymin, xmax, ymax) to clip to, m; None stands for four characteristic lengths around
                the origin. Regions reach to infinity where a translation is stable.
        """
        return cor_polygons(self.refined_meridians(), self.chain.characteristic_length, sense, window)

    def translation_cone(self, minimum_margin: float = 0.0) -> FloatArray | None:
        """Return the stable translations as unit vectors [right-most, left-most] (2, 2), or None."""
        return translation_cone(self.margin_values, minimum_margin)

    def turning_radii(self, minimum_margin: float = 0.0) -> TurningRadii:
        """Return the smallest distance from the origin to a stable COR of either sense, m; inf for none."""
        meridians = self.refined_meridians(minimum_margin).meridians
        return turning_radii(meridians, self.chain.characteristic_length)

    def area(self) -> float:
        """Return the size of the set on the twist sphere, sr."""
        return sphere_area(self.refined_meridians())

    def _equally_spaced(self, minimum_margin: float, count: int) -> Meridians:
        return self._find_meridians(-np.pi + 2.0 * np.pi * np.arange(count) / count, minimum_margin)

    def _find_meridians(self, longitude: FloatArray, minimum: float) -> Meridians:
        return find_meridians(self._asked(minimum), longitude)

    def _refine_meridians(self, minimum: float) -> RefinedMeridians:
        return refine_meridians(self._asked(minimum))

    def _asked(self, minimum: float) -> Asked:
        return Asked(self.margin_values, self.chain.characteristic_length, minimum)
