"""Robot, load and contacts in a room, and the pushes between two poses of the load by exact steering paths."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from pushplan.compiled import any_integer, compiled
from pushplan.errors import EmptyStableSetError
from pushplan.planners.collision.scene import bounding_circle, convex_pieces, flatten, scene_of
from pushplan.planners.collision.separation import Scene, separation, step, sweep_is_free
from pushplan.planners.multi.contact_modes import ContactMode
from pushplan.planners.multi.driving import Surroundings, Wheels, shortest_drive, wheels_of
from pushplan.planners.multi.transit import MOST_ARCS, find_transit, shortened
from pushplan.planners.problem.controls import MARGIN_FLOOR
from pushplan.planners.problem.problem import ROUNDING, SLACK, open_scene, scene_with_gap
from pushplan.planners.problem.steering import MAX_WORDS, MOST_FAMILIES, connect, find_words
from pushplan.plans.path import TURN_WEIGHT, cost_rate
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import BoolArray, FloatArray
from pushplan.util.names import TRANSIT_CLEARANCE

ARCS = 4
"""Of a push, at most: the settling one, and those of a word."""

TRIES = any_integer(6)
"""Words that are swept for a push, at most."""


class PackedMode(NamedTuple):
    """A contact and the pushes that it can make.

    Attributes:
        families: (f, 3, 3) left, straight and right twists in the contact's chain frame.
        contact: (3,) pose of that frame in the load's.
        robot: (3,) pose of the robot's frame in that frame.
        settling: (3,) twist of the straight push that a push begins with.
        settle: Its length, m.
        approach: Length of the straight way to the contact, m.
        retreat: Length of the straight way back from it, m.
        clearance: What is kept from everything, m.
        faster: How much faster than a push's cost grows the origin of the load's frame moves, at most.
    """

    families: FloatArray
    contact: FloatArray
    robot: FloatArray
    settling: FloatArray
    settle: float
    approach: float
    retreat: float
    clearance: float
    faster: float


@compiled
def joined(place: FloatArray, inner: FloatArray) -> FloatArray:
    """Return the pose (3,) `inner` of a frame that is at `place` (3,), in the world."""
    c, s = math.cos(place[2]), math.sin(place[2])
    out = np.empty(3)
    out[0] = place[0] + c * inner[0] - s * inner[1]
    out[1] = place[1] + s * inner[0] + c * inner[1]
    out[2] = place[2] + inner[2]
    return out


@compiled
def seen_from_contact(at: FloatArray, contact: FloatArray) -> FloatArray:
    """Return the load's pose (3,) with a contact at a pose (3,) in the world that is at `contact` in its frame."""
    out = np.empty(3)
    out[2] = at[2] - contact[2]
    c, s = math.cos(out[2]), math.sin(out[2])
    out[0] = at[0] - c * contact[0] + s * contact[1]
    out[1] = at[1] - s * contact[0] - c * contact[1]
    return out


@compiled
def robot_at(mode: PackedMode, load: FloatArray, behind: float) -> FloatArray:
    """Return the robot's pose (3,) so far behind the contact, m, with the load at a pose (3,)."""
    pose = joined(joined(load, mode.contact), mode.robot)
    pose[0] -= behind * math.cos(pose[2])
    pose[1] -= behind * math.sin(pose[2])
    return pose


@compiled
def _settled(mode: PackedMode, contact: FloatArray) -> FloatArray:
    """Return where the contact's frame (3,) is after the settling push."""
    out = np.empty(3)
    x, y, _ = mode.settling
    out[0], out[1], out[2] = step(contact[0], contact[1], contact[2], x, y, 0.0, mode.settle)
    return out


