"""What a search for several pushes finds: pushes in their order, and the robot's ways to them."""

from __future__ import annotations

from dataclasses import dataclass

from pushplan.util.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Step:
    """A push of a plan, and how the robot gets to it.

    Attributes:
        contact: Index of the contact.
        before: (3,) pose of the load.
        after: Likewise.
        start: (3,) pose of the robot's frame before it drives there.
        transit: (k, 4) arcs of the robot alone to the contact's approach.
        arcs: (k, 4) of the push, in the contact's frame; of no length where there are fewer.
        cost: Of the push, m.
    """

    contact: int
    before: FloatArray
    after: FloatArray
    start: FloatArray
    transit: FloatArray
    arcs: FloatArray
    cost: float


@dataclass(frozen=True, eq=False)
class Sequence:
    """A plan: its pushes and what it costs, the robot's ways and changes of the contact included, m."""

    steps: tuple[Step, ...]
    cost: float
