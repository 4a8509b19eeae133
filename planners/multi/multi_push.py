"""Search for several pushes of one load, with successively lower margins, and its conversion to segments."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np
import shapely

from pushplan.core.collision import SLACK, separations
from pushplan.errors import EmptyStableSetError, PlanningError
from pushplan.geometry import se2
from pushplan.mechanics.chain import area_at
from pushplan.planners.infeasible.diagnosis import Passages, beyond_reach
from pushplan.planners.infeasible.ways import largest_disc, near_to
from pushplan.planners.multi.contact_modes import ContactMode, find_modes
from pushplan.planners.multi.graph import PushSequence
from pushplan.planners.multi.room import AHEAD, Contact, PushRoom, Query
from pushplan.planners.multi.search import Found, Limits, search
from pushplan.planners.outcome import Budget, Improvements, Outcome, Question, Segments, TaskSearch
from pushplan.plans.diagnosis import Diagnosis
from pushplan.plans.path import PushPath
from pushplan.plans.plan import Nearest
from pushplan.plans.segment import Poses, Segment
from pushplan.plans.settings import Observer, PlanSettings
from pushplan.scenario.model import Scenario
from pushplan.scenario.one_load import load_errors
from pushplan.sets.force_limited_set import too_heavy_ahead
from pushplan.util.arrays import FloatArray
from pushplan.util.names import APPROACH, PUSH, RETREAT, TRANSIT, TRANSIT_CLEARANCE

PATIENCE = 0.5
"""Share of the remaining time that a margin may use without a plan before a lower one is tried."""

BOXED_IN = "boxed in"

OFFSETS_TRIED = (0.1, 0.2, 0.3, 0.4, 0.5)
"""Lateral offsets of the plate that are tried for a hint, as shares of its width."""


class MultiPushSearch(TaskSearch):
    """Search for several pushes of one load. Data that do not depend on start and goals are cached.

    Args:
        scenario: Load, room and settings.
        modes: Contact modes.
        rooms: Rooms computed earlier, by level of the margin.
        twin: Search for a load that differs only in name and pose. Data are shared with it.
    """

    def __init__(
        self,
        scenario: Scenario,
        modes: tuple[ContactMode, ...],
        rooms: dict[int, PushRoom] | None = None,
        twin: MultiPushSearch | None = None,
    ) -> None:
        self.scenario, self.modes, self._twin = scenario, modes, twin
        self._rooms = {} if rooms is None else rooms

    @classmethod
    def of(cls, scenario: Scenario, settings: PlanSettings) -> MultiPushSearch:
        """Return the search for a scenario.

        Raises:
            EmptyStableSetError: If no contact can push the load.
        """
        return cls(scenario, find_modes(scenario, settings))

    def of_twin(self, scenario: Scenario) -> MultiPushSearch:
        """Return the search for an object that differs only in name, pose and goals."""
        return MultiPushSearch(scenario, tuple(mode.of_twin(scenario) for mode in self.modes), twin=self)

    @property
    def set_name(self) -> str:
        """Name of the stable set."""
        return self.modes[0].stable.name

    @property
    def levels(self) -> int:
        """Number of margins that can be tried."""
        return max(len(mode.margins) for mode in self.modes)

    def room(self, level: int) -> PushRoom:
        """Return robot, load and contacts in the room, with the margins of a level.

        Raises:
            EmptyStableSetError: If no contact can be reached and pushed straight ahead.
        """
        if level not in self._rooms and self._twin is not None:
            self._rooms[level] = self._twin.room(level).of_twin(self.scenario, self.modes)
        elif level not in self._rooms:
            room = PushRoom.of(self.scenario, self.modes, level)
            if not room.contacts:
                heavy = "".join(
                    f"; {mode.place.face}: {why}" for mode in self.modes if (why := too_heavy_ahead(mode.stable))
                )
                raise EmptyStableSetError(
                    "no contact can be used: the robot touches the load elsewhere when it approaches a face, or no "
                    f"straight push is stable{heavy}; try other pusher.faces, other pusher.offsets or a smaller "
                    "stability.margin"
                )
            self._rooms[level] = room
        return self._rooms[level]

    def with_obstacles(self, scenario: Scenario) -> MultiPushSearch:
        """Return the search for a scenario that differs only in its obstacles."""
        rooms = {level: room.with_obstacles(scenario) for level, room in self._rooms.items()}
        return MultiPushSearch(scenario, self.modes, rooms)

    def asked(self, scenario: Scenario) -> MultiPushSearch:
        """Return the search for a scenario that differs only in start, goals and robot pose."""
        rooms = {level: replace(room, scenario=scenario) for level, room in self._rooms.items()}
        return MultiPushSearch(scenario, self.modes, rooms)

    def plates_before(self, load: FloatArray, away: float | None = None) -> FloatArray:
        """Return the plate poses (k, 3) at a distance behind each contact, m, with the load at a pose (3,).

        Without a distance, it is that of the approach.
        """
        pushes, plate = self.scenario.transport, self.scenario.chain.pusher.plate_pose
        robots = [se2.compose(mode.place.contact, mode.robot) for mode in self.modes]
        behind = pushes.approach if away is None else away
        before = se2.compose(se2.compose(load, np.array(robots)), [-behind, 0.0, 0.0])
        return np.asarray(se2.compose(before, plate))

    def cut_off(self, passages: Passages) -> Diagnosis | None:
        """Return a proof that the load or the robot cannot pass the fixed obstacles to a goal; None without one."""
        scenario = self.scenario
        chain, name = scenario.chain, scenario.load.name
        goals = scenario.goals[name]
        within = max(g.position_tolerance + g.angle_tolerance * chain.reach for g in goals)
        own, robot = largest_disc(chain.bodies[len(chain.carried) :]), largest_disc(chain.carried)
        into = se2.inverse(chain.pusher.plate_pose)
        last = np.concatenate([self.plates_before(goal.pose_chain, 0.0) for goal in goals])
        ends = [robot.at(pose) for pose in se2.compose(last, into)]
        begin = robot.at(se2.compose(scenario.plate_start, into))
        return passages.fault(
            f"'{name}'", own, own.at(scenario.start), [own.at(goal.pose_chain) for goal in goals], within
        ) or passages.fault("the robot", robot, begin, ends, within, f"to the goal of '{name}'")

    def search(self, question: Question, budget: Budget, observer: Observer) -> Outcome:
        """Return the best plan found; see `TaskSearch.search`."""
        if question.scenario is not self.scenario:
            return self.asked(question.scenario).search(question, budget, observer)
        scenario, began, limit = self.scenario, budget.began, budget.time_limit
        goals = free_goals(scenario)
        proof = self._proof()
        if proof is not None:
            return Outcome.without_plan(proof, min(mode.margin(self.levels - 1) for mode in self.modes))
        improvements = Improvements(observer, began)
        share, batches = 0.0, 0
        for level in range(self.levels):
            last = level + 1 == self.levels
            share = 1.0 if last else share + PATIENCE * (1.0 - share)
            room = self.room(level)
            query = Query(backed_off(room, scenario), np.array(scenario.start), goals)
            patience = began + share * limit
            limits = Limits(budget.until, patience, budget.first, budget.iterations, budget.gap, observer.cancelled)

            def improved(best: PushSequence, done: int, room: PushRoom = room, before: int = batches) -> None:
                improvements.add(best.cost, before + done, self.segments(room, best, scenario.poses))

            found = search(room, query, limits, budget.seed, improved)
            batches += found.batches
            if found.best is not None or limits.over(0):
                break
        candidates = () if found.best is None else (self.segments(room, found.best, scenario.poses),)
        return Outcome(
            candidates,
            *least_margins(self.modes, candidates, level),
            batches,
            tuple(improvements.found),
            lambda segments: plan_cost(scenario, segments),
            found.lower_bound,
            explain=lambda: _explanation(room, query, found, limit),
        )

    def why_not(self) -> tuple[str, str]:
        """Return what start and goals alone show: the reasons for failure, or else the faces that can be reached.

        Both are empty if they show none and the robot can drive up to all faces.
        """
        try:
            goals = free_goals(self.scenario)
        except PlanningError as error:
            return str(error), ""
        room = self.room(0)
        query = Query(backed_off(room, self.scenario), np.array(self.scenario.start), goals)
        found = search(room, query, Limits(math.inf, first=True, iterations=0), 0)
        reasons = "; ".join(reason.text for reason in _reasons(room, query, found))
        return reasons, "" if reasons else _few_faces(room, query, found)

    def _proof(self) -> Diagnosis | None:
        """Return a proof that the robot cannot reach the load or bring it to a goal; None without one."""
        scenario = self.scenario
        outlines = [se2.transform_points(scenario.start, obj.outline_chain) for obj in scenario.chain.objects]
        proofs = beyond_reach(scenario, {"load": outlines}, {"load": self.plates_before(scenario.start)})
        return proofs.get("") or self.cut_off(Passages(scenario))

    def segments(self, room: PushRoom, sequence: PushSequence, before: Poses) -> Segments:
        """Return the segments of a push sequence, without timing.

        Args:
            room: Room of the search.
            sequence: Pushes and transits.
            before: Poses of all bodies at the beginning.
        """
        scenario = room.scenario
        pushes, plate = scenario.transport, scenario.chain.pusher.plate_pose
        at = backed_off(room, scenario)
        found: list[Segment] = []
        away = float(np.linalg.norm(scenario.robot_start[:2] - at[:2]))
        if away > 0.0:
            load = self.modes[0].load
            near = replace(load, links=tuple(replace(link, face="", offset=0.0) for link in load.links))
            back = _straight(scenario.robot_start, -away)
            found.append(Segment(RETREAT, back.of_frame(plate), before, before, near))
        for step in sequence.steps:
            contact = room.contacts[step.contact]
            mode, load = contact.mode, contact.mode.load
            push = PushPath.of_arcs(se2.compose(step.before, mode.place.contact), step.arcs)
            far = se2.compose(se2.compose(push.start, mode.robot), [-pushes.approach, 0.0, 0.0])
            if len(step.transit):
                transit = PushPath.of_arcs(at, step.transit).of_frame(plate)
                found.append(Segment(TRANSIT, transit, before, before))
            ahead = _straight(far, pushes.approach).of_frame(plate)
            found.append(Segment(APPROACH, ahead, before, before, load))
            found.append(Segment.push(load, push, before, contact.margin))
            before = found[-1].after
            back = _straight(se2.compose(push.end, mode.robot), -pushes.retreat)
            found.append(Segment(RETREAT, back.of_frame(plate), before, before, load))
            at = back.end
        return tuple(found)


def _straight(start: FloatArray, length: float) -> PushPath:
    """Return a straight path ahead, or back if the length is negative."""
    return PushPath(start, np.copysign(1.0, length) * AHEAD[None], np.array([abs(length)]))


def least_margins(modes: Sequence[ContactMode], plans: Iterable[Segments], level: int) -> tuple[float, float]:
    """Return the smallest first and final margins of the pushes in some plans, or of all modes without pushes.

    Args:
        modes: Contact modes, including those of the pushes.
        plans: Segments of each plan.
        level: Final level of the margins, used if there are no pushes.
    """
    pushes = [segment for plan in plans for segment in plan if segment.kind == PUSH]
    if not pushes:
        return min(mode.margin(0) for mode in modes), min(mode.margin(level) for mode in modes)
    first = [mode.margin(0) for mode in modes if any(push.load is mode.load for push in pushes)]
    return min(first), min(push.margin for push in pushes)


def plan_cost(scenario: Scenario, segments: Segments) -> float:
    """Return the total cost of a plan's segments, m: pushed distance, transits and contact changes.

    Changing to another load does not count as a contact change.
    """
    pushes = scenario.transport
    cost, before = 0.0, None
    for segment in segments:
        if not segment.pushes or segment.load is None:
            cost += pushes.transit_weight * segment.path.cost
            continue
        changed = segment.load.names == before and segment.kind == PUSH  # a close keeps the contact
        cost += segment.cost + (pushes.switch_cost if changed else 0.0)
        before = segment.load.names
    return cost


def free_goals(scenario: Scenario) -> FloatArray:
    """Return the goals (g, 3) at which the load is collision-free.

    Raises:
        PlanningError: If there are none, or the load is at one already.
    """
    free: list[FloatArray] = []
    wrong: list[str] = []
    for goal in scenario.goals[scenario.load.name]:
        if max(se2.pose_error(scenario.start, goal.pose_chain)) < 1e-7:
            raise PlanningError("the load is at a goal already: there is nothing to push")
        there = list(load_errors(scenario, goal.pose_chain, "goal"))
        wrong += there
        if not there:
            free.append(goal.pose_chain)
    if not free:
        raise PlanningError("the goal is occupied: " + "; ".join(dict.fromkeys(wrong)))
    return np.array(free)


def backed_off(room: PushRoom, scenario: Scenario) -> FloatArray:
    """Return the pose (3,) of the robot's frame clear of the load, after backing off if it begins too near."""
    robot = scenario.robot_start
    enough = max(scenario.clearance, TRANSIT_CLEARANCE) + SLACK
    gap = separations(room.load, se2.relative(scenario.start, robot)[None], enough)[0]
    return robot if gap >= enough else se2.compose(robot, [-scenario.transport.retreat, 0.0, 0.0])