@compiled
def word_costs(
    mode: PackedMode, starts: FloatArray, goals: FloatArray, sofar: FloatArray, left: FloatArray, below: float
) -> FloatArray:
    """Return what the cheapest pushes from loads at `starts` (n, 3) to `goals` (m, 3) cost, whatever is in the way.

    A pair is left out (infinite) that cannot be part of a plan which costs less than `below`, as what comes before
    the start costs at least `sofar` (n,) and what comes after the goal `left` (m,).
    """
    out, words = np.full((len(starts), len(goals)), np.inf), np.empty((MAX_WORDS, 7))
    ends = np.empty((len(goals), 3))
    for j in range(len(goals)):
        ends[j] = joined(goals[j], mode.contact)
    for i in range(len(starts)):
        begin = _settled(mode, joined(starts[i], mode.contact))
        for j in range(len(goals)):
            away = math.hypot(goals[j, 0] - starts[i, 0], goals[j, 1] - starts[i, 1])
            # A distance costs next to nothing beside the words, of which most pairs need none then.
            if sofar[i] + away / mode.faster + left[j] >= below:
                continue
            for f in range(len(mode.families)):
                for k in range(find_words(mode.families[f], begin, ends[j], words)):
                    out[i, j] = min(out[i, j], mode.settle + words[k, 0])
    return out


@compiled
def push(scene: Scene, mode: PackedMode, start: FloatArray, goal: FloatArray, arcs: FloatArray) -> float:
    """Find the cheapest free push between two poses of the load.

    Args:
        scene: The chain with this contact in the room.
        mode: The contact.
        start: (3,) pose of the load.
        goal: Likewise.
        arcs: (ARCS, 4) filled with the twists, in the contact's frame, and lengths.

    Returns:
        Its cost, m; infinite if there is none.
    """
    first, last = joined(start, mode.contact), joined(goal, mode.contact)
    gap = min(
        separation(scene, first[0], first[1], first[2], mode.clearance + SLACK),
        separation(scene, last[0], last[1], last[2], mode.clearance + SLACK),
    )
    if gap < mode.clearance - ROUNDING:
        return np.inf
    between = scene_with_gap(scene, gap, mode.clearance)
    x, y, _ = mode.settling
    if not sweep_is_free(between, first[0], first[1], first[2], x, y, 0.0, mode.settle):
        return np.inf
    begin, word = _settled(mode, first), np.zeros((3, 4))
    cost, _ = connect(between, mode.families, begin, last, np.inf, TRIES, word)
    if cost == np.inf:
        return np.inf
    arcs[0, 0], arcs[0, 1], arcs[0, 2], arcs[0, 3] = x, y, 0.0, mode.settle
    arcs[1:] = word
    return mode.settle + cost


@compiled
def settles(scene: Scene, mode: PackedMode, load: FloatArray) -> bool:
    """Return whether the settling push is free with the load at a pose (3,)."""
    at = joined(load, mode.contact)
    gap = separation(scene, at[0], at[1], at[2], mode.clearance + SLACK)
    if gap < mode.clearance - ROUNDING:
        return False
    between = scene_with_gap(scene, gap, mode.clearance)
    return bool(
        sweep_is_free(between, at[0], at[1], at[2], mode.settling[0], mode.settling[1], 0.0, mode.settle)
    )


@compiled
def approaches_are_free(robot: Scene, mode: PackedMode, loads: FloatArray, back: bool) -> BoolArray:
    """Return (k,) whether the straight way to the contact, or back from it, is free with the load at poses (k, 3)."""
    out = np.zeros(len(loads), dtype=np.bool_)
    behind = mode.retreat if back else mode.approach
    for i in range(len(loads)):
        near, away = robot_at(mode, loads[i], 0.0), robot_at(mode, loads[i], behind)
        gap = separation(robot, near[0], near[1], near[2], mode.clearance + SLACK)
        # Where the robot drives on, it keeps what every transit keeps.
        far = separation(robot, away[0], away[1], away[2], mode.clearance + SLACK)
        if gap < mode.clearance - ROUNDING or far < mode.clearance + SLACK:
            continue
        between = scene_with_gap(robot, gap, mode.clearance)
        out[i] = sweep_is_free(between, away[0], away[1], away[2], 1.0, 0.0, 0.0, behind)
    return out


NOWHERE = np.zeros(3)

TOUCHING = 1e-3
"""Up to so far before the contact (m) the robot is proven not to touch the load elsewhere."""


