"""The bodies that move with the chain as one, for collision checks and pictures."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from pushplan.basics.arrays import FloatArray


class BodyKind(Enum):
    """What a body is; objects alone rest on the floor and are pushed."""

    ROBOT = "robot"
    PLATE = "plate"
    OBJECT = "object"


@dataclass(frozen=True, eq=False)
class Body:
    """An outline that is fixed to the chain frame.

    Attributes:
        name: `robot`, `pusher` (the plate) or the object's name.
        kind: What it is.
        outline: (v, 2) simple polygon in the chain frame, m, counter-clockwise.
    """

    name: str
    kind: BodyKind
    outline: FloatArray