def _explanation(
    room: PushRoom, query: Query, found: Found, limit: float
) -> tuple[str, tuple[Diagnosis, ...], Nearest | None]:
    """Return the reasons why a search found no plan, proven ones first."""
    reasons = sorted(_reasons(room, query, found), key=lambda reason: not reason.proven)
    if not reasons:
        text = f"the search was still running after {found.looked_at} pushes and transits"
        text = "; ".join(filter(None, (text, _few_faces(room, query, found))))
        reasons = [Diagnosis("time", text, False)]
    words = "; ".join(reason.text for reason in reasons)
    if not any(reason.proven for reason in reasons):
        words = f"no plan found within the time limit of {limit:g} s: {words}"
    return words, tuple(reasons), None


def _reasons(room: PushRoom, query: Query, found: Found) -> Iterator[Diagnosis]:
    usable = [contact for contact, begins in zip(room.contacts, found.begins, strict=True) if begins]
    if not usable:
        what = "at the start, the robot has no room to drive up to any allowed face"
        yield _no_room(room, query.load[None], what + _offset_hint(room, query.load[None]))
        return
    faces = _faces(usable)
    if not (found.begins & found.leaves).any():
        what = f"at the start, the robot can drive up to {faces} only, and an obstacle blocks a push from there"
        # If every settling push ends in a collision, no longer push is free either.
        settled = [(contact, _settled(contact, query)) for contact in usable]
        against = all(separations(contact.scene, pose[None], 1.0)[0] <= 0.0 for contact, pose in settled)
        ahead = [area_at(contact.mode.load.problem.chain.bodies, pose) for contact, pose in settled]
        around = near_to(room.scenario.obstacles, ahead, room.scenario.clearance)
        yield Diagnosis(BOXED_IN, what, against, blocking=around)
        return
    if not found.ends.any():
        what = "at the goal, the robot has no room to push the load in from any face and back off"
        yield _no_room(room, query.goals, what + _offset_hint(room, query.goals))
        return
    if not found.arrives:
        what = f"the robot found no transit to the first push ({faces})"
        yield Diagnosis(BOXED_IN, what, False)


