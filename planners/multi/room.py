"""Robot, load and contacts in a room, as the core plans pushes and ways among them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from pushplan.core.collision import SLACK, Scene, sweep_is_free
from pushplan.core.driving import Surroundings, WheelKind, Wheels, shortest_drives
from pushplan.core.pushes import PackedMode
from pushplan.core.transit import find_transit, shortened
from pushplan.errors import EmptyStableSetError
from pushplan.geometry import se2
from pushplan.geometry.convex import bounding_circle, convex_pieces, flatten
from pushplan.mechanics.chain import Drive
from pushplan.planners.multi.contact_modes import ContactMode
from pushplan.planners.problem import open_scene, sampling_box, standing_in
from pushplan.planners.scene import scene_of
from pushplan.plans.path import TURN_WEIGHT
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray
from pushplan.util.names import TRANSIT_CLEARANCE

NOWHERE, AHEAD = np.zeros(3), np.array([1.0, 0.0, 0.0])

NO_WALLS = np.array([-math.inf, -math.inf, math.inf, math.inf])
"""Of a room without a workspace: xmin, ymin, xmax, ymax."""

TOLERANCE_USED = 0.6
"""Share of a tolerance that a plan may use up; the rest is for its execution."""

DETOUR = 0.05
"""What a plan that ends within a tolerance has to save, so that it is taken in place of one to the exact goal, m."""

DRIVE = 1000
"""Poses drawn in search of a way of the robot, at most."""

TOUCHING = 1e-3
"""Up to so far before the contact (m) the robot is proven not to touch the load elsewhere."""


@dataclass(frozen=True, eq=False)
class Contact:
    """A contact in a room.

    Attributes:
        mode: What it can do.
        margin: That its twists exceed.
        packed: The same for the core.
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
            packed = packed_mode(mode, mode.margin(level), scenario)
            if packed is not None and reaches(load, packed):
                contacts.append(Contact(mode, mode.margin(level), packed, _with_body(robot, mode.load.problem)))
        packed_modes = [contact.packed for contact in contacts]
        left = np.array([mode.robot_at(NOWHERE, mode.retreat) for mode in packed_modes]).reshape(-1, 3)
        taken = np.array([mode.robot_at(NOWHERE, mode.approach) for mode in packed_modes]).reshape(-1, 3)
        return cls(scenario, wheels, robot, load, tuple(contacts), shortest_drives(wheels, left, taken))

    def of_twin(self, scenario: Scenario, modes: tuple[ContactMode, ...]) -> PushRoom:
        """Return the same for a load that differs in name and place only."""
        own = {mode.place: mode for mode in modes}
        contacts = (replace(contact, mode=own[contact.mode.place]) for contact in self.contacts)
        return replace(self, scenario=scenario, contacts=tuple(contacts))

    def with_obstacles(self, scenario: Scenario) -> PushRoom:
        """Return it for a scenario that differs in what stands in the room."""
        robot = self.robot.with_obstacles(*standing_in(scenario))
        contacts = tuple(
            Contact(one.mode, one.margin, one.packed, robot.with_body(one.scene.body, one.scene.body_bound))
            for one in self.contacts
        )
        return replace(self, scenario=scenario, robot=robot, contacts=contacts)

    def around(self, load: FloatArray) -> Surroundings:
        """Return what the robot must not touch with the load at a pose (3,)."""
        return Surroundings(self.robot, self.load, load)


@dataclass(frozen=True, eq=False)
class Query:
    """From where to where.

    Attributes:
        robot: (3,) pose of the robot's frame.
        load: (3,) pose of the load.
        goals: (g, 3) poses of the load, any of which will do.
        within: (2,) how far (m, rad) the first object may end beside a goal where that saves `DETOUR`.
        cost_to_go: (m, g) what comes after a plan that ends with a contact at a goal costs, m; None: nothing.
    """

    robot: FloatArray
    load: FloatArray
    goals: FloatArray
    within: FloatArray = field(default_factory=lambda: np.zeros(2))
    cost_to_go: FloatArray | None = None


