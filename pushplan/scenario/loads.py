"""Loads: objects that move as one piece, with their uncertainty and start pose."""

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
    """Motion that snapped an object onto its contact.

    Attributes:
        name: Name of the object.
        onto: Name, for messages, of the body that the object now touches.
        gap: Distance along the edge's normal by which the object moved towards that body, m; < 0 away from it.
        turn: Angle by which it was turned about its outline's centroid, rad.
    """

    name: str
    onto: str
    gap: float
    turn: float


@dataclass(frozen=True)
class Snapping:
    """Motions that snapped measured poses onto their contacts.

    Attributes:
        objects: Motion of each object with a given pose.
        sideways: y of the first contact's midpoint in the frame of the given poses, m; it is now the chain frame's
            origin.
    """

    objects: tuple[Snapped, ...]
    sideways: float


@dataclass(frozen=True, eq=False, kw_only=True)
class Bodies:
    """Bodies that move as one load.

    Attributes:
        chain: Objects, contacts and pusher, with the middles of load intervals and the lowest contact friction.
        interval: Chain with the intervals of loads and floor frictions; None if these are plain numbers.
        contact_friction: Lowest and highest coefficients (n, 2) of the contacts; None for those of the chain.
        stated: The bodies as plain data in the form of the file, with every pose and default filled in; `pose` is
            the world pose of a separate object.
        snapping: Motions of the measured poses; None if they are used unchanged.
    """

    chain: Chain
    interval: IntervalChain | None = None
    contact_friction: FloatArray | None = None
    stated: Mapping[str, Any]
    snapping: Snapping | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class PlacedLoad(Bodies):
    """A load with its start pose.

    Attributes:
        start: Start pose (3,) of the chain frame in the world.
    """

    start: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", frozen(self.start, (3,), "start of a load"))

    @property
    def name(self) -> str:
        """Name of the load: the name of its first object."""
        return self.chain.objects[0].name

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its objects."""
        return tuple(obj.name for obj in self.chain.objects)

    @property
    def pose(self) -> FloatArray:
        """Start pose (3,) of the first object's own frame in the world; exactly that of the file if it has one."""
        stated = self.stated.get("pose")
        if stated is not None and (self.start_for(stated) == self.start).all():
            return np.array(stated)
        return se2.compose(self.start, self.chain.places[0])

    def start_for(self, pose: ArrayLike) -> FloatArray:
        """Return the pose (3,) of the chain frame with the first object's own frame at a pose (3,)."""
        return se2.compose(np.asarray(pose), se2.inverse(self.chain.objects[0].pose_chain))

    def poses(self, start: FloatArray | None = None) -> dict[str, FloatArray]:
        """Return poses (3,) of the objects' own frames with the chain frame at a pose (3,); None for its start."""
        poses = se2.compose(self.start if start is None else start, self.chain.places)
        return dict(zip(self.names, poses, strict=True))

    @property
    def kind(self) -> str:
        """Key that is equal for loads that differ only in names and poses."""
        objects = [{key: value for key, value in one.items() if key != "name"} for one in self.stated["objects"]]
        return repr({**self.document(), "objects": objects})

    def document(self) -> dict[str, Any]:
        """Return the load, without its pose, in the form of a file of one load."""
        return {key: deepcopy(value) for key, value in self.stated.items() if key != "pose"}