def _faces(contacts: Iterable[Contact]) -> str:
    return ", ".join(dict.fromkeys(contact.mode.place.face for contact in contacts))


def _few_faces(room: PushRoom, query: Query, found: Found) -> str:
    """Return which faces the robot can drive up to at the start; empty if it can drive up to all of them."""
    shut = [contact for contact, begins in zip(room.contacts, found.begins, strict=True) if not begins]
    if not shut:
        return ""
    usable = [contact for contact in room.contacts if contact not in shut]
    where = f"at the start, the robot can drive up to {_faces(usable)} only"
    return where + _offset_hint(replace(room, contacts=tuple(shut)), query.load[None])


def _offset_hint(room: PushRoom, loads: FloatArray) -> str:
    """Return a hint at `pusher.offsets` that give the robot room beside the load at one of its poses (k, 3)."""
    if room.scenario.transport.offsets != (0.0,):
        return ""
    width = float(np.ptp(room.scenario.chain.pusher.outline[:, 1]))
    poses = np.array([
        [mode.robot_at(load, share * mode.approach) for share in (0.0, 0.5, 1.0)]
        for mode in (contact.packed for contact in room.contacts)
        for load in loads
    ])  # fmt: skip
    for shift in (round(share * width, 3) for share in OFFSETS_TRIED):
        beside = np.stack([se2.compose(poses, [0.0, side * shift, 0.0]) for side in (-1.0, 1.0)])
        gaps = separations(room.robot, beside.reshape(-1, 3), 1.0).reshape(-1, poses.shape[1])
        if (gaps >= room.scenario.clearance).all(axis=1).any():
            return f"; with pusher.offsets [-{shift:g}, 0, {shift:g}] there is room"
    return ""


