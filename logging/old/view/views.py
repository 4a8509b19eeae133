"""What viewers see of an execution: a selection of its samples, as messages that they can draw and plot.

The whole execution is in /execution/samples; at its full rate these messages would make the file several
times larger and no picture smoother.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from google.protobuf.timestamp_pb2 import Timestamp

from pushplan.geometry import se2
from pushplan.logging.old.message_template import ByteRows, MessageTemplate
from pushplan.logging.old.messages import schemas
from pushplan.logging.old.messages.schemas import MessageClass, Topic
from pushplan.logging.old.view import frames
from pushplan.logging.old.view.contact_messages import contact_messages
from pushplan.logging.old.view.contacts import PushedContacts
from pushplan.logging.old.view.scene import CHAIN
from pushplan.mechanics.chain import Chain
from pushplan.plans.execution import Execution
from pushplan.util.arrays import FloatArray, IntArray

VIEW_RATE = 20.0
"""Samples per second of /tf, /contacts, /pusher/pose, /pusher/twist, /pusher/wrench and /margins."""


def viewed(execution: Execution) -> IntArray:
    """Return the samples to show: the first of each 1/20 s, the last, and where each margin is smallest."""
    if len(execution.t) == 0:
        return np.zeros(0, dtype=np.int64)
    frame = np.floor(execution.t * VIEW_RATE + 1e-6)  # t = 0.35 s is in frame 7, whatever its last bits say
    first = np.flatnonzero(np.diff(frame, prepend=-1.0))
    smallest = np.argmin(execution.margins, axis=0)
    return np.unique([*first, *smallest, len(execution.t) - 1])


def messages(
    chain: Chain, execution: Execution, samples: IntArray, instants: IntArray
) -> dict[Topic, ByteRows]:
    """Return what viewers see of `samples` (n,) at `instants` (n,), ns: a message of each topic for each sample."""
    poses = frames.placed(execution.poses[samples])
    loads = None if execution.loads is None else execution.loads[samples]
    if loads is None:
        apart = {
            schemas.CONTACTS: contact_messages(chain, PushedContacts(chain, execution).at(samples), instants)
        }
    else:
        plates = se2.compose(execution.poses[samples], chain.pusher.plate_pose)
        apart = {schemas.ROBOT: frames.pose_in_world().fill(instants, frames.placed(plates))}
    if execution.wrenches is not None:
        apart[schemas.PUSHER_WRENCH] = _wrench().fill(instants, execution.wrenches[samples])
    columns = {name: numbers[samples] for name, numbers in _contact_columns(chain, execution)}
    margins = [execution.margins[samples].min(axis=1)[:, None], *columns.values()]
    return {
        schemas.TF: _transforms(chain, execution, samples, instants),
        schemas.PUSHER_POSE: frames.pose_in_world().fill(instants, poses),
        schemas.PUSHER_TWIST: _twist().fill(instants, execution.twists[samples]),
        schemas.MARGINS: _margins(chain, list(columns)).fill(instants, np.concatenate(margins, axis=1)),
        **apart,
    }


def _transforms(chain: Chain, execution: Execution, samples: IntArray, instants: IntArray) -> ByteRows:
    poses = execution.poses[samples]
    if execution.object_poses is not None:
        return frames.slipping_frames(chain, poses, execution.object_poses[samples], instants)
    loads = None if execution.loads is None else execution.loads[samples]
    return frames.frames_at(chain, poses, loads, instants)


def _twist() -> MessageTemplate:
    """A body twist of the pusher, chain frame."""

    def message(stamp: Timestamp, numbers: list[float]) -> MessageClass:
        vx, vy, omega = numbers
        return schemas.Twist(timestamp=stamp, frame_id=CHAIN, vx=vx, vy=vy, omega=omega)

    return MessageTemplate(message, 3)


def _wrench() -> MessageTemplate:
    """The wrench with which the plate pushes, chain frame."""

    def message(stamp: Timestamp, numbers: list[float]) -> MessageClass:
        fx, fy, torque = numbers
        return schemas.Wrench(timestamp=stamp, frame_id=CHAIN, fx=fx, fy=fy, torque=torque)

    return MessageTemplate(message, 3)


def _contact_columns(chain: Chain, execution: Execution) -> Iterator[tuple[str, FloatArray]]:
    """Yield (m, contacts) numbers and their field in `ContactMargin`; what is not known is left out."""
    yield "margin", execution.margins
    if execution.friction_margins is not None:
        yield "friction_margin", execution.friction_margins
    if execution.forces is not None:
        yield "force.x", execution.forces[:, :, 0]
        yield "force.y", execution.forces[:, :, 1]
    if execution.lambdas is not None:
        yield "lambda", execution.lambdas
        for k, axis in enumerate("xy"):
            right = np.array([contact.right[k] for contact in chain.contacts])
            left = np.array([contact.left[k] for contact in chain.contacts])
            yield f"point.{axis}", right + execution.lambdas * (left - right)


def _margins(chain: Chain, fields: list[str]) -> MessageTemplate:
    """The state of every contact: the smallest margin, then each of the `fields` of all contacts."""
    contacts = len(chain.contacts)

    def message(stamp: Timestamp, numbers: list[float]) -> MessageClass:
        smallest, *rest = numbers
        entries = [_contact(chain.contact_name(k), fields, rest[k::contacts]) for k in range(contacts)]
        return schemas.Margins(timestamp=stamp, smallest=smallest, contacts=entries)

    return MessageTemplate(message, 1 + contacts * len(fields))


def _contact(name: str, fields: list[str], numbers: list[float]) -> dict[str, Any]:
    entry: dict[str, Any] = {"name": name}
    for field, number in zip(fields, numbers, strict=True):
        outer, _, inner = field.partition(".")
        if inner:
            entry.setdefault(outer, {})[inner] = number
        else:
            entry[outer] = number
    return entry
