"""Validation of plans over all segments and bodies, by code that the searches do not use."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import shapely

from pushplan.geometry import se2
from pushplan.geometry.polygon import TOUCH, find_touch, overlap_depth
from pushplan.mechanics.chain import Chain
from pushplan.planners.clearance import Collision, Motion, Moving, Room, Standing, excess, find_collisions
from pushplan.plans.execution import Execution
from pushplan.plans.load import Load
from pushplan.plans.segment import Poses, Segment, end_of
from pushplan.scenario.goals import EXACT
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import PolygonObstacle
from pushplan.util.arrays import FloatArray
from pushplan.util.names import APPROACH, CLOSE, PUSH, RETREAT, TRANSIT

STRAIGHT = 1e-9
"""Maximum turn (rad/m) and lateral motion (m/m) of an approach or a retreat."""

ROLLING = 1e-6
"""Tolerance of the axle's lateral speed, m/s: an absolute part, and the same for each m/s ahead and rad/s."""

NEAR = 1e-3
"""Maximum distance between checked poses of an approach or a retreat, m."""


class Validator:
    """Validator of a scenario's plans. The obstacles are prepared once.

    Args:
        scenario: Scenario with the obstacles, the initial poses and the goals.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._standing = Standing.of(tuple(scenario.obstacles))
        self._moving: dict[int, tuple[Chain, Moving]] = {}

    def of(self, scenario: Scenario) -> Validator:
        """Return the validator for a scenario with the same room and loads but other starts, goals or settings."""
        other: Validator = object.__new__(Validator)
        other._scenario, other._standing, other._moving = scenario, self._standing, self._moving
        return other

    def flaw(self, segments: tuple[Segment, ...], execution: Execution | None, stable_set: str | None = None) -> str:
        """Return why segments are no solution; empty if they are one.

        Args:
            segments: Segments with or without timing. Without it, only their paths are checked.
            execution: Execution of the segments; None without timing.
            stable_set: Name of the segments' stable set; None for the scenario's.
        """
        return (
            self._broken_joint(segments)
            or self._missed_goal(segments)
            or self._lost_contact(execution)
            or self._too_heavy(execution)
            or next(filter(None, self._flaws(segments, stable_set)), "")
        )

    def flaw_of(self, segment: Segment, stable_set: str | None = None) -> str:
        """Return the error of a single segment; empty if it is valid."""
        return next(self._flaws((segment,), stable_set))

    def _flaws(self, segments: tuple[Segment, ...], stable_set: str | None) -> Iterator[str]:
        """Yield the error of each segment; empty if it is valid."""
        if not segments:
            return
        motions = [self._motion(segment) for segment in segments]
        hits = find_collisions(self._room(segments), motions, self._scenario.clearance)
        overlaps = self._overlaps(segments, motions)
        for segment, hit, overlap in zip(segments, hits, overlaps, strict=True):
            beyond = self._beyond_drive(segment)
            if beyond or segment.load is None or not segment.pushes:
                yield beyond or self._flaw_alone(segment, hit, overlap)
                continue
            found = self._flaw_of_push(segment, segment.load, hit, stable_set)
            single = segment.load.problem is self._scenario
            yield found if single or not found else f"the push on {segment.load.face}: {found}"

    def too_near(self, load: Load, poses: FloatArray) -> bool:
        """Return whether a load is too near to an obstacle at any of the poses (m, 3) of its contact's frame."""
        room = Room((self._all(load.chain),), self._scenario.workspace, self._standing)
        clearance = self._scenario.clearance
        return bool((room.gaps(poses, 2.0 * clearance) <= clearance).any())

    def _broken_joint(self, segments: tuple[Segment, ...]) -> str:
        """Return an error if a segment does not begin where the one before ends, or moves an object unpushed."""
        plate, bodies = self._scenario.plate_start, self._scenario.poses
        for k, segment in enumerate(segments, start=1):
            if _apart({"plate": segment.path.start, **segment.before}, {"plate": plate, **bodies}) > EXACT:
                return f"segment {k}, a {segment.kind}, does not begin where the one before ends"
            expected = dict(segment.before)
            if segment.pushes and segment.load is not None:
                if _apart(segment.load.poses(segment.path.start), segment.before) > EXACT:
                    return f"segment {k}, a push, does not begin with its contacts closed"
                expected |= segment.load.poses(segment.path.end)
            if _apart(segment.after, expected) > (EXACT if segment.pushes else 0.0):
                return f"segment {k}, a {segment.kind}, moves an object that it does not push"
            plate, bodies = segment.path.end, dict(segment.after)
        return next(filter(None, (_wrong_order(a, b) for a, b in pairwise(segments))), "")

    def _missed_goal(self, segments: tuple[Segment, ...]) -> str:
        """Return an error if a goal is missed at the end. A single load must be exactly at its goal."""
        end = end_of(self._scenario, segments)
        return next(filter(None, (goal.shortfall(end) for goal in self._scenario.task.goals)), "")

    def _lost_contact(self, execution: Execution | None) -> str:
        """Return an error if an execution loses a contact."""
        if execution is None or execution.loss is None:
            return ""
        loss = execution.loss
        return (
            f"the plan does not hold when it is executed: contact {loss.contact} is lost after {loss.time:.2f} s, "
            f"with a margin of {loss.margin:.3g}"
        )

    def _too_heavy(self, execution: Execution | None) -> str:
        """Return an error if an execution needs more force than the robot has."""
        limit = self._scenario.pusher.limits.force
        needed = None if execution is None else execution.max_force()
        if needed is None or needed <= limit:
            return ""
        return f"the plan needs up to {needed:.6g} N when it is executed; robot.limits.force is {limit:.6g} N"

    def _beyond_drive(self, segment: Segment) -> str:
        """Return an error if the axle slides sideways or turns more tightly than the drive can."""
        pusher = self._scenario.pusher
        drive, moving = pusher.drive, segment.path if segment.trajectory is None else segment.trajectory
        if drive.axle is None or not len(moving.twists):
            return ""
        ahead, aside, turn = np.abs(se2.twist_of(se2.relative(pusher.plate_pose, drive.axle), moving.twists)).T
        beyond = np.maximum(aside, drive.min_radius * turn - ahead) - ROLLING * (ahead + turn)
        worst = int(np.argmax(beyond))
        if beyond[worst] <= ROLLING:
            return ""
        how = f"{ahead[worst]:.3g} m/s ahead, {aside[worst]:.3g} m/s sideways and {turn[worst]:.3g} rad/s"
        return f"the robot cannot drive the {segment.kind}: its axle ({drive.kind}) would move {how}"

    def _flaw_of_push(self, segment: Segment, load: Load, hit: Collision | None, stable_set: str | None) -> str:
        path, margin = segment.contact_path, segment.margin
        if segment.trajectory is not None:
            fast = excess(segment.contact_trajectory, load.chain.pusher.limits)
            if fast:
                return fast
        least = float(load.stable_set(stable_set).margin(path.twists).min())
        if least <= margin:
            return f"the path's smallest margin is {least:.3g}; it must be above {margin:g}"
        wrong = self._flaw_of_close(segment, load) if segment.kind == CLOSE else ""
        if wrong or hit is None:
            return wrong
        return f"the path is not free: {hit}; the clearance is {1e3 * self._scenario.clearance:.3g} mm"

    def _flaw_of_close(self, segment: Segment, load: Load) -> str:
        """Return an error if a close is not straight or does not end at its object."""
        twists = segment.path.twists
        if (np.abs(twists[:, 1:]) > STRAIGHT).any() or (twists[:, 0] <= 0.0).any():
            return "the close is not straight"
        outlines = {
            obj.name: se2.transform_points(segment.after[obj.name], obj.outline) for obj in self._scenario.objects
        }
        if segment.onto not in outlines or segment.onto in load.names:
            return f"the close ends at {segment.onto!r}, which is not there"
        onto = outlines[segment.onto]
        touches = [find_touch(outlines[name], onto) for name in load.names]
        if touches[-1] is None or len(touches[-1]) != 1 or any(touch is not None for touch in touches[:-1]):
            return f"the close does not end with only its last object along one line of '{segment.onto}'"
        deepest = max(overlap_depth(outlines[name], onto) for name in load.names)
        return f"the close ends {1e3 * deepest:.3g} mm inside '{segment.onto}'" if deepest > TOUCH else ""

    def _flaw_alone(self, segment: Segment, hit: Collision | None, overlap: str) -> str:
        """Return the error of a segment without a push: the robot exceeds a limit or is too near to something.

        The robot must move straight to or from the load that it approaches or leaves, without overlapping it.
        """
        if segment.trajectory is not None:
            fast = excess(segment.trajectory, self._scenario.pusher.limits)
            if fast:
                return f"{segment.kind}: {fast}"
        if hit is not None:
            return f"a {segment.kind} is not free: {hit}"
        if segment.kind == TRANSIT:
            return ""
        twists, sense = segment.path.twists, 1.0 if segment.kind == APPROACH else -1.0
        if (np.abs(twists[:, 1:]) > STRAIGHT).any() or (np.sign(twists[:, 0]) != sense).any():
            return f"the {segment.kind} is not straight"
        return f"'{overlap}' overlaps the load in the {segment.kind}" if overlap else ""

    def _overlaps(self, segments: tuple[Segment, ...], motions: list[Motion]) -> list[str]:
        """Return the part of the robot that overlaps the approached or left load, by segment; empty for none."""
        touched = [(k, name) for k, segment in enumerate(segments) for name in _touched(segment)]
        found = [""] * len(segments)
        if not touched:
            return found
        outlines = {obj.name: obj.outline for obj in self._scenario.objects}
        placed = [se2.transform_points(segments[k].before[name], outlines[name]) for k, name in touched]
        # Shrunk by the allowed overlap of touching bodies.
        bodies = shapely.buffer([shapely.Polygon(outline) for outline in placed], -2.0 * TOUCH)
        motion, begins = Motion.joined([motions[k] for k, _ in touched])
        wholes = [motions[k].travel[-1] for k, _ in touched]
        counts = [int(np.ceil(whole / NEAR)) + 1 for whole in wholes]
        case = np.repeat(np.arange(len(touched)), counts)
        spans = zip(begins, wholes, counts, strict=True)
        along = motion.at(np.concatenate([begin + np.linspace(0.0, whole, n) for begin, whole, n in spans]))
        for part in self._scenario.loads[0].chain.carried:
            corners = along[:, None, :2] + se2.rotate(along[:, 2:], part.outline)
            for k in case[shapely.intersects(np.asarray(shapely.polygons(corners)), bodies[case])]:
                found[touched[k][0]] = found[touched[k][0]] or part.name
        return found

    def _motion(self, segment: Segment) -> Motion:
        """Return the motion of the frame of a segment's contact, or without one, of the first load's contact."""
        chain = self._scenario.loads[0].chain if segment.load is None or not segment.pushes else segment.load.chain
        if segment.pushes:
            if segment.trajectory is None:
                return Motion.along(segment.contact_path, chain.reach)
            return Motion.sampled(segment.contact_trajectory, chain.reach)
        plate = segment.path.knots if segment.trajectory is None else segment.trajectory.poses
        return Motion.through(se2.compose(plate, se2.inverse(chain.pusher.plate_pose)), chain.reach)

    def _room(self, segments: tuple[Segment, ...]) -> Room:
        """Return the room with the moving bodies and the obstacles of each segment."""
        chain = self._scenario.loads[0].chain
        alone = Moving.of(chain.carried)
        moving = [alone if s.load is None or not s.pushes else self._all(s.load.chain) for s in segments]
        outlines = {obj.name: obj.outline for obj in self._scenario.objects}
        places: dict[tuple[str, bytes], int] = {}
        resting: list[PolygonObstacle] = []
        pairs = []
        for case, segment in enumerate(segments):
            for name, pose in segment.standing().items():
                if name not in outlines or name == segment.onto or name in _touched(segment):
                    continue
                place = (name, np.asarray(pose).tobytes())
                if place not in places:
                    places[place] = len(resting)
                    resting.append(PolygonObstacle(se2.transform_points(pose, outlines[name])))
                pairs.append((case, places[place]))
        rests = np.zeros((len(segments), len(resting)), dtype=np.bool_)
        rests[tuple(np.array(pairs, dtype=int).reshape(-1, 2).T)] = True
        return Room(tuple(moving), self._scenario.workspace, self._standing, Standing.of(tuple(resting)), rests)

    def _all(self, chain: Chain) -> Moving:
        """Return all bodies that move with a chain; cached."""
        if id(chain) not in self._moving:
            self._moving[id(chain)] = (
                chain,
                Moving.of(chain.bodies),
            )  # the chain is kept, so that its id stays unique
        return self._moving[id(chain)][1]


