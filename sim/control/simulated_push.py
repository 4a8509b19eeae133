"""Simulation of a controller, or an open-loop plan, in a world with disturbances and a sensor."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, Union

import numpy as np
from numpy.typing import ArrayLike

from pushplan.errors import PushplanError
from pushplan.geometry.polygon import exit_distance
from pushplan.geometry.se2 import compose, exp, inverse, log, relative, rotate, transform_points, twist_of
from pushplan.mechanics.chain import PLATE
from pushplan.mechanics.contacts import carried_objects
from pushplan.plans.load import Load
from pushplan.plans.plan import Plan
from pushplan.plans.run import Event, Measured
from pushplan.sim.control.sensing import Measurements, Sensor
from pushplan.sim.report import columns_of
from pushplan.slip.simulator import SlipSimulator
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray, IntArray, plain_number
from pushplan.util.names import FARTHEST

if TYPE_CHECKING:
    from pushplan.sim.physics.simulator import PhysicsSimulator

SENSOR = Sensor()
TIME_LIMIT = 600.0
"""Simulated time after which a simulation ends, s."""


@dataclass(frozen=True)
class Disturbance:
    """Instantaneous displacement of one object.

    Attributes:
        time: Time, s.
        index: Index of the object.
        x: Shift along x of the object's own frame, m.
        y: Shift along y of the object's own frame, m.
        turn: Rotation about the origin of the object's frame, rad.
    """

    time: float
    index: int
    x: float
    y: float
    turn: float

    def __post_init__(self) -> None:
        for name, value in vars(self).copy().items():
            object.__setattr__(self, name, plain_number(value))
        numbers = self.time, self.x, self.y, self.turn
        fine = all(isinstance(value, int | float) and abs(value) <= FARTHEST for value in numbers)
        if not (fine and isinstance(self.index, int) and self.index >= 0):
            raise PushplanError(f"{self}; allowed: an object's index, and numbers up to {FARTHEST:g}")

    def event(self, names: Sequence[str]) -> Event:
        """Return the disturbance as an event of a log; `names` are those of all objects."""
        moved = f"{1e3 * math.hypot(self.x, self.y):.1f} mm and {math.degrees(self.turn):.2g} deg"
        return Event(self.time, "disturbance", f"{names[self.index]} was displaced by {moved}")


Simulator = Union["SlipSimulator", "PhysicsSimulator"]
"""Simulator of a plate and the objects on the floor."""


def disturbed(simulator: Simulator, frame: FloatArray, disturbance: Disturbance) -> FloatArray:
    """Return the poses (n, 3) of the objects after a disturbance, without overlaps.

    A pushed object is kept clear of the body that pushes it, and moves the objects that it carries ahead. Otherwise
    objects farther from the plate give way.

    Args:
        simulator: Simulator with the objects before the disturbance.
        frame: Pose of the moved frame of the plate, (3,).
        disturbance: Displacement to apply.
    """
    poses, chain, names = simulator.object_poses, simulator.chain, simulator.world.names
    if disturbance.index >= len(poses):
        raise PushplanError(f"{disturbance}; there are {len(poses)} objects, counted from 0")
    poses[disturbance.index] = compose(poses[disturbance.index], [disturbance.x, disturbance.y, disturbance.turn])
    if chain is None or names[disturbance.index] not in (own := [obj.name for obj in chain.objects]):
        return _apart(simulator, frame, poses)
    columns = columns_of(chain, names)
    carried = carried_objects(chain)
    for k in np.flatnonzero(carried[own.index(names[disturbance.index])]):
        contact = chain.contacts[k]
        ahead = rotate(frame[2], contact.normal)
        behind = transform_points(frame, chain.pusher.outline)
        if contact.pusher != PLATE:
            behind = transform_points(poses[columns[contact.pusher]], chain.objects[contact.pusher].outline)
        shift = exit_distance(behind, transform_points(poses[columns[k]], chain.objects[k].outline), ahead)
        poses[[columns[i] for i in np.flatnonzero(carried[k])], :2] += shift * ahead
    return poses


def _apart(simulator: Simulator, frame: FloatArray, poses: FloatArray) -> FloatArray:
    """Return poses (n, 3) without overlaps of objects and plate; objects farther from the plate give way."""
    world = simulator.world
    pusher, plate = world.chain.pusher, compose(frame, simulator.plate_in_frame)
    there = [transform_points(compose(plate, inverse(pusher.plate_pose)), pusher.outline)]
    for k in np.argsort(np.hypot(*(poses[:, :2] - plate[:2]).T)):
        for other in there:
            own = transform_points(poses[k], world.objects[k].outline)
            away = own.mean(axis=0) - other.mean(axis=0)
            away /= max(float(np.linalg.norm(away)), 1e-12)
            poses[k, :2] += exit_distance(other, own, away) * away
        there.append(transform_points(poses[k], world.objects[k].outline))
    return poses


class Driver(Protocol):
    """Interface of a driver of the plate, such as `Controller` and `OpenLoop`."""

    @property
    def load(self) -> Load | None:
        """Load that is pushed, approached or left now."""

    @property
    def segment(self) -> int:
        """Index of the current segment."""

    @property
    def over(self) -> bool:
        """Whether it has ended."""

    def step(self, now: float, object_poses: ArrayLike | None = None, measured_at: float | None = None) -> FloatArray:
        """Return the twist (3,) of the plate frame until the next step."""


class OpenLoop:
    """Executes a plan of any kind without feedback.

    Args:
        plan: Timed plan.
        rate: Steps per second, Hz.
    """

    def __init__(self, plan: Plan, rate: float) -> None:
        assert plan.trajectory is not None
        self._plan, self._trajectory, self._rate, self._at = plan, plan.trajectory, rate, 0.0

    @property
    def load(self) -> Load | None:
        """See `Driver`."""
        return self._plan.segments[self.segment].load

    @property
    def segment(self) -> int:
        """See `Driver`."""
        return int(self._plan.segment_at(np.array([self._at]))[0])

    @property
    def over(self) -> bool:
        """Whether the plan has ended."""
        return self._at >= self._trajectory.duration

    def step(self, now: float, object_poses: ArrayLike | None = None, measured_at: float | None = None) -> FloatArray:
        """Return the twist (3,) until the next step; measurements are ignored."""
        begin, self._at = self._at, min(self._at + 1.0 / self._rate, self._trajectory.duration)
        before, after = self._trajectory.poses_at([begin, self._at])
        return np.asarray(log(relative(before, after)) * self._rate)


@dataclass(frozen=True, eq=False)
class SimulatedPush:
    """Recorded simulation, one row for each step.

    Attributes:
        names: Names of the objects.
        t: Times, s, (m,).
        poses: Poses of the plate frame in the world, (m, 3).
        object_poses: Poses of the objects in the world, (m, n, 3).
        wrenches: Wrenches of the plate between successive poses, in the contact frame: N, N, N m, (m - 1, 3).
        twists: Commanded twists of the plate frame until the next row, (m, 3).
        segment: Index of the current segment, (m,).
        measured: Measurements of the sensor.
        jammed: Whether it ended because the objects jammed.
        over: Whether the driver has ended.
        stalled: Whether the plate stood at some time because it lacked the force.
    """

    names: tuple[str, ...]
    t: FloatArray
    poses: FloatArray
    object_poses: FloatArray
    wrenches: FloatArray
    twists: FloatArray
    segment: IntArray
    measured: Measured
    jammed: bool
    over: bool
    stalled: bool


def simulate_push(
    world: World,
    driver: Driver,
    rate: float,
    disturbances: Sequence[Disturbance] = (),
    sensor: Sensor = SENSOR,
    seed: int = 1,
    time_limit: float = TIME_LIMIT,
    progress: Callable[[SimulatedPush], None] | None = None,
    simulator_of: Callable[[World], Simulator] = SlipSimulator,
    step: Callable[..., FloatArray] | None = None,
) -> SimulatedPush:
    """Simulate a driver in a world until it ends.

    Args:
        world: Simulated world; it can differ from the driver's scenario.
        driver: Controller of the plate.
        rate: Steps per second, Hz.
        disturbances: Displacements of objects.
        sensor: Sensor of the driver.
        seed: Seed of the sensor's noise.
        time_limit: Largest simulated time, s.
        progress: Callback with the simulation so far, once per simulated second.
        simulator_of: Simulator of the world: slip without inertia, or `PhysicsSimulator`.
        step: Function in place of `driver.step` that returns the actual twist of the plate, for a robot with errors
            of sensors or wheels.

    Raises:
        MissingExtraError: If the physics engine is requested and not installed.
        SupportError: If the load under an object is not known.
    """
    simulator, seen, held = simulator_of(world), Measurements(sensor, seed), None
    step = driver.step if step is None else step
    frame = simulator.plate_pose
    left = deque(sorted(disturbances, key=lambda disturbance: disturbance.time))
    rows: list[tuple[float, FloatArray, FloatArray, FloatArray, int]] = []
    wrenches: list[FloatArray] = []
    stalled = False

    def so_far() -> SimulatedPush:
        columns = (np.array(column) for column in zip(*rows, strict=True))
        t, poses, object_poses, twists, segment = columns
        pushed = np.array(wrenches).reshape(-1, 3)
        ended = simulator.jammed, driver.over, stalled
        return SimulatedPush(world.names, t, poses, object_poses, pushed, twists, segment, seen.measured, *ended)

    for k in range(int(time_limit * rate) + 1):
        now = k / rate
        if world.plate is not None and driver.load is not held:
            held = driver.load
            simulator.hold(None if held is None else world.pushed(held.chain))
            frame = simulator.plate_pose
        while left and left[0].time <= now:
            simulator.place(disturbed(simulator, frame, left.popleft()), frame)
        seen.take(now, simulator.object_poses)
        came = seen.arrived(now)
        plate, segment = simulator.plate_in_frame, driver.segment
        twist = step(now) if came is None else step(now, *came)
        rows.append((now, compose(frame, plate), simulator.object_poses, twist, segment))
        if progress is not None and k % math.ceil(rate) == 0:
            progress(so_far())
        if simulator.jammed or (driver.over and not twist.any()):
            break
        twist = twist_of(inverse(plate), twist)
        wrenches.append(simulator.move(twist, 1.0 / rate).wrenches.mean(axis=0))
        stalled |= simulator.stalled
        frame = simulator.plate_pose if simulator.stalled else compose(frame, exp(twist / rate))
    return so_far()
