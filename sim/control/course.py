"""What moves the plate, put into a simulated world, and what happens there."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from pushplan.geometry.se2 import compose, exp, log, relative
from pushplan.plans.events import Measured
from pushplan.plans.trajectory import Trajectory
from pushplan.sim.control.sensor import Measurements, Sensor
from pushplan.sim.slip.simulator import SlipSimulator
from pushplan.sim.worlds.kick import Kick, kicked
from pushplan.sim.worlds.world import World
from pushplan.util.arrays import FloatArray

SENSOR = Sensor()
TIME_LIMIT = 600.0
"""Simulated time after which a course ends, s."""


class Driver(Protocol):
    """What moves the plate; see `Controller`."""

    @property
    def over(self) -> bool:
        """Whether it has come to its end."""

    def step(
        self, now: float, object_poses: ArrayLike | None = None, measured_at: float | None = None
    ) -> FloatArray:
        """Return the twist (3,) of the plate until the next step."""


class OpenLoop:
    """Follows a trajectory, whatever happens."""

    def __init__(self, trajectory: Trajectory, rate: float) -> None:
        """Follow a trajectory in so many steps per second."""
        self._trajectory, self._rate, self._at = trajectory, rate, 0.0

    @property
    def over(self) -> bool:
        """Whether the trajectory is at its end."""
        return self._at >= self._trajectory.duration

    def step(
        self, now: float, object_poses: ArrayLike | None = None, measured_at: float | None = None
    ) -> FloatArray:
        """Return the twist (3,) of the plate until the next step; what is measured does not matter."""
        begin, self._at = self._at, min(self._at + 1.0 / self._rate, self._trajectory.duration)
        before, after = self._trajectory.poses_at([begin, self._at])
        return np.asarray(log(relative(before, after)) * self._rate)


@dataclass(frozen=True, eq=False)
class Course:
    """What happened in a world, at every step.

    Attributes:
        t: (m,) times, s.
        poses: (m, 3) of the chain frame, that is of the plate, in the world.
        object_poses: (m, n, 3) of the objects in the world.
        wrenches: (m - 1, 3) of the plate between each pose and the next, chain frame: N, N, N m.
        twists: (m, 3) of the plate from then on, body twists in the chain frame.
        measured: What the sensor said.
        jammed: Nothing could give way; everything ends there.
        over: What moves the plate came to its end.
    """

    t: FloatArray
    poses: FloatArray
    object_poses: FloatArray
    wrenches: FloatArray
    twists: FloatArray
    measured: Measured
    jammed: bool
    over: bool


def course_in(
    world: World,
    driver: Driver,
    rate: float,
    kicks: Sequence[Kick] = (),
    sensor: Sensor = SENSOR,
    seed: int = 1,
    time_limit: float = TIME_LIMIT,
    progress: Callable[[float], None] | None = None,
) -> Course:
    """Let a driver push in a world until it is over.

    Args:
        world: What is pushed; it need not be what the driver believes.
        driver: What moves the plate.
        rate: Steps per second.
        kicks: What happens to objects meanwhile.
        sensor: What the driver sees.
        seed: Of the sensor's noise.
        time_limit: Simulated seconds, at most.
        progress: Called with the simulated time now and then.

    Raises:
        SupportError: When the load under an object is not known.
    """
    simulator, plate, seen = SlipSimulator(world), np.array(world.start), Measurements(sensor, seed)
    left = deque(sorted(kicks, key=lambda kick: kick.time))
    rows: list[tuple[float, FloatArray, FloatArray, FloatArray]] = []
    wrenches: list[FloatArray] = []
    for k in range(int(time_limit * rate) + 1):
        now = k / rate
        while left and left[0].time <= now:
            simulator.place(kicked(world, simulator.object_poses, plate, left.popleft()), plate)
        seen.take(now, simulator.object_poses)
        came = seen.arrived(now)
        twist = driver.step(now) if came is None else driver.step(now, *came)
        rows.append((now, plate, simulator.object_poses, twist))
        if progress is not None and k % int(rate) == 0:
            progress(now)
        if simulator.jammed or (driver.over and not twist.any()):
            break
        wrenches.append(simulator.move(twist, 1.0 / rate).wrenches.mean(axis=0))
        plate = compose(plate, exp(twist / rate))
    t, poses, object_poses, twists = (np.array(column) for column in zip(*rows, strict=True))
    pushed = np.array(wrenches).reshape(-1, 3)
    return Course(t, poses, object_poses, pushed, twists, seen.measured, simulator.jammed, driver.over)
