"""Loads: trees of objects in contact that the plate pushes, with their stable sets.

A load has two frames. The *plate frame* is the middle of the plate's front edge, +x along the push. The *contact
frame* is the chain frame of its push problem; stable sets, margins, contact limits and costs refer to it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from pushplan.errors import ChainError
from pushplan.geometry import se2
from pushplan.geometry.polygon import find_touch
from pushplan.mechanics.chain import PLATE, Chain, Contact
from pushplan.mechanics.faces import FacePair, Place, face_name, face_pairs, pushed_from
from pushplan.mechanics.intervals import IntervalChain
from pushplan.scenario.loads import PlacedLoad
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray, frozen

if TYPE_CHECKING:
    from pushplan.sets.stable_set import StableSet


@dataclass(frozen=True)
class Link:
    """An object in a load, with its pushing body.

    Attributes:
        object: Name of the object.
        pusher: Name of the object that pushes it; None for the plate.
        face: Name of the face at which it is pushed.
        offset: Offset of the pushing body's middle (of the plate, or of the object's frame) from the middle of the
            contact, to the left of the push, m; 0 in a row, where middles of faces meet.
    """

    object: str
    pusher: str | None
    face: str
    offset: float


@dataclass(frozen=True, eq=False)
class Load:
    """Objects that the plate pushes while every contact holds, as a tree.

    Attributes:
        links: Links, one per object, in the order of the chain.
        problem: Push problem of this load alone: its chain with intervals, and the settings. Its start, goal and
            obstacles do not belong to the load.
        sets: Cached stable sets of the load, by name.
    """

    links: tuple[Link, ...]
    problem: Scenario
    sets: dict[object, StableSet] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, problem: Scenario, face: str = "", offset: float | None = None) -> Load:
        """Return the load of a push problem.

        Args:
            problem: Push problem whose chain is the load.
            face: Name of the face that the plate pushes; if empty, computed from the contact.
            offset: Offset of the plate on this face, m; if None, computed from the contact.
        """
        chain = problem.chain
        links = []
        for i, contact in enumerate(chain.contacts):
            normal, middle = contact.normal, 0.5 * (contact.right + contact.left)
            by_plate = contact.pusher == PLATE
            if by_plate:
                origin, pusher = chain.pusher.plate_pose[:2], None
            else:
                other = chain.objects[contact.pusher]
                origin, pusher = other.pose_chain[:2], other.name
            named = face_name(math.atan2(-normal[1], -normal[0]))
            aside = float((origin - middle) @ contact.tangent)
            if by_plate and face:
                named = face
            if by_plate and offset is not None:
                aside = offset
            links.append(Link(chain.objects[i].name, pusher, named, aside))
        return cls(tuple(links), problem)

    @classmethod
    def pushed_from(cls, scenario: Scenario, chain: Chain, face: str, offset: float) -> Load:
        """Return the load of a scenario, pushed at another face.

        Args:
            scenario: Scenario with one load.
            chain: Its objects with the plate at that face; see `mechanics.faces.pushed_from`.
            face: Name of the face.
            offset: Offset of the plate's middle on the face, m.
        """
        own = scenario.load
        interval = None if own.interval is None else own.interval.carried_by(chain)
        pushed = replace(own, chain=chain, interval=interval, contact_friction=None)
        return cls.of(scenario.push_of(pushed, scenario.goal), face, offset)

    def of_twin(self, scenario: Scenario) -> Load:
        """Return the load of an object that differs from this load's single object only in name and pose.

        Both loads share their stable sets.
        """
        name, interval = scenario.chain.objects[0].name, self.problem.interval
        chain = replace(self.chain, objects=(replace(self.chain.objects[0], name=name),))
        interval = None if interval is None else replace(interval, chain=chain)
        pushed = replace(scenario.load, chain=chain, interval=interval, contact_friction=None)
        problem = scenario.push_of(pushed, scenario.goal)
        return Load((replace(self.links[0], object=name),), problem, self.sets)

    def with_problem(self, problem: Scenario) -> Load:
        """Return the same load for a push problem with other settings, start, goal or obstacles."""
        return Load(self.links, problem, self.sets)

    @property
    def chain(self) -> Chain:
        """Objects, contacts and pusher in the contact's frame."""
        return self.problem.chain

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the objects, from the plate outward."""
        return tuple(obj.name for obj in self.chain.objects)

    @property
    def faces(self) -> tuple[str, ...]:
        """Names of the faces at which the objects are pushed."""
        return tuple(link.face for link in self.links)

    @property
    def offsets(self) -> tuple[float, ...]:
        """Offsets of the pushing bodies, m; see `Link.offset`."""
        return tuple(link.offset for link in self.links)

    @property
    def face(self) -> str:
        """Name of the first object's face, which the plate pushes."""
        return self.links[0].face

    @property
    def offset(self) -> float:
        """Offset of the plate's middle from that of the face, to the left of the push, m."""
        return self.links[0].offset

    @cached_property
    def frame_plate(self) -> FloatArray:
        """(3,) pose of the contact frame in the plate frame."""
        return frozen(se2.inverse(self.chain.pusher.plate_pose), (3,), "pose of the contact's frame")

    @cached_property
    def places_plate(self) -> FloatArray:
        """(n, 3) poses of the objects' own frames in the plate frame."""
        return frozen(se2.compose(self.frame_plate, self.chain.places), (None, 3), "places of the objects")

    def poses(self, plate: FloatArray) -> dict[str, FloatArray]:
        """Return the objects' poses for a pose (3,) of the plate in the world, every contact closed."""
        return dict(zip(self.names, se2.compose(plate, self.places_plate), strict=True))

    def stable_set(self, name: str | None = None) -> StableSet:
        """Return the stable set for planning pushes of this load, see `judge.planning_set`; cached.

        Raises:
            PushplanError: If there is no such set.
        """
        from pushplan.plans.judge import planning_set  # imported late: it loads the compiled mechanics

        if name not in self.sets:
            self.sets[name] = planning_set(self.problem, name)
        return self.sets[name]

    def contact_name(self, name: str) -> str:
        """Return the name of the contact that pushes an object."""
        return self.chain.contact_name(self.names.index(name))


