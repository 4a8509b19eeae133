"""The segments of a plan of several pushes: the robot drives, comes up to a face, pushes, and backs off.

The *robot's frame* is fixed to plate and robot; it is where the chain frame is while the plate pushes the chain as
the scenario states it. A push is described in the chain frame of its own contact, which lies beside it by y only.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.plans.path import PushPath, cost_rate
from pushplan.plans.trajectory import Trajectory
from pushplan.util.arrays import FloatArray, frozen
from pushplan.util.names import PUSH, SEGMENT_KINDS


@dataclass(frozen=True, eq=False)
class Segment:
    """A part of a plan of several pushes, from rest to rest.

    Attributes:
        kind: One of `names.SEGMENT_KINDS`.
        face: That the plate drives up to, pushes or leaves; empty for a transit.
        offset: Of the plate's middle from that of the face, to the left of the push, m; 0 for a transit.
        path: Of the robot's frame, or of the contact's chain frame in a push.
        robot: (3,) pose of the robot's frame in the frame of the path.
        load_before: (3,) pose in the world of the frame that the objects' poses are in: the scenario's chain frame.
        load_after: The same at the end.
        margin: That the twists of a push exceed; 0 for others.
        t0: When it begins, s.
        t1: When it ends, s.
        objects: Names of those that the load is, where others stand apart from it; empty stands for all.
    """

    kind: str
    face: str
    offset: float
    path: PushPath
    robot: FloatArray
    load_before: FloatArray
    load_after: FloatArray
    margin: float = 0.0
    t0: float = 0.0
    t1: float = 0.0
    objects: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.kind not in SEGMENT_KINDS:
            raise PushplanError(f"no segment is a {self.kind!r}; there are {', '.join(SEGMENT_KINDS)}")
        for name in ("robot", "load_before", "load_after"):
            object.__setattr__(self, name, frozen(getattr(self, name), (3,), name))

    @property
    def pushes(self) -> bool:
        """Whether the load moves."""
        return self.kind == PUSH

    def at(self, t0: float, t1: float) -> Segment:
        """Return it with its times."""
        return replace(self, t0=t0, t1=t1)

    def of_robot(self, twists: FloatArray) -> FloatArray:
        """Return twists (..., 3) of the path's frame as twists of the robot's frame."""
        return moved_along_y(twists, float(self.robot[1]))

    def of_path(self, twists: FloatArray) -> FloatArray:
        """Return twists (..., 3) of the robot's frame as twists of the path's frame."""
        return moved_along_y(twists, -float(self.robot[1]))

    @property
    def robot_path(self) -> PushPath:
        """The path of the robot's frame."""
        twists = self.of_robot(self.path.twists)
        rate = cost_rate(twists)
        start = se2.compose(self.path.start, self.robot)
        return PushPath(start, twists / rate[:, None], self.path.lengths * rate)

    def load_at(self, poses: FloatArray) -> FloatArray:
        """Return where the load is (m, 3) with the robot's frame at poses (m, 3)."""
        if not self.pushes:
            return np.broadcast_to(self.load_before, poses.shape)
        at_first = se2.compose(self.path.start, self.robot)
        return se2.compose(poses, se2.relative(at_first, self.load_before))


def moved_along_y(twists: FloatArray, y: float) -> FloatArray:
    """Return body twists (..., 3) as those of a frame that lies beside by `y`, m."""
    moved = np.array(twists, dtype=np.float64)
    moved[..., 0] -= y * moved[..., 2]
    return moved


def join_paths(segments: tuple[Segment, ...]) -> PushPath:
    """Return the path of the robot's frame through all segments."""
    paths = [segment.robot_path for segment in segments]
    lengths = np.concatenate([path.lengths for path in paths])
    return PushPath(paths[0].start, np.concatenate([path.twists for path in paths]), lengths)


def join_trajectories(
    segments: tuple[Segment, ...], trajectories: list[Trajectory]
) -> tuple[tuple[Segment, ...], Trajectory]:
    """Return the segments with their times, and the trajectory of the robot's frame through all of them.

    Args:
        segments: In their order.
        trajectories: Of each in the frame of its path, from rest to rest.
    """
    timed, breaks, coefficients, arcs = [], [np.zeros(1)], [], []
    now, before = 0.0, 0
    for segment, trajectory in zip(segments, trajectories, strict=True):
        own = now + trajectory.breaks
        breaks.append(own[1:])
        timed.append(segment.at(now, float(own[-1])))
        coefficients.append(segment.of_robot(trajectory.coefficients))
        arcs.append(before + trajectory.arc)
        now, before = float(own[-1]), before + len(segment.path.lengths)
    start = se2.compose(segments[0].path.start, segments[0].robot)
    whole = Trajectory(
        start,
        np.concatenate(breaks),
        np.concatenate(coefficients),
        np.concatenate(arcs),
        trajectories[0].rate,
    )
    return tuple(timed), whole


def trajectory_of(segment: Segment, whole: Trajectory) -> Trajectory:
    """Return the part of the robot's trajectory that a segment is, in the frame of its path, from time 0 on."""
    first, last = np.searchsorted(whole.breaks, [segment.t0, segment.t1])
    breaks = whole.breaks[first : last + 1] - segment.t0
    arc = whole.arc[first:last]
    least = float(arc.min(initial=np.inf))
    return Trajectory(
        segment.path.start,
        breaks,
        segment.of_path(whole.coefficients[first:last]),
        arc - (least if np.isfinite(least) else 0.0),
        whole.rate,
    )
