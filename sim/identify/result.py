"""What was found: intervals of the unknown numbers, which of them the data determine, and a scenario with them."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from pushplan.mechanics.chain import PLATE
from pushplan.sim.identify.unknowns import Unknown, Unknowns
from pushplan.util.arrays import FloatArray
from pushplan.util.names import PUSHER

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


Document = dict[str, Any]

LOADS = ("border", "tilt", "foot")
"""Kinds of unknowns that the load under an object follows from."""


def piece_of(found: Identification) -> Document:
    """Return what the data determine, in the form of a scenario file: `contacts.between` and `objects`.

    Frictions are intervals; without measured forces floor frictions are those that go with the stated one of the
    first object. A load is one on points, the part of the weight on each an interval.
    """
    between = [_contact(found, one) for one in found.estimates if _told(one, "contact_friction")]
    objects = [_object(found, i) for i in range(len(found.unknowns.loads))]
    objects = [obj for obj in objects if len(obj) > 1]
    return {
        **({"objects": objects} if objects else {}),
        **({"contacts": {"between": between}} if between else {}),
    }


def with_learned(document: Mapping[str, Any], piece: Mapping[str, Any]) -> Document:
    """Return a scenario as plain data with what was learned in place of its numbers.

    Args:
        document: As `Scenario.resolved` returns it.
        piece: As `piece_of` returns it.
    """
    merged = deepcopy(dict(document))
    learned = {obj["name"]: obj for obj in piece.get("objects", ())}
    for obj in merged["objects"]:
        obj.update(learned.get(obj["name"], {}))
        if "support" in learned.get(obj["name"], {}):
            obj.pop("center_of_mass", None)  # it follows from the loads
    contacts = merged.setdefault("contacts", {})
    pairs = list(piece.get("contacts", {}).get("between", ()))
    new = [set(pair["objects"]) for pair in pairs]
    kept = [pair for pair in contacts.get("between") or () if set(pair["objects"]) not in new]
    contacts["between"] = [*kept, *pairs]
    return merged


def _told(one: Estimate, kind: str) -> bool:
    return one.unknown.kind == kind and one.determined


def _contact(found: Identification, one: Estimate) -> Document:
    chain = found.unknowns.world.chain
    contact = chain.contacts[one.unknown.of]
    pushing = PUSHER if contact.pusher == PLATE else chain.objects[contact.pusher].name
    return {"objects": [pushing, chain.objects[contact.pushed].name], "friction": _span(one.low, one.high)}


def _object(found: Identification, i: int) -> Document:
    learned: Document = {"name": found.unknowns.world.chain.objects[i].name}
    ratio = any(one.unknown.of == i and _told(one, "floor_ratio") for one in found.estimates)
    if ratio or (i == 0 and any(_told(one, "floor_friction") for one in found.estimates)):
        learned["floor_friction"] = _span(*found.friction_spans[i])
    if any(one.unknown.of == i and one.determined and one.unknown.kind in LOADS for one in found.estimates):
        points, spans = found.unknowns.loads[i].points, found.load_spans(i)
        feet = [
            [round(float(x), 6), round(float(y), 6), _span(low, high)]
            for (x, y), (low, high) in zip(points, spans, strict=True)
        ]
        learned["support"] = {"feet": feet}
    return learned


def _span(low: float, high: float) -> list[float]:
    """Return an interval to four digits, rounded outwards by less than what matters."""
    return [float(f"{low:.4g}"), float(f"{high:.4g}")]
