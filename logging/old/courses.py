"""Measured pushes out of run logs: where plate and objects were and how it pushed, as measured or as simulated."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.PosesInFrame_pb2 import PosesInFrame
from google.protobuf.message import DecodeError
from google.protobuf.timestamp_pb2 import Timestamp

from pushplan.errors import RunLogError
from pushplan.geometry import se2
from pushplan.logging.mcap_file import McapFile, Message
from pushplan.logging.old.messages.schemas import PUSHER_WRENCH, TF, MessageClass, Wrench
from pushplan.logging.old.reader import read_run
from pushplan.logging.old.view.scene import CHAIN, WORLD
from pushplan.scenario.model import Scenario
from pushplan.sim.identify.course import Course
from pushplan.util.arrays import FloatArray

MEASURED = "/measured"
"""Poses of the objects in the world, in the chain's order, stamped with when they were taken."""

_NEEDED = (
    "a log of an execution whose contacts may slip (pushplan trial --worst), or one with the objects' poses "
    "on /measured"
)
_KEPT = 1 << 9
"""Memory charged for a pose, bytes."""


def read_course(path: Path | str) -> tuple[Scenario, Course]:
    """Return the scenario of a log, and what was measured of its push.

    Raises:
        RunLogError: When the log cannot be read, or tells nothing of where the objects were.
    """
    run = read_run(path)
    if run.scenario.pushes is not None:
        raise RunLogError(str(path), "a run of several pushes; only runs of one push can be learned from")
    reading = _Poses([obj.name for obj in run.scenario.chain.objects])
    file = McapFile(Path(path), recover=bool(run.losses), topics={TF.name, MEASURED, PUSHER_WRENCH.name})
    for item in file.items():
        if isinstance(item, Message):
            file.keep(_KEPT, item.offset)
            try:
                reading.take(item)
            except (DecodeError, ValueError) as error:
                raise RunLogError(str(path), f"a message on {item.topic}: {error}", item.offset) from error
    executed = run.execution
    if executed is not None and executed.object_poses is not None and not reading.measured:
        return run.scenario, Course(executed.poses, executed.object_poses, str(path), executed.wrenches)
    plate, objects, wrenches = reading.finish(str(path))
    return run.scenario, Course(plate, objects, str(path), wrenches)


class _Poses:
    """Gathers poses of plate and objects, and wrenches of the plate, from messages.

    Attributes:
        measured: Poses of the objects on /measured, by time.
    """

    def __init__(self, names: list[str]) -> None:
        self._names = names
        self._plate: dict[float, list[float]] = {}
        self._objects: dict[float, list[list[float]]] = {}
        self._wrenches: dict[float, list[float]] = {}
        self.measured: dict[float, list[list[float]]] = {}

    def take(self, message: Message) -> None:
        """Take the next message; of the same time, the last one counts.

        Raises:
            ValueError: When it holds another number of objects, or numbers that are not finite.
        """
        if message.topic == TF.name:
            self._take_frames(FrameTransforms.FromString(bytes(message.data)))
            return
        if message.topic == PUSHER_WRENCH.name:
            self._take_wrench(Wrench.FromString(bytes(message.data)))
            return
        found = PosesInFrame.FromString(bytes(message.data))
        if len(found.poses) != len(self._names):
            raise ValueError(f"{len(found.poses)} objects instead of {len(self._names)}")
        poses = [_pose(p.position.x, p.position.y, p.orientation) for p in found.poses]
        self.measured[_seconds(found.timestamp)] = poses

    def _take_wrench(self, message: MessageClass) -> None:
        wrench = [message.fx, message.fy, message.torque]
        if message.frame_id != CHAIN:
            raise ValueError(f"a wrench in frame {message.frame_id!r}; it has to be in {CHAIN!r}")
        if not all(math.isfinite(number) for number in wrench):
            raise ValueError(f"the wrench {wrench} is not finite")
        self._wrenches[_seconds(message.timestamp)] = wrench

    def _take_frames(self, message: FrameTransforms) -> None:
        frames = {one.child_frame_id: one for one in message.transforms}
        if CHAIN not in frames:
            return
        time = _seconds(frames[CHAIN].timestamp)
        place = {
            name: _pose(one.translation.x, one.translation.y, one.rotation) for name, one in frames.items()
        }
        self._plate[time] = place[CHAIN]
        # Objects that are fixed to the plate have no time: nobody looked where they really were.
        if all(name in frames and _seconds(frames[name].timestamp) == time for name in self._names) and time:
            self._objects[time] = [
                place[name]
                if frames[name].parent_frame_id == WORLD
                else se2.compose(place[CHAIN], place[name]).tolist()
                for name in self._names
            ]

    def finish(self, path: str) -> tuple[FloatArray, FloatArray, FloatArray | None]:
        """Return poses of the plate (m, 3) and of the objects (m, n, 3), and wrenches (m, 3), at the same times.

        Raises:
            RunLogError: When there are none.
        """
        found = self.measured or self._objects
        if len(found) < 3:
            raise RunLogError(path, f"nobody measured where the objects went; learning needs {_NEEDED}")
        times, known = np.array(sorted(found)), np.array(sorted(self._plate))
        if not len(known):
            raise RunLogError(path, f"the log does not say where the plate was; learning needs {_NEEDED}")
        pushed = np.array(sorted(self._wrenches))
        for spans in (known, pushed) if len(pushed) else (known,):
            times = times[(times >= spans[0]) & (times <= spans[-1])]
        plate = np.array([self._plate[time] for time in known])
        plate[:, 2] = np.unwrap(plate[:, 2])
        wrenches = np.array([self._wrenches[time] for time in pushed])
        return (
            _at(times, known, plate),
            np.array([found[time] for time in times]),
            _at(times, pushed, wrenches) if len(pushed) else None,
        )


def _at(times: FloatArray, known: FloatArray, rows: FloatArray) -> FloatArray:
    """Return rows (k, 3), known at some times, at others (m, 3)."""
    return np.stack([np.interp(times, known, column) for column in rows.T], axis=1)


def _pose(x: float, y: float, rotation: object) -> list[float]:
    z, w = float(getattr(rotation, "z")), float(getattr(rotation, "w"))  # noqa: B009
    pose = [x, y, 2.0 * math.atan2(z, w)]
    if not all(math.isfinite(value) for value in pose):
        raise ValueError(f"the pose {pose} is not finite")
    return pose


def _seconds(stamp: Timestamp) -> float:
    return float(stamp.seconds) + 1e-9 * stamp.nanos
