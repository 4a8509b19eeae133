"""The simulated world in which a plan is executed; it can differ from the plan's model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from pushplan.errors import ChainError, PushplanError
from pushplan.geometry.se2 import compose, relative, wrap_angle
from pushplan.mechanics import perturb
from pushplan.mechanics.chain import PLATE, Chain, PushedObject
from pushplan.mechanics.support import Support
from pushplan.scenario.goals import Row
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import Obstacle, Workspace
from pushplan.util.arrays import FloatArray, frozen

MOST_FACTOR = 1e6
"""Largest friction coefficient, and largest factor of the `with_...` methods."""


@dataclass(frozen=True, eq=False)
class World:
    """The bodies, loads, frictions and poses that a plan is executed with.

    The `with_...` methods return changed copies; without a name they change all objects or contacts.

    Attributes:
        chain: Objects with their real properties, and their contacts with the real friction.
        start: Start pose (3,) of the chain frame in the world.
        offsets: Pose errors (n, 3) of the objects in the chain: x, y in the chain frame (m) and the turn about the
            origin of the object's own frame (rad).
        obstacles: Obstacles that objects can touch.
        workspace: Rectangle whose sides are walls that objects can touch; None for no walls.
        other_friction: Friction coefficient of bodies that are not stacked on each other: two objects, or an object
            and an obstacle or wall. Contacts with the plate or the robot have the pusher's friction.
        plate: Start pose (3,) of the plate frame in the world; None if the plate is in contact with the chain.
        beside: Objects that stand apart from the chain, each with a contact for the plate.
    """

    chain: Chain
    start: FloatArray
    offsets: FloatArray
    obstacles: tuple[Obstacle, ...] = ()
    workspace: Workspace | None = None
    other_friction: float = 0.3
    plate: FloatArray | None = None
    beside: tuple[World, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", frozen(self.start, (3,), "start of the world"))
        shape = (len(self.chain.objects), 3)
        object.__setattr__(self, "offsets", frozen(self.offsets, shape, "offsets of the objects"))
        if self.plate is not None:
            object.__setattr__(self, "plate", frozen(self.plate, (3,), "plate of the world"))
        if not 0.0 <= self.other_friction <= MOST_FACTOR:
            raise PushplanError(
                f"other_friction is {self.other_friction}; it must be >= 0 and at most {MOST_FACTOR:g}"
            )

    @classmethod
    def from_chain(cls, chain: Chain, start: ArrayLike = (0.0, 0.0, 0.0)) -> World:
        """Return the world with a chain on an empty floor."""
        return cls(
            chain,
            np.asarray(start, dtype=np.float64),
            np.zeros((len(chain.objects), 3)),
            other_friction=_others(chain),
        )

    @classmethod
    def from_scenario(cls, scenario: Scenario) -> World:
        """Return the world of a scenario, with the middles of load intervals and the lowest friction."""
        first, *beside = (cls.from_chain(load.chain, load.start) for load in scenario.loads)
        rows = [goal for goal in scenario.task.goals if isinstance(goal, Row)]
        return replace(
            first,
            other_friction=rows[0].friction[0] if rows else first.other_friction,
            obstacles=scenario.obstacles,
            workspace=scenario.workspace,
            plate=None if scenario.task.held else scenario.plate_start,
            beside=tuple(beside),
        )

    def require(self, scenario: Scenario) -> None:
        """Check that plans of a scenario can be executed in this world.

        Raises:
            PushplanError: If the objects differ, or the plate is in contact in only one of the two.
        """
        wanted = tuple(scenario.poses)
        if self.names != wanted:
            raise PushplanError(
                f"the world has the objects {', '.join(self.names)}, but the plan has {', '.join(wanted)}; "
                "World.from_scenario(scenario) creates a world that fits"
            )
        if (self.plate is None) != bool(scenario.task.held):
            raise PushplanError(
                f"the plan is a {scenario.kind}, but the plate's start in the world does not fit it; "
                "World.from_scenario(scenario) creates a world that fits"
            )

    @property
    def stacks(self) -> tuple[World, ...]:
        """The chain and all separate objects, as worlds of their own."""
        return (replace(self, beside=()), *self.beside)

    @cached_property
    def objects(self) -> tuple[PushedObject, ...]:
        """All objects, in the order of poses and columns."""
        return (*self.chain.objects, *(obj for one in self.beside for obj in one.objects))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all objects."""
        return tuple(obj.name for obj in self.objects)

    @cached_property
    def object_poses(self) -> FloatArray:
        """Start poses (n, 3) of all objects' own frames in the world."""
        own = compose(self.start, self.chain.places + self.offsets)
        return frozen(
            [*own, *(pose for one in self.beside for pose in one.object_poses)], (None, 3), "poses of objects"
        )

    def friction(self, pusher: str | None, pushed: str) -> float:
        """Return the friction coefficient between two objects, or between the plate (None) and an object."""
        for one in (self, *self.beside):
            names = [obj.name for obj in one.chain.objects]
            for contact in one.chain.contacts:
                pair = {names[contact.pushed], None if contact.pusher == PLATE else names[contact.pusher]}
                if pair == {pusher, pushed}:
                    return contact.friction
            if pusher is None and pushed in names:
                return one.chain.pusher.friction
        return self.other_friction

    def pushed(self, chain: Chain) -> Chain:
        """Return a chain of a plan with the objects and frictions of this world."""
        own = dict(zip(self.names, self.objects, strict=True))
        objects = tuple(replace(own[obj.name], pose_chain=obj.pose_chain) for obj in chain.objects)
        frictions = (
            self.friction(None if c.pusher == PLATE else objects[c.pusher].name, objects[c.pushed].name)
            for c in chain.contacts
        )
        contacts = (replace(c, friction=mu) for c, mu in zip(chain.contacts, frictions, strict=True))
        return replace(chain, objects=objects, contacts=tuple(contacts))

    def with_contact_friction(self, factor: float, name: str | None = None) -> World:
        """Return the world with the friction of contacts multiplied by `factor`.

        Args:
            factor: Factor, >= 0.
            name: Name of the object that the contact pushes; None for all contacts, including `other_friction`.
        """
        _require_factor(factor, least=0.0)

        def changed(one: World, i: int | None) -> World:
            other = one.other_friction * (factor if i is None else 1.0)
            return replace(one, chain=perturb.with_contact_friction(one.chain, factor, i), other_friction=other)

        return self._changed(name, changed)

    def with_floor_friction(self, factor: float, name: str | None = None) -> World:
        """Return the world with the floor friction of objects multiplied by `factor`, > 0."""
        _require_factor(factor)
        return self._with_chain(name, lambda chain, i: perturb.with_floor_friction(chain, factor, i))

    def with_mass(self, factor: float, name: str | None = None) -> World:
        """Return the world with masses multiplied by `factor`, > 0."""
        _require_factor(factor)
        return self._with_chain(name, lambda chain, i: perturb.with_mass(chain, factor, i))

    def with_support(self, support: Support, name: str) -> World:
        """Return the world with another support under an object, in the object's own frame."""
        return self._with_chain(name, lambda chain, i: perturb.with_objects(chain, i, support=support))

    def with_load_shifted(self, direction: ArrayLike, share: float, name: str | None = None) -> World:
        """Return the world with loads shifted towards `direction`; see `mechanics.perturb.with_leaning_load`."""
        return self._with_chain(name, lambda chain, i: perturb.with_leaning_load(chain, direction, share, i))

    def with_offset(self, offset: ArrayLike, name: str | None = None) -> World:
        """Return the world with `offset` (3,) added to the `offsets` of objects."""

        def changed(one: World, i: int | None) -> World:
            offsets = np.array(one.offsets)
            offsets[slice(None) if i is None else i] += frozen(offset, (3,), "offset of an object")
            return replace(one, offsets=offsets)

        return self._changed(name, changed)

    def with_object_poses(self, poses: ArrayLike) -> World:
        """Return the world with the objects at measured poses (n, 3) in the world."""
        measured = frozen(poses, (len(self.objects), 3), "poses of the objects")
        placed = []
        for one in self.stacks:
            own, measured = np.split(measured, [len(one.chain.objects)])
            offsets = relative(one.start, own) - one.chain.places
            offsets[:, 2] = wrap_angle(offsets[:, 2])
            placed.append(replace(one, offsets=offsets))
        return replace(placed[0], beside=tuple(placed[1:]))

    def _with_chain(self, name: str | None, change: Callable[[Chain, int | None], Chain]) -> World:
        return self._changed(name, lambda one, i: replace(one, chain=change(one.chain, i)))

    def _changed(self, name: str | None, change: Callable[[World, int | None], World]) -> World:
        """Return the world with a change of the named object, or of every stack."""
        if name is None:
            stacks = [change(one, None) for one in self.stacks]
        elif name in self.names:
            owned = [name in one.names for one in self.stacks]
            stacks = [
                change(one, one.chain.index_of(name)) if own else one
                for one, own in zip(self.stacks, owned, strict=True)
            ]
        else:
            raise ChainError(f"no object is called {name!r}; allowed: {', '.join(self.names)}")
        return replace(stacks[0], beside=tuple(stacks[1:]))


def _others(chain: Chain) -> float:
    """Return the lowest friction of contacts between objects; for a single object, that of the pusher."""
    between = [contact.friction for contact in chain.contacts if contact.pusher >= 0]
    return min(between, default=chain.pusher.friction)


def _require_factor(factor: float, least: float = 1e-9) -> None:
    if not (least <= factor <= MOST_FACTOR):
        raise PushplanError(
            f"the factor is {factor}; it must be {'>= 0' if least == 0.0 else '> 0'} and at most {MOST_FACTOR:g}"
        )
