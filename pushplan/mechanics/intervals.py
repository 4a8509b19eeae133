"""Chains with intervals of loads and frictions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pushplan.errors import PushplanError, SupportError
from pushplan.mechanics.chain import GRAVITY, Chain
from pushplan.mechanics.support import FRACTION_TOLERANCE, FeetSupport
from pushplan.util.arrays import FloatArray, frozen

Range = tuple[float, float]
"""Lowest and highest value."""


@dataclass(frozen=True, eq=False)
class IntervalChain:
    """A chain in which some numbers are intervals; every combination of their values is possible.

    Attributes:
        chain: Chain with nominal values; its contacts have the lowest friction of their intervals.
        mass: Lowest and highest masses (n, 2) of the objects, kg.
        floor_friction: Lowest and highest friction coefficients (n, 2) between the objects and the floor.
        fractions: Lowest and highest fractions (k, 2) of the weight on each foot, by the object's index.
        pressures: Uncertainty of a known pressure at any point with a fixed total, as a share, by the object's index.
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
        """Return a chain with intervals for some of its numbers, each by the object's name.

        Args:
            chain: Chain with the values of all numbers without an interval.
            mass: Intervals of masses, kg, > 0.
            floor_friction: Intervals of floor friction coefficients, >= 0.
            contact_friction: Intervals of the friction of the contact that pushes the object, >= 0.
            fractions: Intervals of load fractions, one for each foot, between 0 and 1.
            pressures: Shares from 0 to 1, for objects with a known load that is not on feet.

        Raises:
            ChainError: If no object has a name.
            PushplanError: If an interval is empty or outside the allowed range.
            SupportError: If fractions are given for an object without feet or for another number of feet, or cannot
                sum to 1, or if a share is given for feet or an unknown load.
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
        """Return the intervals of the same objects, matched by name, in a chain that is pushed at another face."""
        order = [self.chain.index_of(obj.name) for obj in chain.objects]
        fractions = {k: self.fractions[i] for k, i in enumerate(order) if i in self.fractions}
        pressures = {k: self.pressures[i] for k, i in enumerate(order) if i in self.pressures}
        return IntervalChain(chain, self.mass[order], self.floor_friction[order], fractions, pressures)

    @property
    def loads(self) -> FloatArray:
        """Lowest and highest friction loads mu m g (n, 2) of the objects, N."""
        return np.asarray(self.floor_friction * self.mass * GRAVITY, dtype=np.float64)


def _span(span: Range, what: str, least: float = 0.0) -> list[float]:
    """Return an interval as a list.

    Raises:
        PushplanError: If not `least` <= low <= high, with both finite.
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
    """Return the uncertainty of the pressure under an object, as a share."""
    support = chain.objects[chain.index_of(name)].support
    if isinstance(support, FeetSupport) or not support.known:
        raise SupportError(f"{name!r} has no known pressure; for feet, give intervals of load fractions")
    if not 0.0 <= share <= 1.0:
        raise PushplanError(f"the uncertainty of the pressure under {name!r} is {share:.6g}; allowed: from 0 to 1")
    return float(share)


def fractions_within(spans: FloatArray, whose: str = "") -> FloatArray:
    """Return load fractions (k,) that sum to 1, all at the same relative position in their intervals (k, 2).

    Raises:
        SupportError: If no fractions in the intervals sum to 1.
    """
    low, high = spans.sum(axis=0)
    if not low - FRACTION_TOLERANCE <= 1.0 <= high + FRACTION_TOLERANCE:
        raise SupportError(f"the load fractions{whose} sum to {low:.6g} to {high:.6g}; a sum of 1 must be possible")
    share = float(np.clip((1.0 - low) / (high - low), 0.0, 1.0)) if high > low else 0.0
    fractions = spans[:, 0] + share * (spans[:, 1] - spans[:, 0])
    return np.asarray(fractions / fractions.sum(), dtype=np.float64)
