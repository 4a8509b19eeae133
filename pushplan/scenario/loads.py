"""Loads: what moves as one piece, with everything that is uncertain about it, and where it stands."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pushplan.geometry import se2
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.intervals import IntervalChain
from pushplan.util.arrays import FloatArray, frozen


@dataclass(frozen=True)
class Snapped:
    """How an object was moved.

    Attributes:
        name: Name of the object.
        onto: What messages call the body whose edge the object lies on now.
        gap: Distance along the edge's normal that the object was moved towards that body, m; < 0 away from it.
        turn: Angle by which it was turned about its outline's centroid, rad.
    """

    name: str
    onto: str
    gap: float
    turn: float


@dataclass(frozen=True)
class Snapping:
    """How measured poses were moved onto their contacts.

    Attributes:
        objects: How each object with a stated pose was moved.
        sideways: y of the first contact's midpoint in the stated poses, which is the chain frame's origin now, m.
    """

    objects: tuple[Snapped, ...]
    sideways: float


@dataclass(frozen=True, eq=False, kw_only=True)
class Bodies:
    """What moves as one load.

    Attributes:
        chain: Objects, contacts and pusher; of intervals, the middle of loads and the lowest contact friction.
        interval: The chain with the intervals of its loads and floor frictions, None when these are numbers.
        contact_friction: (n, 2) least and largest coefficient of every contact; None stands for the chain's.
        stated: The same as plain data in the form of the file, with every pose and default filled in; `pose` is that
            of an object which a file places by itself, in the world.
        snapping: How measured poses were moved; None when they are taken as they are.
    """

    chain: Chain
    interval: IntervalChain | None = None
    contact_friction: FloatArray | None = None
    stated: Mapping[str, Any]
    snapping: Snapping | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class PlacedLoad(Bodies):
    """A load and where it stands.

    Attributes:
        start: (3,) pose of its chain frame in the world.
    """

    start: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", frozen(self.start, (3,), "start of a load"))

    @property
    def name(self) -> str:
        """Name of the load, which is that of its first object."""
        return self.chain.objects[0].name

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its objects."""
        return tuple(obj.name for obj in self.chain.objects)

    @property
    def pose(self) -> FloatArray:
        """(3,) pose of its first object's own frame in the world; to the last bit where a file states it."""
        stated = self.stated.get("pose")
        if stated is not None and (self.start_for(stated) == self.start).all():
            return np.array(stated)
        return se2.compose(self.start, self.chain.places[0])

    def start_for(self, pose: ArrayLike) -> FloatArray:
        """Return the pose (3,) of the chain frame with the first object's own frame at a pose (3,)."""
        return se2.compose(np.asarray(pose), se2.inverse(self.chain.objects[0].pose_chain))

    def poses(self, start: FloatArray | None = None) -> dict[str, FloatArray]:
        """Return where the objects' own frames (3,) are with the chain frame at a pose (3,); None: at its start."""
        there = se2.compose(self.start if start is None else start, self.chain.places)
        return dict(zip(self.names, there, strict=True))

    @property
    def kind(self) -> str:
        """What is the same for loads that differ in names and places only."""
        objects = [{key: value for key, value in one.items() if key != "name"} for one in self.stated["objects"]]
        return repr({**self.document(), "objects": objects})

    def document(self) -> dict[str, Any]:
        """Return what is stated, without where it is, in the form of a file of one load."""
        return {key: deepcopy(value) for key, value in self.stated.items() if key != "pose"}
