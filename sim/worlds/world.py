"""A world that a plan is executed in; it need not be what the plan believes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from pushplan.errors import PushplanError
from pushplan.geometry.se2 import compose, relative, wrap_angle
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.support import Support
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import Obstacle, Workspace
from pushplan.sim.worlds.misjudged import with_floor_friction, with_loads_shifted
from pushplan.util.arrays import FloatArray, frozen


@dataclass(frozen=True, eq=False)
class World:
    """What a push meets: bodies, loads, frictions, where the objects stand, and what else they may touch.

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
    """

    chain: Chain
    start: FloatArray
    offsets: FloatArray
    obstacles: tuple[Obstacle, ...] = ()
    workspace: Workspace | None = None
    other_friction: float = 0.3

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", frozen(self.start, (3,), "start of the world"))
        shape = (len(self.chain.objects), 3)
        object.__setattr__(self, "offsets", frozen(self.offsets, shape, "offsets of the objects"))
        if not self.other_friction >= 0.0:
            raise PushplanError(f"other_friction is {self.other_friction}; it must be >= 0")

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
        there = cls.from_chain(scenario.chain, scenario.start)
        return replace(there, obstacles=scenario.obstacles, workspace=scenario.workspace)

    @cached_property
    def object_poses(self) -> FloatArray:
        """(n, 3) poses of the objects' own frames in the world at the beginning."""
        return frozen(
            compose(self.start, self.chain.places + self.offsets), (None, 3), "poses of the objects"
        )

    def with_contact_friction(self, factor: float, name: str | None = None) -> World:
        """Return the world with the friction of contacts times `factor`.

        Args:
            factor: >= 0.
            name: Of the object that is pushed through the contact; None for all contacts, other ones included.
        """
        _require_factor(factor, least=0.0)
        which = self._indices(name)
        contacts = tuple(
            replace(contact, friction=factor * contact.friction) if k in which else contact
            for k, contact in enumerate(self.chain.contacts)
        )
        if name is not None:
            return replace(self, chain=replace(self.chain, contacts=contacts))
        pusher = replace(self.chain.pusher, friction=factor * self.chain.pusher.friction)
        chain = replace(self.chain, contacts=contacts, pusher=pusher)
        return replace(self, chain=chain, other_friction=factor * self.other_friction)

    def with_floor_friction(self, factor: float, name: str | None = None) -> World:
        """Return the world with the friction between floor and objects times `factor`, > 0."""
        _require_factor(factor)
        chain = self.chain
        for i in self._indices(name):
            chain = with_floor_friction(chain, i, factor)
        return replace(self, chain=chain)

    def with_mass(self, factor: float, name: str | None = None) -> World:
        """Return the world with masses times `factor`, > 0."""
        _require_factor(factor)
        objects = list(self.chain.objects)
        for i in self._indices(name):
            objects[i] = replace(objects[i], mass=factor * objects[i].mass)
        return replace(self, chain=replace(self.chain, objects=tuple(objects)))

    def with_support(self, support: Support, name: str) -> World:
        """Return the world with another support under an object, in the object's own frame."""
        objects = list(self.chain.objects)
        i = self.chain.index_of(name)
        objects[i] = replace(objects[i], support=support)
        return replace(self, chain=replace(self.chain, objects=tuple(objects)))

    def with_load_shifted(self, direction: ArrayLike, share: float, name: str | None = None) -> World:
        """Return the world with loads shifted towards `direction`; see `sim.worlds.misjudged.with_loads_shifted`."""
        chain = self.chain
        for i in self._indices(name):
            chain = with_loads_shifted(chain, direction, share, i)
        return replace(self, chain=chain)

    def with_offset(self, offset: ArrayLike, name: str | None = None) -> World:
        """Return the world with `offset` (3,) added to that of objects; see `offsets`."""
        offsets = np.array(self.offsets)
        offsets[list(self._indices(name))] += frozen(offset, (3,), "offset of an object")
        return replace(self, offsets=offsets)

    def with_object_poses(self, poses: ArrayLike) -> World:
        """Return the world with the objects at measured poses (n, 3) in the world."""
        places = relative(self.start, frozen(poses, (len(self.chain.objects), 3), "poses of the objects"))
        offsets = places - self.chain.places
        offsets[:, 2] = wrap_angle(offsets[:, 2])
        return replace(self, offsets=offsets)

    def _indices(self, name: str | None) -> Iterable[int]:
        return range(len(self.chain.objects)) if name is None else (self.chain.index_of(name),)


def _others(chain: Chain) -> float:
    """Return the least friction of contacts between objects, or the pusher's where there is one object only."""
    between = [contact.friction for contact in chain.contacts if contact.pusher >= 0]
    return min(between, default=chain.pusher.friction)


def _require_factor(factor: float, least: float = 1e-9) -> None:
    if not (least <= factor < np.inf):
        raise PushplanError(
            f"the factor is {factor}; it must be finite and {'>= 0' if least == 0.0 else '> 0'}"
        )