def _touched(segment: Segment) -> tuple[str, ...]:
    """Return the bodies that the robot approaches or leaves."""
    return () if segment.load is None or segment.pushes or segment.kind == TRANSIT else segment.load.names


def _apart(poses: Poses, others: Poses) -> float:
    """Return the largest error (m or rad) between poses and others with the same names."""
    both = [(pose, others[name]) for name, pose in poses.items() if pose is not others[name]]
    return float(max((max(se2.pose_error(*pair)) for pair in both), default=0.0))


def _wrong_order(first: Segment, second: Segment) -> str:
    """Return an error if a push does not follow its approach or is not followed by its retreat.

    A close follows a push of the same load. After it, the load is left, or pushed on with the object that it closed
    onto.
    """
    same = first.load is second.load
    if second.pushes and not (same and first.kind == (APPROACH if second.kind == PUSH else PUSH)):
        taken = first.kind == CLOSE and second.kind == PUSH and _is_taken(first, second)
        if not taken:
            face = second.load.face if second.load else "?"
            return f"the {second.kind} on {face} does not follow an approach to it"
    if first.pushes and not second.pushes and not (second.kind == RETREAT and same):
        return f"the {first.kind} on {first.load.face if first.load else '?'} is not followed by a retreat from it"
    return ""


def _is_taken(close: Segment, push: Segment) -> bool:
    """Return whether a push moves the load of a close together with the object that it closed onto."""
    held, (*before, taken) = close.pushed_load, push.pushed_load.links
    return tuple(before) == held.links and (taken.object, taken.pusher) == (close.onto, held.names[-1])
