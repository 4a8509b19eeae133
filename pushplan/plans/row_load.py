"""Loads of objects that stand apart in the scenario and are pushed flush, one in front of another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from pushplan.errors import ChainError
from pushplan.geometry import se2
from pushplan.geometry.polygon import find_touch
from pushplan.mechanics.chain import Chain, Contact
from pushplan.mechanics.faces import Place, Through, pushed_from, ways_through
from pushplan.mechanics.intervals import IntervalChain
from pushplan.plans.load import Link, Load
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import PlacedObject
from pushplan.util.arrays import FloatArray

Member = tuple[str, str]
"""Name of an object, and the face of it, in its own frame, through which it is pushed."""


def way_through(body: PlacedObject, face: str) -> Through:
    """Return a face of an object by its name.

    Raises:
        ChainError: When it has no such face.
    """
    outline = body.chain.objects[0].outline
    found = [way for way in ways_through(outline) if way.face == face]
    if len(found) != 1:
        known = ", ".join(way.face for way in ways_through(outline))
        raise ChainError(f"{body.chain.objects[0].name!r} has no face {face!r}; there are {known}")
    return found[0]


def row_load(scenario: Scenario, members: Sequence[Member]) -> Load:
    """Return the load of objects that stand flush in a row, their faces' middles on one another.

    Args:
        scenario: With a `row`.
        members: From the plate outward; the plate pushes at the middle of the first one's face.

    Raises:
        ChainError: When one has no such face, or nothing in front of it that could push the next one.
    """
    assert scenario.row is not None
    bodies = [scenario.bodies[name] for name, _ in members]
    ways = [way_through(body, face) for body, (_, face) in zip(bodies, members, strict=True)]
    first = _taken_alone(bodies[0], members[0][1])
    objects, contacts = [first.objects[0]], [first.contacts[0]]
    links = [Link(members[0][0], None, ways[0].face, 0.0)]
    for k in range(1, len(members)):
        name, before = members[k][0], members[k - 1][0]
        front = ways[k - 1].exit
        if front is None:
            raise ChainError(f"{before!r} has no face opposite to {ways[k - 1].face!r}: it cannot push {name!r}")
        touching = se2.compose(objects[-1].pose_chain, front)
        pose = se2.compose(touching, se2.inverse(ways[k].entry))
        objects.append(replace(bodies[k].chain.objects[0], pose_chain=pose))
        touch = find_touch(objects[-2].outline_chain, objects[-1].outline_chain)
        if touch is None or len(touch) != 1:
            raise ChainError(f"{before!r} does not touch {name!r} along one line there")
        contacts.append(Contact(touch[0][0], touch[0][1], scenario.row.friction[0], k, k - 1))
        links.append(Link(name, before, ways[k].face, 0.0))
    chain = Chain(tuple(objects), tuple(contacts), first.pusher)
    stated = [
        {**body.stated["objects"][0], "pose": place.tolist()}
        for body, place in zip(bodies, chain.places, strict=True)
    ]
    problem = replace(
        scenario.alone(members[0][0]),
        chain=chain,
        interval=_intervals(bodies, chain),
        contact_friction=None,
        pushes=None,
        stated={**bodies[0].stated, "objects": stated, "contacts": scenario.stated["contacts"]},
    )
    return Load(tuple(links), problem)


@lru_cache(maxsize=64)
def _taken_alone(body: PlacedObject, face: str) -> Chain:
    """Return an object with the plate at the middle of a face; all loads that begin with it begin so."""
    at = se2.compose(body.chain.places[0], way_through(body, face).entry)
    return pushed_from(body.chain, Place((0,), face, 0.0, at, at))


def _intervals(bodies: Sequence[PlacedObject], chain: Chain) -> IntervalChain | None:
    """Return the chain with the intervals of its objects; None when all of them are numbers."""
    if all(body.interval is None for body in bodies):
        return None
    mass, floor = list[FloatArray](), list[FloatArray]()
    fractions, pressures = dict[int, FloatArray](), dict[int, float]()
    for k, (body, obj) in enumerate(zip(bodies, chain.objects, strict=True)):
        interval = body.interval
        if interval is None:
            mass.append(np.array([obj.mass, obj.mass]))
            floor.append(np.array([obj.floor_friction, obj.floor_friction]))
            continue
        mass.append(interval.mass[0])
        floor.append(interval.floor_friction[0])
        if 0 in interval.fractions:
            fractions[k] = interval.fractions[0]
        if 0 in interval.pressures:
            pressures[k] = interval.pressures[0]
    return IntervalChain(chain, np.array(mass), np.array(floor), fractions, pressures)
