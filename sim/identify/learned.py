"""What was found as a piece of scenario, and a scenario with it."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from typing import Any

from pushplan.mechanics.chain import PLATE
from pushplan.sim.identify.identification import Estimate, Identification
from pushplan.util.names import PUSHER

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
