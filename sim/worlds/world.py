"""A world that a plan is executed in; it need not be what the plan believes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from pushplan.errors import PushplanError
from pushplan.geometry.se2 import compose, relative, wrap_angle
from pushplan.mechanics import perturb
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.support import Support
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import Obstacle, Workspace
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
        chain = perturb.with_contact_friction(self.chain, factor, self._index(name))
        other = self.other_friction * (factor if name is None else 1.0)
        return replace(self, chain=chain, other_friction=other)

    def with_floor_friction(self, factor: float, name: str | None = None) -> World:
        """Return the world with the friction between floor and objects times `factor`, > 0."""
        _require_factor(factor)
        return replace(self, chain=perturb.with_floor_friction(self.chain, factor, self._index(name)))

    def with_mass(self, factor: float, name: str | None = None) -> World:
        """Return the world with masses times `factor`, > 0."""
        _require_factor(factor)
        return replace(self, chain=perturb.with_mass(self.chain, factor, self._index(name)))

    def with_support(self, support: Support, name: str) -> World:
        """Return the world with another support under an object, in the object's own frame."""
        return replace(self, chain=perturb.with_objects(self.chain, self._index(name), support=support))

    def with_load_shifted(self, direction: ArrayLike, share: float, name: str | None = None) -> World:
        """Return the world with loads that lean towards `direction`; see `mechanics.perturb.with_leaning_load`."""
        chain = perturb.with_leaning_load(self.chain, direction, share, self._index(name))
        return replace(self, chain=chain)

    def with_offset(self, offset: ArrayLike, name: str | None = None) -> World:
        """Return the world with `offset` (3,) added to that of objects; see `offsets`."""
        offsets = np.array(self.offsets)
        offsets[slice(None) if name is None else self.chain.index_of(name)] += frozen(
            offset, (3,), "offset of an object"
        )
        return replace(self, offsets=offsets)

    def with_object_poses(self, poses: ArrayLike) -> World:
        """Return the world with the objects at measured poses (n, 3) in the world."""
        places = relative(self.start, frozen(poses, (len(self.chain.objects), 3), "poses of the objects"))
        offsets = places - self.chain.places
        offsets[:, 2] = wrap_angle(offsets[:, 2])
        return replace(self, offsets=offsets)

    def _index(self, name: str | None) -> int | None:
        return None if name is None else self.chain.index_of(name)


def _others(chain: Chain) -> float:
    """Return the least friction of contacts between objects, or the pusher's where there is one object only."""
    between = [contact.friction for contact in chain.contacts if contact.pusher >= 0]
    return min(between, default=chain.pusher.friction)


def _require_factor(factor: float, least: float = 1e-9) -> None:
    if not (least <= factor < np.inf):
        raise PushplanError(
            f"the factor is {factor}; it must be finite and {'>= 0' if least == 0.0 else '> 0'}"
        )