def lower_bounds(room: PushRoom, query: Query, through: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return what no plan costs less than until the load is at poses (k, 3), (k,), and from there on, m."""
    pushes = room.scenario.transport
    contacts = np.array([contact.packed.contact[:2] for contact in room.contacts])
    middle = contacts.mean(axis=0)
    faster = max(1.0, float(np.linalg.norm(contacts - middle, axis=1).max()) / TURN_WEIGHT)
    poses = np.concatenate([query.load[None], through, query.goals])
    start, between, goals = np.split(se2.compose(poses, [*middle, 0.0]), [1, 1 + len(through)])
    alone = pushes.transit_weight * (pushes.approach + pushes.retreat)
    return _bounds(start, between, faster)[0], _bounds(between, goals, faster).min(axis=1) + alone


def _bounds(starts: FloatArray, goals: FloatArray, faster: float) -> FloatArray:
    """Return what no pushes of the contacts' middle from starts (n, 3) to goals (m, 3) cost less than, (n, m)."""
    x, y, turn = np.moveaxis(goals - starts[:, None], -1, 0)
    return np.asarray(np.maximum(np.hypot(x, y) / faster, TURN_WEIGHT * np.abs(se2.wrap_angle(turn))))


def find_drive(
    problem: Scenario, load: FloatArray, start: FloatArray, approach: float, seed: int
) -> FloatArray | None:
    """Return arcs (k, 4) by which the robot drives up to a load where that stands; None where none are found.

    Args:
        problem: Of the load, with the plate at the face that it shall push, among what stands in the room.
        load: (3,) pose of the contact's frame, on the load.
        start: (3,) pose of the contact's frame, on the robot.
        approach: Length of the straight way ahead that leads to the contact, and is looked at, too, m.
        seed: Of the random numbers.
    """
    robot, objects = _scenes(problem)
    goal = se2.compose(load, [-approach, 0.0, 0.0])
    if not sweep_is_free(robot, goal, AHEAD, approach):
        return None
    wheels = wheels_of(problem.chain.pusher.drive, bounding_circle(robot.body.corners[:, :2])[:2])
    around, state = Surroundings(robot, objects, load), np.array([seed], dtype=np.uint64)
    reach = 1.0 + problem.chain.reach
    arcs = find_transit(around, wheels, start, goal, sampling_box(problem), reach, state, DRIVE)
    return None if arcs is None else shortened(around, wheels, start, arcs, state, 200)


def wheels_of(drive: Drive, middle: FloatArray) -> Wheels:
    """Return how a robot moves alone.

    Args:
        drive: Its drive.
        middle: (2,) of its body, about which an omnidirectional robot turns.
    """
    if drive.axle is None:
        return Wheels(WheelKind.OMNIDIRECTIONAL, np.append(middle, 0.0), 0.0)
    kind = WheelKind.CAR if drive.kind == "car" else WheelKind.DIFFERENTIAL
    return Wheels(kind, np.array(drive.axle), max(drive.min_radius, 1e-9))


def _scenes(scenario: Scenario) -> tuple[Scene, Scene]:
    """The robot among what stands in the room, and among the objects in the load's frame."""
    everything = open_scene(scenario)
    robot = list(convex_pieces([body.outline for body in scenario.chain.carried]))
    moving = everything.with_body(flatten(robot), bounding_circle(np.concatenate(robot)))
    room = moving.with_distances(everything.clearance, scenario.clearance)
    objects = list(convex_pieces([obj.outline_chain for obj in scenario.chain.objects]))
    berth = max(scenario.clearance, TRANSIT_CLEARANCE)
    load = scene_of(robot, objects, np.zeros((0, 3)), NO_WALLS, berth + SLACK, berth)
    return room, load


def _with_body(room: Scene, scenario: Scenario) -> Scene:
    """Return a scene with the chain of another scenario."""
    body = list(convex_pieces([moving.outline for moving in scenario.chain.bodies]))
    return room.with_body(flatten(body), bounding_circle(np.concatenate(body)))


def packed_mode(mode: ContactMode, margin: float, scenario: Scenario) -> PackedMode | None:
    """Return a mode for the core; None where it can push nothing straight ahead with the margin."""
    pushes = scenario.transport
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
    """Return the families that differ."""
    kept: list[FloatArray] = []
    for family in mode.controls(margin).families:
        if not any(np.array_equal(family, other) for other in kept):
            kept.append(family)
    return np.array(kept)


def reaches(load: Scene, mode: PackedMode) -> bool:
    """Tell whether the robot gets to the contact, and back, without touching the load elsewhere."""
    scene = load.with_distances(0.5 * TOUCHING, 0.25 * TOUCHING)
    far = max(mode.approach, mode.retreat)
    return far > TOUCHING and sweep_is_free(scene, mode.robot_at(NOWHERE, far), AHEAD, far - TOUCHING)
