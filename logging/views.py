"""What viewers see of an execution: a selection of its samples, as messages that they can draw and plot.

The whole execution is in /execution/samples; at its full rate these messages would make the file several
times larger and no picture smoother.
"""

from __future__ import annotations

import numpy as np
from google.protobuf.timestamp_pb2 import Timestamp

from pushplan.arrays import FloatArray
from pushplan.logging.scene import CHAIN, PUSHER
from pushplan.logging.schemas import Margins, MessageClass, Twist
from pushplan.mechanics.chain import PLATE, Chain
from pushplan.sim.execution import Execution

VIEW_RATE = 20.0
"""Samples per second of /tf, /pusher/pose, /pusher/twist and /margins."""


def viewed(execution: Execution) -> set[int]:
    """Return the samples to show: the first of each 1/20 s, the last, and where each margin is smallest."""
    if len(execution.t) == 0:
        return set()
    frame = np.floor(execution.t * VIEW_RATE + 1e-6)  # t = 0.35 s is in frame 7, whatever its last bits say
    first = np.flatnonzero(np.diff(frame, prepend=-1.0))
    smallest = np.argmin(execution.margins, axis=0)
    return {*first.tolist(), *smallest.tolist(), len(execution.t) - 1}


def twist_message(twist: FloatArray, stamp: Timestamp) -> MessageClass:
    """Return a body twist (3,) of the pusher, chain frame, at a time."""
    vx, vy, omega = twist.tolist()
    return Twist(timestamp=stamp, frame_id=CHAIN, vx=vx, vy=vy, omega=omega)


class MarginView:
    """Makes the messages of /margins; what is not known is left out."""

    def __init__(self, chain: Chain, execution: Execution) -> None:
        self._message = Margins(
            contacts=[{"name": contact_name(chain, k)} for k in range(len(chain.contacts))]
        )
        self._ends = [(*contact.right.tolist(), *contact.left.tolist()) for contact in chain.contacts]
        self._execution = execution

    def at(self, i: int, stamp: Timestamp) -> MessageClass:
        """Return the state of every contact at sample `i`.

        The same message is changed and returned each time.
        """
        execution, message = self._execution, self._message
        message.timestamp.CopyFrom(stamp)
        margins = execution.margins[i].tolist()
        message.smallest = min(margins)
        for entry, margin in zip(message.contacts, margins, strict=True):
            entry.margin = margin
        if execution.friction_margins is not None:
            for entry, angle in zip(message.contacts, execution.friction_margins[i].tolist(), strict=True):
                entry.friction_margin = angle
        if execution.forces is not None:
            for entry, (x, y) in zip(message.contacts, execution.forces[i].tolist(), strict=True):
                entry.force.x, entry.force.y = x, y
        if execution.lambdas is not None:
            self._set_points(execution.lambdas[i].tolist())
        return message

    def _set_points(self, lambdas: list[float]) -> None:
        for entry, share, (xr, yr, xl, yl) in zip(self._message.contacts, lambdas, self._ends, strict=True):
            setattr(entry, "lambda", share)
            entry.point.x, entry.point.y = xr + share * (xl - xr), yr + share * (yl - yr)


def contact_name(chain: Chain, k: int) -> str:
    """Return a name for contact `k`: who pushes, and whom."""
    contact = chain.contacts[k]
    pushing = PUSHER if contact.pusher == PLATE else chain.objects[contact.pusher].name
    return f"{pushing}-{chain.objects[contact.pushed].name}"
