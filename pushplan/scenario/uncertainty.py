"""One line that makes every coefficient and load of a scenario the interval around it."""

from __future__ import annotations

from typing import Any, TypeVar

from pushplan.scenario.schema.objects import Contacts, Object, PlacedSupport
from pushplan.scenario.schema.scenario import StatedRoom
from pushplan.scenario.values.interval import Span

Room = TypeVar("Room", bound=StatedRoom)


def widened(file: Room) -> Room:
    """Return a file with the intervals that its `uncertainty` stands for; those that it states itself stay.

    A share s makes an interval [(1 - s) v, (1 + s) v] of a value v. What `load` does to a load that is not on feet is
    no interval of a number: see `pressure_shares`.
    """
    share = file.uncertainty
    floor = file.floor.model_copy(update={"friction": around(file.floor.friction, share.floor_friction)})
    pusher = {"friction": around(file.pusher.friction, share.contact_friction)}
    return file.model_copy(
        update={
            "floor": floor,
            "objects": tuple(_object(obj, file) for obj in file.objects),
            "contacts": _contacts(file.contacts, share.contact_friction),
            "pusher": file.pusher.model_copy(update=pusher),
        }
    )


def pressure_shares(file: StatedRoom) -> dict[str, float]:
    """Return by object the share by which its pressure may be off, of those that stand on a known pressure."""
    share = file.uncertainty.load
    known = (obj.name for obj in file.objects if not _on_feet(obj) and obj.support != "unknown")
    return dict.fromkeys(known, share) if share > 0.0 else {}


def around(value: float | Span, share: float, most: float = float("inf")) -> float | Span:
    """Return the interval around a number, up to `most`; an interval, or a number that is exact, as it is."""
    if isinstance(value, tuple) or share == 0.0:
        return value
    return (1.0 - share) * value, min((1.0 + share) * value, most)


def _object(obj: Object, file: StatedRoom) -> Object:
    share, update = file.uncertainty, dict[str, Any]()
    if obj.floor_friction is not None:
        update["floor_friction"] = around(obj.floor_friction, share.floor_friction)
    if _on_feet(obj):
        assert isinstance(obj.support, PlacedSupport)
        feet = tuple(
            (*foot[:2], *(around(f, share.load, 1.0) for f in foot[2:])) for foot in obj.support.feet or ()
        )
        update["support"] = obj.support.model_copy(update={"feet": feet})
    return obj.model_copy(update=update)


def _on_feet(obj: Object) -> bool:
    return isinstance(obj.support, PlacedSupport) and obj.support.feet is not None


def _contacts(contacts: Contacts, share: float) -> Contacts:
    between = tuple(
        pair.model_copy(update={"friction": around(pair.friction, share)}) for pair in contacts.between
    )
    friction = None if contacts.friction is None else around(contacts.friction, share)
    return contacts.model_copy(update={"friction": friction, "between": between})
