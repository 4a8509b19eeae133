"""Poses and frames as messages: the chain moves in the world, everything else is fixed to the chain."""

from __future__ import annotations

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.PosesInFrame_pb2 import PosesInFrame
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp

from pushplan.geometry import se2
from pushplan.logging.old.message_template import ByteRows, MessageTemplate
from pushplan.logging.old.view.scene import CHAIN, WORLD
from pushplan.mechanics.chain import Chain
from pushplan.util.arrays import FloatArray, IntArray
from pushplan.util.names import PUSHER


def placed(poses: FloatArray) -> FloatArray:
    """Return what messages say of poses (k, 3) in the plane: x, y, and a quaternion's z and w, (k, 4)."""
    half = 0.5 * poses[:, 2]
    return np.stack([poses[:, 0], poses[:, 1], np.sin(half), np.cos(half)], axis=1)


def chain_frames(chain: Chain) -> MessageTemplate:
    """Return the transforms of all frames of a chain, to be filled with its place in the world.

    Every message carries all of them, so that any one suffices to place everything; those that never change
    keep the time stamp 0 and cost next to nothing once compressed.
    """
    bodies = {PUSHER: np.zeros(3), **{obj.name: obj.pose_chain for obj in chain.objects}}
    fixed = [_transform(CHAIN, name, *placed(pose[None])[0].tolist()) for name, pose in bodies.items()]

    def message(stamp: Timestamp, numbers: list[float]) -> FrameTransforms:
        moving = _transform(WORLD, CHAIN, *numbers)
        moving.timestamp.CopyFrom(stamp)
        return FrameTransforms(transforms=[moving, *fixed])

    return MessageTemplate(message, 4)


def moving_frames(chain: Chain, parent: str = CHAIN) -> MessageTemplate:
    """Return the transforms of all frames, to be filled with the places of the chain frame and of the objects.

    Args:
        chain: What moves.
        parent: Frame that the objects' places are in.
    """
    names = [obj.name for obj in chain.objects]

    def message(stamp: Timestamp, numbers: list[float]) -> FrameTransforms:
        parents = [WORLD, *([parent] * len(names))]
        places = [numbers[4 * k : 4 * k + 4] for k in range(len(names) + 1)]
        moving = [
            _transform(frame, child, *place)
            for frame, child, place in zip(parents, [CHAIN, *names], places, strict=True)
        ]
        for transform in moving:
            transform.timestamp.CopyFrom(stamp)
        return FrameTransforms(transforms=[*moving, _transform(CHAIN, PUSHER, 0.0, 0.0, 0.0, 1.0)])

    return MessageTemplate(message, 4 * (len(names) + 1))


def frames_at(chain: Chain, poses: FloatArray, loads: FloatArray | None, instants: IntArray) -> ByteRows:
    """Return the transforms of all frames at `instants` (k,), ns.

    Args:
        chain: What moves.
        poses: (k, 3) of the chain frame, or of the robot's frame.
        loads: (k, 3) of the objects' frame where they move on their own.
        instants: When.
    """
    if loads is None:
        return chain_frames(chain).fill(instants, placed(poses))
    every = [poses, *(se2.compose(loads, obj.pose_chain) for obj in chain.objects)]
    return moving_frames(chain, WORLD).fill(instants, np.hstack([placed(one) for one in every]))


def slipping_frames(
    chain: Chain, poses: FloatArray, object_poses: FloatArray, instants: IntArray
) -> ByteRows:
    """Return the transforms of all frames where objects slip.

    Args:
        chain: What moves.
        poses: (k, 3) of the chain frame in the world.
        object_poses: (k, n, 3) of the objects in the world.
        instants: (k,) when, ns.
    """
    within = se2.relative(poses[:, None], object_poses)
    places = [placed(poses), *(placed(within[:, k]) for k in range(within.shape[1]))]
    return moving_frames(chain).fill(instants, np.concatenate(places, axis=1))


def pose_in_world() -> MessageTemplate:
    """Return a pose in the world, to be filled with its place."""

    def message(stamp: Timestamp, numbers: list[float]) -> PoseInFrame:
        return PoseInFrame(timestamp=stamp, frame_id=WORLD, pose=_pose(*numbers))

    return MessageTemplate(message, 4)


def poses_in_world(poses: FloatArray, stamp: Timestamp | None = None) -> bytes:
    """Return poses (k, 3) in the world, at time 0 or that of `stamp`, as a serialised `PosesInFrame`.

    Serialised messages joined to one another are the serialised message of all their entries.
    """
    head = PosesInFrame(timestamp=stamp or Timestamp(), frame_id=WORLD).SerializeToString(deterministic=True)
    one = MessageTemplate(lambda _, numbers: PosesInFrame(poses=[_pose(*numbers)]), 4)
    return head + one.fill(np.zeros(len(poses), dtype=np.int64), placed(poses)).tobytes()


def _pose(x: float, y: float, z: float, w: float) -> Pose:
    return Pose(position=Vector3(x=x, y=y), orientation=Quaternion(z=z, w=w))


def _transform(parent: str, child: str, x: float, y: float, z: float, w: float) -> FrameTransform:
    return FrameTransform(
        timestamp=Timestamp(),
        parent_frame_id=parent,
        child_frame_id=child,
        translation=Vector3(x=x, y=y),
        rotation=Quaternion(z=z, w=w),
    )
