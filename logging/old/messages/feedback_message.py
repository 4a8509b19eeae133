"""What a closed loop saw, noticed and planned, as messages, and back from them."""

from __future__ import annotations

import math

import numpy as np
from foxglove_schemas_protobuf.Log_pb2 import Log

from pushplan.logging.old.messages import plan_message, schemas
from pushplan.logging.old.messages.effort import Effort
from pushplan.logging.old.messages.schemas import MessageClass
from pushplan.plans.events import KINDS, Event, Feedback, Measured, Replan
from pushplan.util.arrays import FloatArray

_NO_EFFORT = Effort(math.nan, None, (), 0)
"""Of plans on the way: wall-clock times are not in messages."""


def encode_event(event: Event) -> MessageClass:
    """Return an event as a line that viewers list, its kind as the line's source, without a time stamp."""
    return Log(level=schemas.LEVELS.index("info") + 1, name=event.kind, message=event.text)  # type: ignore[arg-type]


def encode_replan(replan: Replan) -> MessageClass:
    """Return the `Plan` message of an attempt, without a time stamp."""
    if replan.result is None:
        return schemas.Plan(solved=False, reason=replan.reason)
    return plan_message.encode(replan.result)


class FeedbackReader:
    """Gathers measurements, events and plans from messages."""

    def __init__(self) -> None:
        self._t: list[float] = []
        self._poses: list[FloatArray] = []
        self._events: list[Event] = []
        self._replans: list[Replan] = []

    @property
    def feedback(self) -> Feedback | None:
        """What was gathered; None where there was nothing."""
        if not (self._t or self._events or self._replans):
            return None
        poses = np.array(self._poses) if self._poses else np.zeros((0, 1, 3))
        return Feedback(Measured(np.array(self._t), poses), tuple(self._events), tuple(self._replans))

    def take_measured(self, message: MessageClass) -> None:
        """Take a message on /measured.

        Raises:
            ValueError: When it holds another number of objects than the one before.
        """
        if self._poses and len(message.poses) != len(self._poses[0]):
            raise ValueError(f"{len(message.poses)} measured objects instead of {len(self._poses[0])}")
        rows = [
            (pose.position.x, pose.position.y, 2.0 * math.atan2(pose.orientation.z, pose.orientation.w))
            for pose in message.poses
        ]
        self._t.append(_time(message))
        self._poses.append(np.array(rows).reshape(-1, 3))

    def take_event(self, message: MessageClass) -> None:
        """Take a message on /events.

        Raises:
            ValueError: When its kind is none.
        """
        if message.name not in KINDS:
            raise ValueError(f"kind of event {message.name!r} is none of {', '.join(KINDS)}")
        self._events.append(Event(_time(message), message.name, message.message))

    def take_replan(self, message: MessageClass) -> None:
        """Take a message on /plan/replans.

        Raises:
            ValueError: When its numbers do not make a plan.
            PushplanError: Likewise.
        """
        result = plan_message.decode(message, _NO_EFFORT, ()) if message.planner else None
        self._replans.append(Replan(_time(message), result, message.reason, math.nan))


def _time(message: MessageClass) -> float:
    return float(message.timestamp.seconds + 1e-9 * message.timestamp.nanos)
