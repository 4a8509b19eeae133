"""A world that a plan is executed in; it need not be what the plan believes."""

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
"""Largest coefficient of friction, and factor of what a world has."""


@dataclass(frozen=True, eq=False)
class World:
    """What a plan meets: bodies, loads, frictions, where the objects stand, and what else they may touch.

    The `with_...` methods return changed copies; without a name they change all objects or contacts.

    Attributes:
        chain: The objects as they are, and the contacts that they are stacked on with their real friction.
        start: (3,) pose of the chain frame in the world at the beginning.
        offsets: (n, 3) by what the objects stand off their places in the chain: x, y in the chain frame (m) and the
            turn about the origin of the object's own frame (rad).
        obstacles: What objects touch when they come there.
        workspace: Its sides are walls that objects touch; None for no walls.
        other_friction: Coefficient of friction where bodies touch that are not stacked on one another: two objects,
            or an object and an obstacle or wall. Where the plate or the robot is one of them, it is the pusher's.
        plate: (3,) pose of the plate frame in the world at the beginning; None where the plate is in contact with the
            chain.
        beside: Objects that stand apart from the chain, each with a contact that the plate may push it through.
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
        """Return the world as the scenario states it; of intervals, the middle of loads and the lowest friction."""
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
        """Refuse a world that plans of a scenario cannot be executed in.

        Raises:
            PushplanError: If it has other objects, or the plate is in contact in one of them only.
        """
        wanted = tuple(scenario.poses)
        if self.names != wanted:
            raise PushplanError(
                f"the world has the objects {', '.join(self.names)}, and the plan {', '.join(wanted)}; "
                "World.from_scenario(scenario) makes one that fits"
            )
        if (self.plate is None) != bool(scenario.task.held):
            raise PushplanError(
                f"the plan is a {scenario.kind}, and the world says otherwise of where the plate is at the "
                "beginning; World.from_scenario(scenario) makes one that fits"
            )

    @property
    def stacks(self) -> tuple[World, ...]:
        """The chain, and all that stands beside it."""
        return (replace(self, beside=()), *self.beside)

    @cached_property
    def objects(self) -> tuple[PushedObject, ...]:
        """All objects; the order of poses and columns."""
        return (*self.chain.objects, *(obj for one in self.beside for obj in one.objects))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all objects."""
        return tuple(obj.name for obj in self.objects)

    @cached_property
    def object_poses(self) -> FloatArray:
        """(n, 3) poses of all objects' own frames in the world at the beginning."""
        own = compose(self.start, self.chain.places + self.offsets)
        return frozen(
            [*own, *(pose for one in self.beside for pose in one.object_poses)], (None, 3), "poses of objects"
        )

    def friction(self, pusher: str | None, pushed: str) -> float:
        """Return the coefficient between two objects, or the plate (None) and an object, wherever they touch."""
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
        """Return a chain that a plan pushes, with its objects and frictions as they are here."""
        own = dict(zip(self.names, self.objects, strict=True))
        objects = tuple(replace(own[obj.name], pose_chain=obj.pose_chain) for obj in chain.objects)
        frictions = (
            self.friction(None if c.pusher == PLATE else objects[c.pusher].name, objects[c.pushed].name)
            for c in chain.contacts
        )
        contacts = (replace(c, friction=mu) for c, mu in zip(chain.contacts, frictions, strict=True))
        return replace(chain, objects=objects, contacts=tuple(contacts))

    def with_contact_friction(self, factor: float, name: str | None = None) -> World:
        """Return the world with the friction of contacts times `factor`.

        Args:
            factor: >= 0.
            name: Of the object that is pushed through the contact; None for all contacts, other ones included.
        """
        _require_factor(factor, least=0.0)

        def changed(one: World, i: int | None) -> World:
            other = one.other_friction * (factor if i is None else 1.0)
            return replace(one, chain=perturb.with_contact_friction(one.chain, factor, i), other_friction=other)

        return self._changed(name, changed)

    def with_floor_friction(self, factor: float, name: str | None = None) -> World:
        """Return the world with the friction between floor and objects times `factor`, > 0."""
        _require_factor(factor)
        return self._with_chain(name, lambda chain, i: perturb.with_floor_friction(chain, factor, i))

    def with_mass(self, factor: float, name: str | None = None) -> World:
        """Return the world with masses times `factor`, > 0."""
        _require_factor(factor)
        return self._with_chain(name, lambda chain, i: perturb.with_mass(chain, factor, i))

    def with_support(self, support: Support, name: str) -> World:
        """Return the world with another support under an object, in the object's own frame."""
        return self._with_chain(name, lambda chain, i: perturb.with_objects(chain, i, support=support))

    def with_load_shifted(self, direction: ArrayLike, share: float, name: str | None = None) -> World:
        """Return the world with loads that lean towards `direction`; see `mechanics.perturb.with_leaning_load`."""
        return self._with_chain(name, lambda chain, i: perturb.with_leaning_load(chain, direction, share, i))

    def with_offset(self, offset: ArrayLike, name: str | None = None) -> World:
        """Return the world with `offset` (3,) added to that of objects; see `offsets`."""

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
        """Return the world with a change of the object that has a name, or of every stack."""
        if name is None:
            stacks = [change(one, None) for one in self.stacks]
        elif name in self.names:
            owned = [name in one.names for one in self.stacks]
            stacks = [
                change(one, one.chain.index_of(name)) if own else one
                for one, own in zip(self.stacks, owned, strict=True)
            ]
        else:
            raise ChainError(f"no object is called {name!r}; there are {', '.join(self.names)}")
        return replace(stacks[0], beside=tuple(stacks[1:]))


def _others(chain: Chain) -> float:
    """Return the least friction of contacts between objects, or the pusher's where there is one object only."""
    between = [contact.friction for contact in chain.contacts if contact.pusher >= 0]
    return min(between, default=chain.pusher.friction)


def _require_factor(factor: float, least: float = 1e-9) -> None:
    if not (least <= factor <= MOST_FACTOR):
        raise PushplanError(
            f"the factor is {factor}; it must be {'>= 0' if least == 0.0 else '> 0'} and at most {MOST_FACTOR:g}"
        )
