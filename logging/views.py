"""What viewers see of an execution: a selection of its samples, as messages that they can draw and plot.

The whole execution is in /execution/samples; at its full rate these messages would make the file several
times larger and no picture smoother.
"""

from __future__ import annotations

import numpy as np
from google.protobuf.timestamp_pb2 import Timestamp

from pushplan.arrays import FloatArray
from pushplan.chain import PLATE, Chain
from pushplan.logging.scene import CHAIN, PUSHER
from pushplan.logging.schemas import Margins, MessageClass, Twist
from pushplan.sim.execution import Execution

VIEW_RATE = 25.0
"""Samples per second of /tf, /pusher/pose, /pusher/twist and /margins."""


def viewed(execution: Execution) -> set[int]:
    """Return the samples to show: the first of each 1/25 s, the last, and where each margin is smallest."""
    if len(execution.t) == 0:
        return set()
    frame = np.floor(execution.t * VIEW_RATE + 1e-6)  # t = 0.28 s is in frame 7, whatever its last bits say
    first = np.flatnonzero(np.diff(frame, prepend=-1.0))
    smallest = np.argmin(execution.margins, axis=0)
    return {*first.tolist(), *smallest.tolist(), len(execution.t) - 1}


def twist_message(twist: FloatArray, stamp: Timestamp) -> MessageClass:
    """Return a body twist (3,) of the pusher, chain frame, at a time."""
    vx, vy, omega = twist
    return Twist(timestamp=stamp, frame_id=CHAIN, vx=vx, vy=vy, omega=omega)


def margins_message(chain: Chain, execution: Execution, i: int, stamp: Timestamp) -> MessageClass:
    """Return the state of every contact at sample `i`; what is not known is left out."""
    message = Margins(timestamp=stamp, smallest=execution.margins[i].min())
    for k, contact in enumerate(chain.contacts):
        entry = message.contacts.add(name=contact_name(chain, k), margin=execution.margins[i, k])
        if execution.friction_margins is not None:
            entry.friction_margin = execution.friction_margins[i, k]
        if execution.forces is not None:
            entry.force.x, entry.force.y = execution.forces[i, k]
        if execution.lambdas is not None:
            share = execution.lambdas[i, k]
            setattr(entry, "lambda", share)
            entry.point.x, entry.point.y = contact.right + share * (contact.left - contact.right)
    return message


def contact_name(chain: Chain, k: int) -> str:
    """Return a name for contact `k`: who pushes, and whom."""
    contact = chain.contacts[k]
    pushing = PUSHER if contact.pusher == PLATE else chain.objects[contact.pusher].name
    return f"{pushing}-{chain.objects[contact.pushed].name}"
