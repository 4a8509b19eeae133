"""Which loads and floor frictions of a scenario are intervals, and what cannot take them."""

from __future__ import annotations

from pushplan.mechanics.chain import Chain
from pushplan.mechanics.worst_case.interval_chain import IntervalChain
from pushplan.scenario.schema.objects import Object, PlacedSupport
from pushplan.scenario.schema.scenario import StatedRoom
from pushplan.scenario.uncertainty import pressure_shares, widened
from pushplan.scenario.values.interval import Span


def make_interval_chain(file: StatedRoom, chain: Chain) -> IntervalChain | None:
    """Return the chain with the intervals of a file, None when loads and floor frictions are numbers.

    They are those that it states and those that its `uncertainty` stands for.

    Intervals of contact friction are not looked at: the chain has their lowest values, and these decide.
    """
    pressures = pressure_shares(file)
    file = widened(file)
    masses = {obj.name: obj.mass for obj in file.objects if isinstance(obj.mass, tuple)}
    stated = {obj.name: stated_floor_friction(obj, file) for obj in file.objects}
    frictions = {name: value for name, value in stated.items() if isinstance(value, tuple)}
    fractions = {obj.name: spans for obj in file.objects if (spans := foot_spans(obj.support)) is not None}
    if not (masses or frictions or fractions or pressures):
        return None
    return IntervalChain.from_ranges(chain, masses, frictions, None, fractions, pressures)


def stated_floor_friction(obj: Object, file: StatedRoom) -> float | Span:
    """Return the friction between an object and the floor."""
    return file.floor.friction if obj.floor_friction is None else obj.floor_friction


def foot_spans(support: object) -> list[Span] | None:
    """Return the interval of every foot's load fraction, or None when none of them is an interval."""
    if not isinstance(support, PlacedSupport) or support.feet is None:
        return None
    loads = [foot[2] for foot in support.feet if len(foot) == 3]
    if not any(isinstance(load, tuple) for load in loads):
        return None
    return [load if isinstance(load, tuple) else (load, load) for load in loads]