@dataclass(frozen=True, eq=False)
class Contact:
    """A contact in a room.

    Attributes:
        mode: What it can do.
        margin: That its twists exceed.
        packed: The same for compiled code.
        scene: The chain with this contact among what stands in the room.
    """

    mode: ContactMode
    margin: float
    packed: PackedMode
    scene: Scene


@dataclass(frozen=True, eq=False)
class PushRoom:
    """The robot, the load and all contacts in a room.

    Attributes:
        scenario: Chain, room and settings.
        wheels: How the robot moves alone.
        robot: The robot among what stands in the room.
        load: The robot among the objects, these in the frame of the load.
        contacts: That can be used.
        shortest: (m, m) cost of the robot's shortest way from each contact left to each contact taken, whatever is in
            the way, m.
    """

    scenario: Scenario
    wheels: Wheels
    robot: Scene
    load: Scene
    contacts: tuple[Contact, ...]
    shortest: FloatArray
    _transits: dict[tuple[int, int], FloatArray | None] = field(default_factory=dict)

    @classmethod
    def of(cls, scenario: Scenario, modes: tuple[ContactMode, ...], level: int) -> PushRoom:
        """Return what planning with some modes rests on in a room; those that cannot be used are left out.

        Args:
            scenario: Chain, room and settings.
            modes: The contacts.
            level: Of their margins.
        """
        robot, load = _scenes(scenario)
        body = bounding_circle(robot.body.corners[:, :2])
        wheels = wheels_of(scenario.chain.pusher.drive, body[:2])
        contacts = []
        for mode in modes:
            packed = _packed(mode, mode.margin(level), scenario)
            if packed is not None and _reaches(load, packed):
                contacts.append(
                    Contact(mode, mode.margin(level), packed, _with_body(robot, mode.load.problem))
                )
        packed_modes = [contact.packed for contact in contacts]
        ends = [(robot_at(m, NOWHERE, m.retreat), robot_at(m, NOWHERE, m.approach)) for m in packed_modes]
        shortest = [[shortest_drive(wheels, left[0], taken[1]) for taken in ends] for left in ends]
        table = np.array(shortest).reshape(len(ends), len(ends))
        return cls(scenario, wheels, robot, load, tuple(contacts), table)

    def with_obstacles(self, scenario: Scenario) -> PushRoom:
        """Return it for a scenario that differs in what stands in the room; ways around the load are kept."""
        robot, _ = _scenes(scenario)
        contacts = tuple(
            replace(
                contact, scene=robot._replace(body=contact.scene.body, body_bound=contact.scene.body_bound)
            )
            for contact in self.contacts
        )
        return replace(self, scenario=scenario, robot=robot, contacts=contacts)

    def around(self, load: FloatArray) -> Surroundings:
        """Return what the robot must not touch with the load at a pose (3,)."""
        return Surroundings(self.robot, self.load, load)

    def transit_around(self, left: int, taken: int) -> FloatArray | None:
        """Return a way (k, 4) around the load from one contact to another where nothing else is, None without any."""
        if (left, taken) not in self._transits:
            self._transits[left, taken] = self._find_transit(left, taken)
        return self._transits[left, taken]

    def _find_transit(self, left: int, taken: int) -> FloatArray | None:
        first, second = self.contacts[left].packed, self.contacts[taken].packed
        start, goal = robot_at(first, NOWHERE, first.retreat), robot_at(second, NOWHERE, second.approach)
        open_room = self.robot._replace(
            obstacles=flatten([]), circles=np.zeros((0, 3)), tree=np.zeros((0, 9)), walls=_NO_WALLS
        )
        around = Surroundings(open_room, self.load, NOWHERE)
        reach = 2.0 * (self.scenario.chain.reach + self.wheels.radius)
        box, state = np.array([-reach, -reach, reach, reach]), np.zeros(1, dtype=np.uint64)
        arcs = np.zeros((MOST_ARCS, 4))
        spread = self.scenario.chain.reach
        # More effort than for other ways: it is spent once for each pair of contacts.
        n = find_transit(around, self.wheels, start, goal, box, spread, state, 1000, arcs)
        if n < 0:
            return None
        n = shortened(around, self.wheels, start, arcs, n, state, 400)
        return arcs[:n].copy()


