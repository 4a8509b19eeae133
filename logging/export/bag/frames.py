"""The frames of a bag, as ROS names and nests them (REP 105): map -> odom -> base_link -> chain -> objects.

Only odom -> base_link changes; all else is rigid and goes to /tf_static.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.logging.view.scene import CHAIN, WORLD
from pushplan.mechanics.chain import Chain
from pushplan.util.arrays import FloatArray
from pushplan.util.names import PUSHER

Message = dict[str, Any]


class FrameNamesError(PushplanError, ValueError):
    """Names of frames that cannot be used."""


@dataclass(frozen=True)
class Frames:
    """Names of the frames above the chain.

    Attributes:
        map: The world's frame, in which scenarios are stated.
        odom: In which the robot's motion is measured; here the same as `map`.
        base: The robot's frame.
    """

    map: str = "map"
    odom: str = "odom"
    base: str = "base_link"

    @classmethod
    def from_text(cls, text: str) -> Self:
        """Return the frames named `MAP,BASE` or `MAP,ODOM,BASE`.

        Raises:
            FrameNamesError: When they are not two or three different names.
        """
        names = [name.strip() for name in text.split(",")]
        if len(names) == 2:
            names.insert(1, cls.odom)
        if len(names) != 3 or len(set(names)) < 3 or not all(name and name[0] != "/" for name in names):
            raise FrameNamesError(
                f"frames {text!r}; allowed: MAP,BASE or MAP,ODOM,BASE, all different, without a leading /"
            )
        return cls(*names)

    def check(self, chain: Chain) -> None:
        """Find out whether the chain has a frame of one of these names.

        Raises:
            FrameNamesError: When it has.
        """
        taken = {CHAIN, PUSHER, *(obj.name for obj in chain.objects)} & {self.map, self.odom, self.base}
        if taken:
            raise FrameNamesError(
                f"the chain has a frame {sorted(taken)[0]!r} already; name others with --frames"
            )

    def named(self, frame: str) -> str:
        """Return the name in the bag of a frame of the log."""
        return self.map if frame == WORLD else frame

    def rigid(self, chain: Chain, attached: bool) -> Message:
        """Return the message for /tf_static; objects are in it where the plate is always in contact."""
        pairs = [(self.map, self.odom, np.zeros(3)), (self.base, CHAIN, se2.inverse(chain.pusher.base_pose))]
        pairs.append((CHAIN, PUSHER, np.zeros(3)))
        if attached:
            pairs += [(CHAIN, obj.name, obj.pose_chain) for obj in chain.objects]
        return {"transforms": [_transform(*pair) for pair in pairs]}

    def moving(self, chain: Chain, pose: FloatArray, objects: FloatArray | None) -> Message:
        """Return the message for /tf.

        Args:
            chain: What moves.
            pose: (3,) of the chain frame, or of the robot's frame, in the world.
            objects: (n, 3) of the objects in the world where they move on their own.
        """
        transforms = [_transform(self.odom, self.base, se2.compose(pose, chain.pusher.base_pose))]
        if objects is not None:
            transforms += [
                _transform(self.map, obj.name, place)
                for obj, place in zip(chain.objects, objects, strict=True)
            ]
        return {"transforms": transforms}


def turn(theta: float) -> Message:
    """Return a rotation in the plane as a quaternion."""
    return {"z": math.sin(0.5 * theta), "w": math.cos(0.5 * theta)}


def _transform(parent: str, child: str, pose: FloatArray) -> Message:
    x, y, theta = pose
    return {
        "header": {"frame_id": parent},
        "child_frame_id": child,
        "transform": {"translation": {"x": x, "y": y}, "rotation": turn(theta)},
    }
