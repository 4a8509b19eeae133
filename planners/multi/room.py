"""Robot, load and contacts in a room, in the form in which the core plans pushes and transits."""

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
"""Walls (xmin, ymin, xmax, ymax) of a room without a workspace."""

TOLERANCE_USED = 0.6
"""Share of the tolerance that a plan can use. The rest is left for its execution."""

DETOUR = 0.05
"""Saving that a plan needs to end within the tolerance instead of at the exact goal, m."""

DRIVE = 1000
"""Maximum number of poses drawn in the search for a transit."""

TOUCHING = 1e-3
"""Distance before the contact (m) up to which the robot is proven not to touch the load elsewhere."""


@dataclass(frozen=True, eq=False)
class Contact:
    """A contact in a room.

    Attributes:
        mode: Contact mode.
        margin: Lower limit of its twists' margins.
        packed: The mode in the core's form.
        scene: Scene of the chain with this contact among the obstacles.
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
        wheels: Kinematics of the robot in transits.
        robot: Scene of the robot among the obstacles.
        load: Scene of the robot among the load's objects, in the load's frame.
        contacts: Usable contacts.
        shortest: (m, m) length of the shortest transit without obstacles from each contact to each other one, m.
    """

    scenario: Scenario
    wheels: Wheels
    robot: Scene
    load: Scene
    contacts: tuple[Contact, ...]
    shortest: FloatArray

    @classmethod
    def of(cls, scenario: Scenario, modes: tuple[ContactMode, ...], level: int) -> PushRoom:
        """Return the room of a scenario, with those contact modes that can be used.

        Args:
            scenario: Chain, room and settings.
            modes: Contact modes.
            level: Level of their margins.
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
        """Return the room for a load that differs only in name and pose."""
        own = {mode.place: mode for mode in modes}
        contacts = (replace(contact, mode=own[contact.mode.place]) for contact in self.contacts)
        return replace(self, scenario=scenario, contacts=tuple(contacts))

    def with_obstacles(self, scenario: Scenario) -> PushRoom:
        """Return the room of a scenario that differs only in its obstacles."""
        robot = self.robot.with_obstacles(*standing_in(scenario))
        contacts = tuple(
            Contact(one.mode, one.margin, one.packed, robot.with_body(one.scene.body, one.scene.body_bound))
            for one in self.contacts
        )
        return replace(self, scenario=scenario, robot=robot, contacts=contacts)

    def around(self, load: FloatArray) -> Surroundings:
        """Return the scenes of the robot with the load at a pose (3,)."""
        return Surroundings(self.robot, self.load, load)


@dataclass(frozen=True, eq=False)
class Query:
    """Start poses and goals of a search.

    Attributes:
        robot: (3,) pose of the robot's frame.
        load: (3,) pose of the load.
        goals: (g, 3) alternative goal poses of the load.
        within: (2,) distances (m, rad) from a goal at which the first object can end if that saves `DETOUR`.
        cost_to_go: (m, g) cost after a plan that ends with a contact at a goal, m; None for zero.
    """

    robot: FloatArray
    load: FloatArray
    goals: FloatArray
    within: FloatArray = field(default_factory=lambda: np.zeros(2))
    cost_to_go: FloatArray | None = None


def lower_bounds(room: PushRoom, query: Query, through: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return lower bounds (k,) of a plan's cost up to load poses (k, 3), and (k,) from there on, m."""
    pushes = room.scenario.transport
    contacts = np.array([contact.packed.contact[:2] for contact in room.contacts])
    middle = contacts.mean(axis=0)
    faster = max(1.0, float(np.linalg.norm(contacts - middle, axis=1).max()) / TURN_WEIGHT)
    poses = np.concatenate([query.load[None], through, query.goals])
    start, between, goals = np.split(se2.compose(poses, [*middle, 0.0]), [1, 1 + len(through)])
    alone = pushes.transit_weight * (pushes.approach + pushes.retreat)
    return _bounds(start, between, faster)[0], _bounds(between, goals, faster).min(axis=1) + alone


def _bounds(starts: FloatArray, goals: FloatArray, faster: float) -> FloatArray:
    """Return lower bounds (n, m) of the cost to push the contacts' middle from starts (n, 3) to goals (m, 3)."""
    x, y, turn = np.moveaxis(goals - starts[:, None], -1, 0)
    return np.asarray(np.maximum(np.hypot(x, y) / faster, TURN_WEIGHT * np.abs(se2.wrap_angle(turn))))


def find_drive(
    problem: Scenario, load: FloatArray, start: FloatArray, approach: float, seed: int
) -> FloatArray | None:
    """Return the arcs (k, 4) of a transit to a load at its current pose; None if none are found.

    Args:
        problem: Scenario of the load, with the plate at the face to push.
        load: (3,) pose of the contact's frame on the load.
        start: (3,) pose of the contact's frame on the robot.
        approach: Length of the straight approach to the contact, m. It is checked for collisions too.
        seed: Seed of the random numbers.
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
    """Return the kinematics of a robot in transits.

    Args:
        drive: Drive of the robot.
        middle: (2,) middle of its body, about which an omnidirectional robot turns.
    """
    if drive.axle is None:
        return Wheels(WheelKind.OMNIDIRECTIONAL, np.append(middle, 0.0), 0.0)
    kind = WheelKind.CAR if drive.kind == "car" else WheelKind.DIFFERENTIAL
    return Wheels(kind, np.array(drive.axle), max(drive.min_radius, 1e-9))


def _scenes(scenario: Scenario) -> tuple[Scene, Scene]:
    """Return the scenes of the robot among the obstacles, and among the objects in the load's frame."""
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
    """Return a mode in the core's form; None if no straight push is stable with the margin."""
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
    """Return the families of steering twists without duplicates."""
    kept: list[FloatArray] = []
    for family in mode.controls(margin).families:
        if not any(np.array_equal(family, other) for other in kept):
            kept.append(family)
    return np.array(kept)


def reaches(load: Scene, mode: PackedMode) -> bool:
    """Return whether the robot can drive to the contact and back without touching the load elsewhere."""
    scene = load.with_distances(0.5 * TOUCHING, 0.25 * TOUCHING)
    far = max(mode.approach, mode.retreat)
    return far > TOUCHING and sweep_is_free(scene, mode.robot_at(NOWHERE, far), AHEAD, far - TOUCHING)
