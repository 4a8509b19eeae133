"""Poses and frames as messages: the chain moves in the world, everything else is fixed to the chain."""

from __future__ import annotations

import math

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.PosesInFrame_pb2 import PosesInFrame
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp

from pushplan.arrays import FloatArray
from pushplan.logging.scene import CHAIN, PUSHER, WORLD
from pushplan.mechanics.chain import Chain


class ChainFrames:
    """Makes the transforms of all frames of a chain.

    Every message carries all of them, so that any one suffices to place everything; those that never change
    keep the time stamp 0 and cost next to nothing once compressed.
    """

    def __init__(self, chain: Chain) -> None:
        origin = np.zeros(3)
        fixed = {PUSHER: origin, **{obj.name: obj.pose_chain for obj in chain.objects}}
        self._message = FrameTransforms(transforms=[_transform(WORLD, CHAIN, origin)])
        self._message.transforms.extend(_transform(CHAIN, name, pose) for name, pose in fixed.items())

    def at(self, pose: FloatArray, stamp: Timestamp) -> FrameTransforms:
        """Return the transforms while the chain frame is at `pose` (3,) in the world.

        The same message is changed and returned each time.
        """
        moving = _transform(WORLD, CHAIN, pose)
        moving.timestamp.CopyFrom(stamp)
        self._message.transforms[0].CopyFrom(moving)
        return self._message


def pose_message(pose: FloatArray) -> Pose:
    """Return a pose (3,) in the plane as one in space."""
    x, y, theta = pose.tolist()
    return Pose(position=Vector3(x=x, y=y), orientation=_rotation(theta))


def pose_in_world(pose: FloatArray, stamp: Timestamp) -> PoseInFrame:
    """Return a pose (3,) in the world at a time."""
    return PoseInFrame(timestamp=stamp, frame_id=WORLD, pose=pose_message(pose))


def poses_in_world(poses: FloatArray) -> PosesInFrame:
    """Return poses (k, 3) in the world, at time 0."""
    return PosesInFrame(timestamp=Timestamp(), frame_id=WORLD, poses=[pose_message(pose) for pose in poses])


def _transform(parent: str, child: str, pose: FloatArray) -> FrameTransform:
    x, y, theta = pose.tolist()
    return FrameTransform(
        timestamp=Timestamp(),
        parent_frame_id=parent,
        child_frame_id=child,
        translation=Vector3(x=x, y=y),
        rotation=_rotation(theta),
    )


def _rotation(theta: float) -> Quaternion:
    return Quaternion(z=math.sin(0.5 * theta), w=math.cos(0.5 * theta))
