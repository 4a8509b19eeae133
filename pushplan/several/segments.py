"""From the sequence that a search found to segments, and to the trajectory through all of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.planners.multi.graph import PushSequence
from pushplan.planners.multi.room import PushRoom
from pushplan.planners.timing.arc_limits import Bounds
from pushplan.planners.timing.exact_timing import time_path
from pushplan.planners.trajectories import make_trajectory
from pushplan.plans.path import PushPath
from pushplan.plans.segment import Segment, join_trajectories
from pushplan.plans.trajectory import SAMPLE_RATE, Trajectory
from pushplan.scenario.model import Goal, Scenario
from pushplan.several.modes import Mode
from pushplan.util.arrays import FloatArray
from pushplan.util.names import APPROACH, PUSH, RETREAT, TRANSIT

NOTHING = np.zeros(3)
AHEAD = np.array([[1.0, 0.0, 0.0]])

SHORTEST_ARC = 1e-12
"""Arcs below this (m) are left out."""


def segments_of(room: PushRoom, robot: FloatArray, sequence: PushSequence) -> tuple[Segment, ...]:
    """Return the segments of a plan, not timed.

    Args:
        room: That it was found in.
        robot: (3,) pose of the robot's frame before it.
        sequence: What was found.
    """
    pushes = room.scenario.pushes
    assert pushes is not None
    found: list[Segment] = []
    at = np.array(robot)
    for step in sequence.steps:
        contact = room.contacts[step.contact]
        place, mode = contact.mode.place, contact.mode
        where = (place.face, place.offset)
        push = _path(se2.compose(step.before, place.contact), step.arcs)
        near = se2.compose(push.start, mode.robot)
        far = se2.compose(near, [-pushes.approach, 0.0, 0.0])
        if len(step.transit):
            found.append(_alone(TRANSIT, ("", 0.0), _path(at, step.transit), step.before))
        found.append(_alone(APPROACH, where, _straight(far, pushes.approach), step.before))
        margin = contact.margin
        found.append(Segment(PUSH, *where, push, mode.robot, step.before, step.after, margin))
        left = se2.compose(push.end, mode.robot)
        found.append(_alone(RETREAT, where, _straight(left, -pushes.retreat), step.after))
        at = found[-1].path.end
    return tuple(found)


def _alone(kind: str, where: tuple[str, float], path: PushPath, load: FloatArray) -> Segment:
    return Segment(kind, *where, path, NOTHING, load, load)


def _path(start: FloatArray, arcs: FloatArray) -> PushPath:
    kept = arcs[arcs[:, 3] > SHORTEST_ARC]
    return PushPath(start, kept[:, :3], kept[:, 3])


def _straight(start: FloatArray, length: float) -> PushPath:
    """A straight way ahead, or back where the length is negative."""
    return PushPath(start, np.copysign(1.0, length) * AHEAD, np.array([abs(length)]))


def mode_of(segment: Segment, modes: tuple[Mode, ...]) -> Mode:
    """Return the contact of a push.

    Raises:
        PushplanError: When there is no such contact.
    """
    for mode in modes:
        if mode.place.face == segment.face and mode.place.offset == segment.offset:
            return mode
    raise PushplanError(f"no contact is at {segment.face} with an offset of {segment.offset} m")


def push_problem(segment: Segment, mode: Mode) -> Scenario:
    """Return a push of a plan as a push problem of its own."""
    goal = se2.compose(segment.load_after, mode.place.contact)
    tolerance = mode.scenario.goal
    return replace(
        mode.scenario.with_margin(segment.margin),
        start=segment.path.start,
        goal=Goal(goal, None, goal, tolerance.position_tolerance, tolerance.angle_tolerance),
        name=f"{mode.scenario.name}: {segment.face}",
    )


def timed(
    scenario: Scenario,
    segments: tuple[Segment, ...],
    modes: tuple[Mode, ...],
    rate: float = SAMPLE_RATE,
) -> tuple[tuple[Segment, ...], Trajectory]:
    """Return the segments with their times and the trajectory of the robot's frame, within the pusher's limits.

    Args:
        scenario: Limits, and how a push is timed.
        segments: Of a plan.
        modes: The contacts.
        rate: Samples per second.

    Raises:
        TimingError: When an arc cannot be timed within the limits.
    """
    alone = Bounds(scenario.chain.pusher.limits)
    with_times, whole = join_trajectories(
        segments,
        [
            _timed_push(segment, mode_of(segment, modes), rate)
            if segment.pushes
            else time_path(segment.path, alone, rate)
            for segment in segments
        ],
    )
    return with_times, replace(whole, base=scenario.chain.pusher.base_pose)


def _timed_push(segment: Segment, mode: Mode, rate: float) -> Trajectory:
    problem = push_problem(segment, mode)
    return make_trajectory(problem, segment.path, mode.stable, rate)