def _no_room(room: PushRoom, loads: FloatArray, what: str) -> Diagnosis:
    """Return the diagnosis that the robot has no room beside the load at its poses (k, 3), and the obstacles."""
    carried = room.scenario.chain.carried
    driven = [
        shapely.union_all([area_at(carried, mode.robot_at(load, behind)) for behind in (0.0, mode.approach)])
        for mode in (contact.packed for contact in room.contacts)
        for load in loads
    ]
    around = near_to(room.scenario.obstacles, [one.convex_hull for one in driven], room.scenario.clearance)
    return Diagnosis(BOXED_IN, what, _all_taken(room, loads), blocking=around)


def _settled(contact: Contact, query: Query) -> FloatArray:
    """Return the pose (3,) of the chain after its settling push from the start."""
    pose = se2.compose(query.load, contact.packed.contact)
    return se2.compose(pose, se2.exp(contact.packed.settle * contact.packed.settling))


def _all_taken(room: PushRoom, loads: FloatArray) -> bool:
    """Return whether the robot would collide at every contact, at all of the load's poses (k, 3)."""
    poses = np.array([contact.packed.robot_at(load, 0.0) for contact in room.contacts for load in loads])
    return bool((separations(room.robot, poses, 1.0) < room.scenario.clearance).all())
