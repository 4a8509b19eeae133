"""What was found: intervals of the unknown numbers, and which of them the data do not determine."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pushplan.sim.identify.unknowns import Unknown, Unknowns
from pushplan.util.arrays import FloatArray

LEVEL = 0.9
"""Share of the intervals that hold the truth."""
ROUGH = 50.0
"""Independent samples of which a twentieth lies beyond an end of an interval, give or take 3 % of all."""
_SHORT = 0.5
"""Part of what was possible that an interval has to be shorter than; without data it is 0.9."""
_SAID = 0.15
"""A contact's friction that is only known to be more, or less, than something is worth saying from here on."""


@dataclass(frozen=True)
class Estimate:
    """One unknown number after the measurements.

    Attributes:
        unknown: Which.
        low: Lower end of the 90 % interval.
        median: Half of what is possible lies below.
        high: Upper end.
        determined: Whether the data say anything about it.
    """

    unknown: Unknown
    low: float
    median: float
    high: float
    determined: bool


@dataclass(frozen=True, eq=False)
class Identification:
    """What pushes tell about friction and loads.

    Attributes:
        unknowns: What was looked for.
        samples: (k, p) values that are possible, each as likely as the others.
        noise: Error of a measured position (m, in x and y each) and angle (rad), as the best prediction leaves it.
        worth: How many independent samples they are worth: below `ROUGH` the intervals' ends are rough.
        correlation: By how much errors that persist along a push widen the intervals, >= 1: those of the model do.
    """

    unknowns: Unknowns
    samples: FloatArray
    noise: tuple[float, float]
    correlation: float
    worth: float

    @cached_property
    def estimates(self) -> tuple[Estimate, ...]:
        """All unknowns with their intervals."""
        return tuple(self._estimate(k, one) for k, one in enumerate(self.unknowns.each))

    def _estimate(self, k: int, one: Unknown) -> Estimate:
        low, median, high = np.quantile(self.samples[:, k], [0.5 - LEVEL / 2, 0.5, 0.5 + LEVEL / 2])
        ends = _place(one, np.array([low, high]))
        one_sided = one.kind == "contact_friction" and bool(ends[0] > _SAID or ends[1] < 1.0 - _SAID)
        determined = one_sided or bool(ends[1] - ends[0] < _SHORT)
        return Estimate(one, float(low), float(median), float(high), determined)

    @property
    def friction_spans(self) -> FloatArray:
        """(n, 2) 90 % intervals of the objects' coefficients of floor friction, with their masses as stated."""
        objects = self.unknowns.world.chain.objects
        coefficients = np.array([obj.floor_friction / obj.friction_load for obj in objects])
        found = coefficients * self.unknowns.friction_loads(self.samples)
        return np.asarray(np.quantile(found, [0.5 - LEVEL / 2, 0.5 + LEVEL / 2], axis=0).T)

    def load_spans(self, i: int) -> FloatArray:
        """Return the 90 % intervals (k, 2) of the part of object i's weight on each of its points."""
        chosen = self.samples[:: max(1, len(self.samples) // 400)]
        loads = np.array([self.unknowns.fractions(values)[i] for values in chosen])
        return np.asarray(np.quantile(loads, [0.5 - LEVEL / 2, 0.5 + LEVEL / 2], axis=0).T)


def _place(one: Unknown, values: FloatArray) -> FloatArray:
    """Return where values are between the ends of an unknown, 0 to 1."""
    if one.logarithmic:
        return np.asarray(np.log(values / one.low) / np.log(one.high / one.low))
    return np.asarray((values - one.low) / (one.high - one.low))
