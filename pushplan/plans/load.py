"""What the plate pushes: a tree of objects in contact, and what a stable set is made of.

A load has two frames. The *plate frame* is the middle of the plate's front edge, +x along the push. The *contact
frame* is the chain frame of its push problem: stable sets, margins, contact limits and costs refer to that one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

from pushplan.geometry import se2
from pushplan.mechanics.chain import PLATE, Chain
from pushplan.mechanics.faces import face_name
from pushplan.util.arrays import FloatArray, frozen

if TYPE_CHECKING:
    from pushplan.scenario.model import Scenario
    from pushplan.sets.stable_set import StableSet


@dataclass(frozen=True)
class Link:
    """An object in a load, and what pushes it.

    Attributes:
        object: Its name.
        pusher: Name of the object that pushes it; None stands for the plate.
        face: Of the object, through which it is pushed.
        offset: Of the pushing body's middle (the plate's, or the object's frame) from that of the face, to the left
            of the push, m.
    """

    object: str
    pusher: str | None
    face: str
    offset: float


@dataclass(frozen=True, eq=False)
class Load:
    """What the plate pushes while every contact holds: a tree of objects.

    Attributes:
        links: One for each object, in the order of the chain.
        problem: The push problem of this load alone: its chain with all that is uncertain about it, and the settings.
            Start, goal and what stands in the room do not belong to the load.
        sets: Stable sets of the load by what asked for them, made once.
    """

    links: tuple[Link, ...]
    problem: Scenario
    sets: dict[object, StableSet] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, problem: Scenario, face: str = "", offset: float | None = None) -> Load:
        """Return the load of a push problem.

        Args:
            problem: Its chain is the load.
            face: That the plate pushes; worked out from the contact where it is empty.
            offset: Of the plate on it; likewise.
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
        """Return the load of a scenario as it is pushed from another face.

        Args:
            scenario: Of one load.
            chain: Its objects with the plate at that face; see `mechanics.faces.pushed_from`.
            face: Its name.
            offset: Of the plate's middle on it, m.
        """
        interval = None if scenario.interval is None else scenario.interval.carried_by(chain)
        problem = replace(scenario, chain=chain, interval=interval, contact_friction=None, pushes=None)
        return cls.of(problem, face, offset)

    def of_twin(self, scenario: Scenario) -> Load:
        """Return the load of an object that differs from this load's only one in name and place; sets are shared."""
        name, interval = scenario.chain.objects[0].name, self.problem.interval
        chain = replace(self.chain, objects=(replace(self.chain.objects[0], name=name),))
        problem = replace(
            scenario,
            chain=chain,
            interval=None if interval is None else replace(interval, chain=chain),
            contact_friction=None,
            pushes=None,
        )
        return Load((replace(self.links[0], object=name),), problem, self.sets)

    def with_problem(self, problem: Scenario) -> Load:
        """Return the same load with other settings, or another start, goal or room, in its push problem."""
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
    def face(self) -> str:
        """That the plate pushes, of the first object."""
        return self.links[0].face

    @property
    def offset(self) -> float:
        """Of the plate's middle from that of the face, to the left of the push, m."""
        return self.links[0].offset

    @cached_property
    def frame_plate(self) -> FloatArray:
        """(3,) pose of the contact's frame in the plate frame."""
        return frozen(se2.inverse(self.chain.pusher.plate_pose), (3,), "pose of the contact's frame")

    @cached_property
    def places_plate(self) -> FloatArray:
        """(n, 3) poses of the objects' own frames in the plate frame."""
        return frozen(se2.compose(self.frame_plate, self.chain.places), (None, 3), "places of the objects")

    def poses(self, plate: FloatArray) -> dict[str, FloatArray]:
        """Return where the objects are with the plate at a pose (3,) in the world and every contact closed."""
        return dict(zip(self.names, se2.compose(plate, self.places_plate), strict=True))

    def stable_set(self, name: str | None = None) -> StableSet:
        """Return the set to plan pushes of this load in, see `judge.planning_set`; made once.

        Raises:
            PushplanError: When there is no such set.
        """
        from pushplan.plans.judge import planning_set  # loads the compiled mechanics

        if name not in self.sets:
            self.sets[name] = planning_set(self.problem, name)
        return self.sets[name]

    def contact_name(self, name: str) -> str:
        """Return what the contact is called through which an object is pushed."""
        return self.chain.contact_name(self.names.index(name))
