"""An execution as messages: a block of samples for each simulated second, and a last one with the end."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from pushplan.logging.old.messages import blocks
from pushplan.logging.old.messages.schemas import Execution as ExecutionBlock
from pushplan.logging.old.messages.schemas import ExecutionEnd, MessageClass
from pushplan.plans.execution import Execution, StabilityLoss
from pushplan.util.arrays import FloatArray

REQUIRED = ("t", "poses", "twists", "margins")
OPTIONAL = ("friction_margins", "lambdas", "forces", "dynamic_margins", "loads", "object_poses", "wrenches")
"""The first three are known only where the loads on the floor are; `dynamic_margins` are not in logs of older
versions; `loads` are in those of several pushes, `object_poses` and `wrenches` in those whose contacts may slip."""


def seconds(t: FloatArray) -> Iterator[slice]:
    """Yield the samples of each simulated second that has any, given their times (m,)."""
    cuts = np.flatnonzero(np.diff(np.floor(t))) + 1
    bounds = [0, *cuts.tolist(), len(t)]
    yield from (slice(a, b) for a, b in pairwise(bounds) if b > a)


def encode_block(execution: Execution, samples: slice) -> MessageClass:
    """Return the `Execution` message of `samples`, without a time stamp."""
    arrays = ((name, getattr(execution, name)) for name in (*REQUIRED, *OPTIONAL))
    known = [blocks.encode(name, values[samples]) for name, values in arrays if values is not None]
    return ExecutionBlock(first=samples.start, arrays=known)


def encode_end(execution: Execution) -> MessageClass:
    """Return the `ExecutionEnd` message, without a time stamp."""
    position, angle = execution.goal_error
    message = ExecutionEnd(samples=len(execution.t), goal_position_error=position, goal_angle_error=angle)
    if execution.loss is not None:
        loss = execution.loss
        message.loss.time, message.loss.contact, message.loss.margin = loss.time, loss.contact, loss.margin
        message.loss.pose.extend(loss.pose)
    return message


class Collector:
    """Puts the blocks of an execution together again.

    Attributes:
        contacts: Number of contacts of the chain.
        samples: Number of samples so far.
        gaps: The first sample that is missing, and the one behind, for each gap; only where gaps are allowed.
    """

    def __init__(self, contacts: int, recover: bool = False) -> None:
        self.contacts = contacts
        self.samples = 0
        self.gaps: list[tuple[int, int]] = []
        self._recover = recover
        self._next = 0
        self._series: dict[str, bytearray] = {}  # grown in place: joining parts takes the memory twice

    def add(self, message: MessageClass) -> None:
        """Take the next `Execution` message.

        Raises:
            ValueError: When it does not follow the one before, or its arrays do not fit.
        """
        _require(len(message.arrays) <= len(REQUIRED + OPTIONAL), "a block holds too many arrays")
        arrays = {array.name: blocks.decode(array) for array in message.arrays}
        gap = message.first > self._next and self._recover
        _require(
            message.first == self._next or gap, f"a block begins at sample {message.first}, not {self._next}"
        )
        _require(len(arrays) == len(message.arrays), "a block names an array twice")
        _require(set(REQUIRED) <= set(arrays) <= {*REQUIRED, *OPTIONAL}, f"a block holds {sorted(arrays)}")
        same = not self._series or self._series.keys() == arrays.keys()
        _require(same, "the blocks hold different arrays")
        count = len(arrays["t"])
        for name, values in arrays.items():
            shape = _shape(name, count, self.contacts)
            _require(values.shape == shape, f"array {name!r} has shape {values.shape}, not {shape}")
        for name, values in arrays.items():
            self._series.setdefault(name, bytearray()).extend(values.tobytes())
        if gap:
            self.gaps.append((self._next, message.first))
        self.samples += count
        self._next = message.first + count

    def finish(self, end: MessageClass | None) -> Execution:
        """Return the execution, its arrays read-only; without its `end` the goal error is NaN.

        Raises:
            ValueError: When samples are missing.
        """
        if end is None:
            return Execution(**self._joined(), loss=None, goal_error=(math.nan, math.nan))
        if self._recover and end.samples > self._next:
            self.gaps.append((self._next, end.samples))
            self._next = end.samples
        _require(end.samples == self._next, f"there are {self._next} samples, not {end.samples}")
        error = (end.goal_position_error, end.goal_angle_error)
        return Execution(**self._joined(), loss=_loss(end), goal_error=error)

    def _joined(self) -> dict[str, FloatArray]:
        known = self._series or dict.fromkeys((*REQUIRED, *OPTIONAL), bytearray())
        joined = {name: self._array(name, numbers) for name, numbers in known.items()}
        for values in joined.values():
            values.setflags(write=False)
        return {**dict.fromkeys(OPTIONAL), **joined}  # type: ignore[dict-item]

    def _array(self, name: str, numbers: bytearray) -> FloatArray:
        flat = np.frombuffer(numbers, dtype=np.float64) if numbers else np.zeros(0)
        return flat.reshape(_shape(name, self.samples, self.contacts))


def _shape(name: str, samples: int, contacts: int) -> tuple[int, ...]:
    tails = {"t": (), "poses": (3,), "twists": (3,), "loads": (3,), "forces": (contacts, 2)}
    tails |= {"object_poses": (contacts, 3), "wrenches": (3,)}
    return (samples, *tails.get(name, (contacts,)))


def _loss(end: MessageClass) -> StabilityLoss | None:
    if not end.HasField("loss"):
        return None
    loss = end.loss
    x, y, theta = loss.pose
    return StabilityLoss(time=loss.time, contact=loss.contact, margin=loss.margin, pose=(x, y, theta))


def _require(holds: bool, what: str) -> None:
    if not holds:
        raise ValueError(what)
