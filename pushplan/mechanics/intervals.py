"""Chains whose loads and frictions are only known to lie in intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pushplan.errors import PushplanError, SupportError
from pushplan.mechanics.chain import GRAVITY, Chain
from pushplan.mechanics.support import FRACTION_TOLERANCE, FeetSupport
from pushplan.util.arrays import FloatArray, frozen

Range = tuple[float, float]
"""Least and largest value."""


@dataclass(frozen=True, eq=False)
class IntervalChain:
    """A chain of which some numbers are intervals; every combination of values in them may be the real one.

    Attributes:
        chain: Everything that is known; its contacts have the lowest friction of their intervals.
        mass: (n, 2) least and largest mass of every object, kg.
        floor_friction: (n, 2) least and largest coefficient between every object and the floor.
        fractions: (k, 2) least and largest part of the weight on each foot, by the object's index.
        pressures: Share by which a known pressure may be off at any place, its total kept, by the object's index.
    """

    chain: Chain
    mass: FloatArray
    floor_friction: FloatArray
    fractions: Mapping[int, FloatArray]
    pressures: Mapping[int, float]

    @classmethod
    def from_ranges(
        cls,
        chain: Chain,
        mass: Mapping[str, Range] | None = None,
        floor_friction: Mapping[str, Range] | None = None,
        contact_friction: Mapping[str, Range] | None = None,
        fractions: Mapping[str, Sequence[Range]] | None = None,
        pressures: Mapping[str, float] | None = None,
    ) -> IntervalChain:
        """Return `chain` with intervals for some of its numbers, each by the object's name.

        Args:
            chain: Where no interval is given, its value holds.
            mass: kg, > 0.
            floor_friction: >= 0.
            contact_friction: >= 0; of the contact through which the object is pushed.
            fractions: One interval for each foot, with numbers between 0 and 1.
            pressures: From 0 to 1; of objects whose load is known, and not on feet.

        Raises:
            ChainError: If no object has a name.
            PushplanError: On an interval that is empty or outside what is allowed.
            SupportError: On fractions for an object without feet, for another number of feet, or that cannot
                sum to 1, and on a pressure's share for feet or an unknown load.
        """
        masses = [[obj.mass, obj.mass] for obj in chain.objects]
        frictions = [[obj.floor_friction, obj.floor_friction] for obj in chain.objects]
        for name, span in (mass or {}).items():
            masses[chain.index_of(name)] = _span(span, f"mass of {name!r}", least=1e-300)
        for name, span in (floor_friction or {}).items():
            frictions[chain.index_of(name)] = _span(span, f"floor friction of {name!r}")
        lowest = {
            chain.index_of(name): _span(span, f"contact friction of {name!r}")[0]
            for name, span in (contact_friction or {}).items()
        }
        contacts = tuple(replace(c, friction=lowest.get(k, c.friction)) for k, c in enumerate(chain.contacts))
        parts = {chain.index_of(name): _fractions(chain, name, s) for name, s in (fractions or {}).items()}
        shares = {chain.index_of(name): _share(chain, name, share) for name, share in (pressures or {}).items()}
        n = len(chain.objects)
        return cls(
            replace(chain, contacts=contacts),
            frozen(masses, (n, 2), "masses"),
            frozen(frictions, (n, 2), "floor frictions"),
            parts,
            shares,
        )

    def carried_by(self, chain: Chain) -> IntervalChain:
        """Return the intervals of the same objects, by their names, in a chain that is pushed from another face."""
        order = [self.chain.index_of(obj.name) for obj in chain.objects]
        fractions = {k: self.fractions[i] for k, i in enumerate(order) if i in self.fractions}
        pressures = {k: self.pressures[i] for k, i in enumerate(order) if i in self.pressures}
        return IntervalChain(chain, self.mass[order], self.floor_friction[order], fractions, pressures)

    @property
    def loads(self) -> FloatArray:
        """(n, 2) least and largest friction load mu m g of every object, N."""
        return np.asarray(self.floor_friction * self.mass * GRAVITY, dtype=np.float64)


def _span(span: Range, what: str, least: float = 0.0) -> list[float]:
    """Return an interval as a list.

    Raises:
        PushplanError: Unless `least` <= low <= high, both finite.
    """
    low, high = float(span[0]), float(span[1])
    if not (least <= low <= high and np.isfinite(high)):
        wanted = "0 < low <= high" if least > 0.0 else "0 <= low <= high"
        raise PushplanError(f"{what} is the interval ({low:.6g}, {high:.6g}); it must be finite with {wanted}")
    return [low, high]


def _fractions(chain: Chain, name: str, spans: Sequence[Range]) -> FloatArray:
    """Return the intervals (k, 2) of the load fractions of the feet of an object."""
    support = chain.objects[chain.index_of(name)].support
    if not isinstance(support, FeetSupport):
        raise SupportError(f"{name!r} does not stand on feet; only feet have load fractions")
    if len(spans) != len(support.positions):
        raise SupportError(f"{name!r} has {len(support.positions)} feet, but {len(spans)} intervals of fractions")
    values = np.array([_span(span, f"load fraction {j} of {name!r}") for j, span in enumerate(spans)])
    fractions_within(values, f" of {name!r}")
    return frozen(values, (None, 2), "load fractions")


def _share(chain: Chain, name: str, share: float) -> float:
    """Return the share by which the pressure under an object may be off."""
    support = chain.objects[chain.index_of(name)].support
    if isinstance(support, FeetSupport) or not support.known:
        raise SupportError(f"{name!r} has no known pressure that could be off; feet have load fractions")
    if not 0.0 <= share <= 1.0:
        raise PushplanError(f"the pressure under {name!r} is off by {share:.6g}; allowed: a share from 0 to 1")
    return float(share)


def fractions_within(spans: FloatArray, whose: str = "") -> FloatArray:
    """Return load fractions (k,) that sum to 1, at the same share of each of the intervals (k, 2).

    Raises:
        SupportError: If no fractions in the intervals sum to 1.
    """
    low, high = spans.sum(axis=0)
    if not low - FRACTION_TOLERANCE <= 1.0 <= high + FRACTION_TOLERANCE:
        raise SupportError(f"load fractions{whose} sum to between {low:.6g} and {high:.6g}; 1 must be possible")
    share = float(np.clip((1.0 - low) / (high - low), 0.0, 1.0)) if high > low else 0.0
    fractions = spans[:, 0] + share * (spans[:, 1] - spans[:, 0])
    return np.asarray(fractions / fractions.sum(), dtype=np.float64)