@dataclass(frozen=True, eq=False)
class Question:
    """From where to where.

    Attributes:
        robot: (3,) pose of the robot's frame.
        load: (3,) pose of the load.
        goals: (g, 3) poses of the load, any of which will do.
    """

    robot: FloatArray
    load: FloatArray
    goals: FloatArray

    def __post_init__(self) -> None:
        for name in (
            "robot",
            "load",
            "goals",
        ):  # compiled code is made anew for arrays that cannot be written
            object.__setattr__(self, name, np.array(getattr(self, name), dtype=np.float64))


_NO_WALLS = np.array([-math.inf, -math.inf, math.inf, math.inf])


def _scenes(scenario: Scenario) -> tuple[Scene, Scene]:
    """The robot among what stands in the room, and among the objects in the load's frame."""
    everything = open_scene(scenario)
    robot = list(convex_pieces([body.outline for body in scenario.chain.carried]))
    room = everything._replace(
        body=flatten(robot), body_bound=bounding_circle(np.concatenate(robot)), kept=scenario.clearance
    )
    objects = list(convex_pieces([obj.outline_chain for obj in scenario.chain.objects]))
    berth = max(scenario.clearance, TRANSIT_CLEARANCE)
    load = scene_of(robot, objects, np.zeros((0, 3)), _NO_WALLS, berth + SLACK, berth)
    return room, load


def _with_body(room: Scene, scenario: Scenario) -> Scene:
    """Return a scene with the chain of another scenario."""
    body = list(convex_pieces([moving.outline for moving in scenario.chain.bodies]))
    return room._replace(body=flatten(body), body_bound=bounding_circle(np.concatenate(body)))


def _packed(mode: ContactMode, margin: float, scenario: Scenario) -> PackedMode | None:
    """Return a mode for compiled code; None where it can push nothing straight ahead with the margin."""
    pushes = scenario.pushes
    assert pushes is not None
    try:
        settling = mode.settling(margin)
    except EmptyStableSetError:
        return None
    if settling is None:
        return None
    return PackedMode(
        _families(mode, margin),
        np.array(mode.place.contact),
        np.array(mode.robot),
        settling,
        pushes.settle,
        pushes.approach,
        pushes.retreat,
        scenario.clearance,
        max(1.0, float(np.linalg.norm(mode.place.contact[:2])) / TURN_WEIGHT),
    )


def _families(mode: ContactMode, margin: float) -> FloatArray:
    """Return the families that differ, and where there is room for one more, one with gentler turns."""
    kept: list[FloatArray] = []
    for family in mode.controls(margin).families:
        if not any(np.array_equal(family, other) for other in kept):
            kept.append(family)
    if len(kept) < MOST_FAMILIES and kept[0][1].any():
        gentler = _gentler(kept[0])
        margins = mode.stable.margin(gentler[gentler.any(axis=1)])
        if (margins > margin + MARGIN_FLOOR).all():
            kept.append(gentler)
    return np.array(kept)


def _gentler(family: FloatArray) -> FloatArray:
    """Return a family whose turns are combinations of the turns and the straight push."""
    out = family.copy()
    for k in (0, 2):
        if family[k].any():
            mixed = 0.4 * family[k] + 0.6 * family[1]
            out[k] = mixed / cost_rate(mixed)
    return out


def _reaches(load: Scene, mode: PackedMode) -> bool:
    """Tell whether the robot gets to the contact, and back, without touching the load elsewhere."""
    scene = load._replace(clearance=0.5 * TOUCHING, kept=0.25 * TOUCHING)
    far = max(mode.approach, mode.retreat)
    x, y, theta = robot_at(mode, NOWHERE, far)
    return far > TOUCHING and bool(sweep_is_free(scene, x, y, theta, 1.0, 0.0, 0.0, far - TOUCHING))