Member = tuple[str, str]
"""Name of an object and of the face, in its own frame, at which it is pushed."""


def way_through(body: PlacedLoad, face: str) -> FacePair:
    """Return a face of an object by its name.

    Raises:
        ChainError: If it has no such face.
    """
    outline = body.chain.objects[0].outline
    found = [way for way in face_pairs(outline) if way.face == face]
    if len(found) != 1:
        known = ", ".join(way.face for way in face_pairs(outline))
        raise ChainError(f"{body.chain.objects[0].name!r} has no face {face!r}; its faces are {known}")
    return found[0]


def row_load(scenario: Scenario, members: Sequence[Member]) -> Load:
    """Return the load of objects that stand flush in a row, with the middles of their faces together.

    Args:
        scenario: Scenario with a row goal.
        members: Objects and faces, from the plate outward; the plate pushes at the middle of the first face.

    Raises:
        ChainError: If an object has no such face, or no opposite face that could push the next object.
    """
    row = scenario.transport.row
    bodies = [scenario.task.by_name[name] for name, _ in members]
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
            raise ChainError(f"{before!r} and {name!r} do not touch along one line in the row")
        contacts.append(Contact(touch[0][0], touch[0][1], row.friction[0], k, k - 1))
        links.append(Link(name, before, ways[k].face, 0.0))
    chain = Chain(tuple(objects), tuple(contacts), first.pusher)
    stated = [
        {**body.stated["objects"][0], "pose": place.tolist()}
        for body, place in zip(bodies, chain.places, strict=True)
    ]
    alone, interval = scenario.alone(members[0][0]), _intervals(bodies, chain)
    whole = {**bodies[0].stated, "objects": stated, "contacts": scenario.transport.contacts}
    pushed = replace(bodies[0], chain=chain, interval=interval, contact_friction=None, stated=whole)
    return Load(tuple(links), alone.push_of(pushed, alone.goal))


@lru_cache(maxsize=64)
def _taken_alone(body: PlacedLoad, face: str) -> Chain:
    """Return the chain of a single object with the plate at the middle of a face; cached for the loads of rows."""
    at = se2.compose(body.chain.places[0], way_through(body, face).entry)
    return pushed_from(body.chain, Place((0,), face, 0.0, at, at))


def _intervals(bodies: Sequence[PlacedLoad], chain: Chain) -> IntervalChain | None:
    """Return the chain with the intervals of its objects; None if all values are numbers."""
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
