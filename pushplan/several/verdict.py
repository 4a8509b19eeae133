"""Whether a plan of several pushes is a solution: judged by code that the search does not use."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import shapely

from pushplan.geometry import se2
from pushplan.geometry.contact_segments import TOUCH
from pushplan.planners.validation.clearance import Motion, Room, collision_along, densify, excess
from pushplan.planners.validation.verdict import EXACT, flaw_along
from pushplan.plans.execution import Execution
from pushplan.plans.segment import Segment, trajectory_of
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import PolygonObstacle
from pushplan.several.execution import reached_goal
from pushplan.several.modes import Mode
from pushplan.several.segments import mode_of, push_problem
from pushplan.util.arrays import FloatArray
from pushplan.util.names import APPROACH, RETREAT, TRANSIT

STRAIGHT = 1e-9
"""What an approach or a retreat may turn or move sideways, rad or m for each m."""

NEAR = 1e-3
"""Poses of an approach or a retreat that are looked at are no farther apart, m."""


def verdict_on(
    scenario: Scenario,
    segments: tuple[Segment, ...],
    trajectory: Trajectory,
    execution: Execution,
    modes: tuple[Mode, ...],
) -> str:
    """Return why several pushes are no solution, empty if they are one."""
    if execution.loss is not None:
        loss = execution.loss
        return (
            f"a contact is lost in the execution, after {loss.time:.2f} s, with a margin of {loss.margin:.3g}"
        )
    return (
        _broken_joint(scenario, segments)
        or _missed_goal(scenario, segments)
        or next(filter(None, (_flaw(scenario, s, trajectory, modes) for s in segments)), "")
    )


def _broken_joint(scenario: Scenario, segments: tuple[Segment, ...]) -> str:
    """Return where a segment does not begin where the one before has ended, robot and load alike."""
    robot, load = scenario.robot_start, scenario.start
    for k, segment in enumerate(segments):
        begin, end = _robot_ends(segment)
        if max(*se2.pose_error(begin, robot), *se2.pose_error(segment.load_before, load)) > EXACT:
            return f"segment {k + 1}, a {segment.kind}, does not begin where the one before ends"
        if not segment.pushes and max(se2.pose_error(segment.load_before, segment.load_after)) > 0.0:
            return f"segment {k + 1}, a {segment.kind}, moves the load"
        robot, load = end, segment.load_after
    return next(filter(None, (_wrong_order(a, b) for a, b in pairwise(segments))), "")


def _robot_ends(segment: Segment) -> tuple[FloatArray, FloatArray]:
    path = segment.path
    return se2.compose(path.start, segment.robot), se2.compose(path.end, segment.robot)


def _wrong_order(first: Segment, second: Segment) -> str:
    """Return that a push does not follow the approach to its contact, or is not followed by the retreat from it."""
    same = (first.face, first.offset) == (second.face, second.offset)
    if second.pushes and not (first.kind == APPROACH and same):
        return f"the push on {second.face} does not follow an approach to it"
    if first.pushes and not (second.kind == RETREAT and same):
        return f"the push on {first.face} is not followed by a retreat from it"
    return ""


def _missed_goal(scenario: Scenario, segments: tuple[Segment, ...]) -> str:
    end = segments[-1].load_after
    position, angle = se2.pose_error(end, reached_goal(scenario, end).pose_chain)
    return (
        ""
        if max(position, angle) <= EXACT
        else f"the plan misses the goal by {position:.2g} m and {angle:.2g} rad"
    )


def _flaw(scenario: Scenario, segment: Segment, trajectory: Trajectory, modes: tuple[Mode, ...]) -> str:
    """Return what is wrong with a segment."""
    own = trajectory_of(segment, trajectory)
    fast = excess(own, scenario.chain.pusher.limits)
    if fast:
        return f"{segment.kind}: {fast}"
    if segment.pushes:
        return _flaw_of_push(segment, own, mode_of(segment, modes))
    return _flaw_alone(scenario, segment, own)


def _flaw_of_push(segment: Segment, own: Trajectory, mode: Mode) -> str:
    problem = push_problem(segment, mode)
    missed = max(se2.pose_error(segment.path.end, problem.goal.pose_chain))
    if missed > EXACT:
        return f"the push on {segment.face} misses where it is to end by {missed:.2g}"
    motion = Motion.through(own.poses, problem.chain.reach)
    found = flaw_along(problem, mode.stable, segment.path, motion)
    return f"the push on {segment.face}: {found}" if found else ""


def _flaw_alone(scenario: Scenario, segment: Segment, own: Trajectory) -> str:
    """Return what the robot alone comes too near to: the room, and the load unless it comes up to it or backs off."""
    reach = scenario.chain.reach
    outlines = [
        se2.transform_points(segment.load_before, obj.outline_chain) for obj in scenario.chain.objects
    ]
    standing = scenario.obstacles
    if segment.kind == TRANSIT:
        standing = (*standing, *(PolygonObstacle(outline) for outline in outlines))
    # The robot alone: the objects are among what stands in its way.
    room = Room.of(replace(scenario, obstacles=standing)).only(range(len(scenario.chain.carried)))
    hit = collision_along(scenario, Motion.through(own.poses, reach), room)
    if hit is not None:
        return f"a {segment.kind} is not free: {hit}"
    return "" if segment.kind == TRANSIT else _flaw_of_contact(scenario, segment, own, outlines)


def _flaw_of_contact(
    scenario: Scenario, segment: Segment, own: Trajectory, outlines: list[FloatArray]
) -> str:
    """Return that the robot does not go straight to the load, or straight back, or overlaps it on the way."""
    twists = segment.path.twists
    sense = 1.0 if segment.kind == APPROACH else -1.0
    if (np.abs(twists[:, 1:]) > STRAIGHT).any() or (np.sign(twists[:, 0]) != sense).any():
        return f"a {segment.kind} is not straight"
    for pose in densify(own.poses, scenario.chain.reach, NEAR):
        for body in scenario.chain.carried:
            moved = shapely.Polygon(se2.transform_points(pose, body.outline))
            # Drawn in by what touching bodies may overlap.
            if any(moved.intersects(shapely.Polygon(o).buffer(-2.0 * TOUCH)) for o in outlines):
                return f"'{body.name}' overlaps the load in a {segment.kind}"
    return ""
