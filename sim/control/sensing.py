"""A simulated sensor, recent measurements of the objects, and the odometry of the plate."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from pushplan.errors import PushplanError
from pushplan.geometry.se2 import between, compose, exp, pose_error, relative, wrap_angle
from pushplan.plans.run import Measured
from pushplan.sim.control.gate import Gate
from pushplan.sim.control.settings import words
from pushplan.util.arrays import FloatArray, plain_number

JUMP = (0.01, math.radians(0.5))
"""Largest error (m, rad) of the plate's measured motion that does not count as a jump."""
MEMORY = 3.0
"""Time for which poses of the plate and measurements are kept, s."""
STILL = 2e-3
"""Travel (m) of a pushing plate after which identical measurements count as frozen."""
OUTLIER = 4.0
"""Largest distance of a measurement from the median, in standard deviations, that counts in a mean."""
NOISY, CLOSE = 24, 0.15
"""Smallest number of pairs of measurements for a noise estimate, and largest time (s) between the two of a pair."""


@dataclass(frozen=True)
class Sensor:
    """Simulated sensor of object poses.

    Attributes:
        rate: Measurements per second, Hz.
        delay: Time from a measurement to its arrival, s; trackers lag by about 0.1 s.
        position: Standard deviation of each coordinate of a position, m.
        angle: Standard deviation of an angle, rad.
    """

    rate: float = 30.0
    delay: float = 0.1
    position: float = 1e-3
    angle: float = math.radians(0.3)

    def __post_init__(self) -> None:
        for field in fields(self):
            value = plain_number(getattr(self, field.name))
            object.__setattr__(self, field.name, value)
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not (number and 0.0 <= value <= _MOST[field.name]) or (field.name == "rate" and value == 0.0):
                allowed = "> 0" if field.name == "rate" else ">= 0"
                raise PushplanError(
                    f"{field.name} of the sensor is {value}; it must be finite and {allowed}, at most "
                    f"{_MOST[field.name]:g}"
                )


_MOST = {"rate": 1e4, "delay": MEMORY, "position": 1.0, "angle": math.pi}
"""Largest values of a sensor; later measurements than the memory would be dropped."""


class Measurements:
    """Measurements of a simulated sensor.

    Attributes:
        t: Times of the measurements, s.
        poses: Measured poses, each (n, 3).
    """

    def __init__(self, sensor: Sensor, seed: int) -> None:
        """Start at time 0; `seed` is that of the noise."""
        self._sensor, self._random = sensor, np.random.default_rng(seed)
        self._waiting: deque[tuple[float, FloatArray]] = deque()
        self.t: list[float] = []
        self.poses: list[FloatArray] = []

    @classmethod
    def recorded(cls, sensor: Sensor, measured: Measured) -> Self:
        """Return recorded measurements, with the delay of the sensor."""
        again = cls(sensor, 0)
        again._waiting.extend((float(t), poses) for t, poses in zip(measured.t, measured.poses, strict=True))
        return again

    @property
    def measured(self) -> Measured:
        """All measurements so far."""
        return Measured(np.array(self.t), np.array(self.poses))

    def take(self, now: float, object_poses: FloatArray) -> None:
        """Measure the objects (n, 3) if the next measurement is due."""
        sensor = self._sensor
        if now < len(self.t) / sensor.rate - 1e-9:
            return
        noise = self._random.normal(size=object_poses.shape) * [sensor.position, sensor.position, sensor.angle]
        self.t.append(now)
        self.poses.append(object_poses + noise)
        self._waiting.append((now, self.poses[-1]))

    def arrived(self, now: float) -> tuple[FloatArray, float] | None:
        """Return the latest new measurement and its time; None without one."""
        latest = None
        while self._waiting and self._waiting[0][0] + self._sensor.delay <= now + 1e-9:
            time, poses = self._waiting.popleft()
            latest = poses, time
        return latest


class Sightings:
    """Recent measurements, ordered by time.

    Args:
        noise: Standard deviations of measurements without a covariance, m and rad, (2,).

    Attributes:
        rides: Whether the last one came from a camera on the robot, which often sees no object during a transit.
    """

    def __init__(self, noise: FloatArray) -> None:
        self._stated, self._usual, self.rides = noise, noise, False
        self._seen: deque[tuple[float, FloatArray]] = deque()
        self._ahead: deque[tuple[float, FloatArray, bool]] = deque()
        self._plates: deque[FloatArray] = deque()  # time and pose of each (4,)
        self._gate = Gate()
        self._last = np.zeros(0)  # time of the last sighting of each object (n,); empty before the first measurement
        self._came: tuple[FloatArray, FloatArray] | None = None  # last distinct one, and the pose of the plate then
        self._frozen = False

    @property
    def noise(self) -> FloatArray:
        """Standard deviations of measurements, m and rad, (2,): the last nominal ones, or the estimate if larger."""
        return self._gate.noise(self._stated)

    def noisier(self) -> str:
        """Return a text about noise above the nominal one; empty without it."""
        stated, seen = self._stated, self._gate.noise(np.maximum(self._stated, self._usual))
        return f"{words(*seen)} instead of {words(*stated)}" if (seen > stated).any() else ""

    def see(
        self, time: float, object_poses: FloatArray, frame: str = "world", noise: FloatArray | None = None
    ) -> None:
        """Store measured poses (n, 3) of the objects in a frame, `world` or `plate`, NaN for unseen objects.

        Raises:
            PushplanError: If it is another frame.
        """
        if frame not in ("world", "plate"):
            raise PushplanError(f"frame is {frame!r:.40}; allowed: 'world' and 'plate'")
        self._stated = self._usual if noise is None else noise
        self.rides = frame == "plate"
        self._ahead.append((time, object_poses, self.rides))

    def come(
        self, now: float, plate: FloatArray, pushing: bool, doubt: Callable[[str, int], None]
    ) -> list[tuple[float, FloatArray]]:
        """Return the new measurements in the world; those with a later time stamp wait until `now`.

        A pose that leaps is NaN until the next one confirms it; see `Gate`. A measurement that repeats the previous
        one to the last digit although the load is pushed is dropped.

        Args:
            now: Time, s.
            plate: Pose of the plate frame in the world, (3,), by odometry. A pose that is learned from these
                measurements would confirm itself.
            pushing: Whether the plate pushes with all contacts closed.
            doubt: Receiver of the problem (`wrong`, `exchanged`, `frozen`) and the index of the object.
        """
        self._plates.append(np.append(now, plate))
        while self._plates[0][0] < now - MEMORY:
            self._plates.popleft()
        come = []
        while self._ahead and self._ahead[0][0] <= now:
            time, poses, on_plate = self._ahead.popleft()
            then = self._plate_at(time)
            if self._repeats(poses, then, pushing):
                doubt("frozen", 0)
                continue
            passed, wrong, exchanged = self._gate.passed(
                compose(then, poses) if on_plate else poses, then, self.noise
            )
            come.append((time, passed))
            for k in wrong:
                doubt("wrong", k)
            if exchanged:
                doubt("exchanged", 0)
        self._seen.extend(come)
        for time, poses in come:
            seen = np.where(np.isnan(poses[:, 0]), -np.inf, time)
            self._last = np.maximum(self._last, seen) if len(self._last) else seen
        while self._seen and self._seen[0][0] < now - MEMORY:
            self._seen.popleft()
        return come

    def _repeats(self, poses: FloatArray, plate: FloatArray, pushing: bool) -> bool:
        if self._came is None or not np.array_equal(poses, self._came[0], equal_nan=True):
            self._came, self._frozen = (poses, plate), False
        self._frozen |= pushing and pose_error(plate, self._came[1])[0] > STILL
        return self._frozen

    def _plate_at(self, time: float) -> FloatArray:
        """Return the pose of the plate (3,) at a time, s, with a constant twist between two steps."""
        after = next(k for k, row in enumerate(self._plates) if row[0] >= time)
        end = self._plates[after]
        begin = self._plates[max(after - 1, 0)]
        share = (time - begin[0]) / (end[0] - begin[0]) if time < end[0] and end[0] > begin[0] else 1.0
        return between(begin[1:], end[1:], max(share, 0.0))

    def latest(self) -> float:
        """Return the time of the last measurement; minus infinity before the first."""
        if self._ahead:
            return self._ahead[-1][0]
        return self._seen[-1][0] if self._seen else -np.inf

    def unseen(self, since: float, columns: list[int]) -> FloatArray:
        """Return the time of the last sighting of each of some objects (n,), at least `since`."""
        return np.maximum(self._last[columns], since) if len(self._last) else np.array([since])

    def is_blind(self, unseen: float, was: bool, patience: float, tell: Callable[[str, str], None]) -> bool:
        """Return whether the time without measurements exceeds the patience; report it once."""
        blind = unseen > patience
        if blind and not was:
            tell("unseen", f"no measurement has come for {unseen:.2f} s: the plate stands still until one does")
        return blind

    def mean(self, around: FloatArray, least: int, since: float, columns: list[int]) -> FloatArray | None:
        """Return the mean measured poses (n, 3) of some objects, without outliers; None if there are too few.

        Args:
            around: Poses about which angles are wrapped, (n, 3).
            least: Smallest number of measurements.
            since: Time of the first measurement that counts, s.
            columns: Indices of the objects.
        """
        counted = [poses[columns] for time, poses in self._seen if time >= since]
        off = np.array(counted).reshape(-1, *around.shape) - around
        off[..., 2] = wrap_angle(off[..., 2])
        there = ~np.isnan(off[..., 0])
        if (there.sum(axis=0) < least).any():
            return None
        return np.asarray(around + [_middle(off[there[:, i], i]) for i in range(len(around))])


def _middle(values: FloatArray) -> FloatArray:
    """Return the mean (3,) of the values (k, 3) without outliers from the median."""
    off = np.abs(values - np.median(values, axis=0))
    usual = OUTLIER * 1.48 * np.median(off, axis=0) + 1e-9
    return np.asarray(values[(off <= usual).all(axis=1)].mean(axis=0))


def noise_between(times: FloatArray, errors: FloatArray) -> FloatArray | None:
    """Return the noise of measurements as standard deviations (2,), m and rad; None for too few pairs of neighbours.

    It follows from the differences of neighbouring errors.

    Args:
        times: Times of measurements, s, (k,).
        errors: Errors of objects, NaN for unseen ones, (k, n, 3).
    """
    steps = np.diff(errors, axis=0)[np.diff(times) < CLOSE] / math.sqrt(2.0)
    steps = steps[~np.isnan(steps[..., 0])]
    if len(steps) < NOISY:
        return None
    size = 1.48 * np.median(np.abs(steps), axis=0)
    return np.array([0.5 * (size[0] + size[1]), size[2]])


class Odometry:
    """Pose of the plate from commands, wheel odometry and measured poses.

    Attributes:
        pose: Pose of the plate frame in the world, (3,).
        travel: Commanded travel so far, m.
        watched: Whether its motion is measured, by poses or by wheels.
    """

    def __init__(self, pose: FloatArray) -> None:
        """Start at a pose (3,)."""
        self.pose, self.travel, self.watched = pose, 0.0, False
        self._measured: tuple[FloatArray, FloatArray] | None = None
        self._leapt: tuple[FloatArray, FloatArray] | None = None  # the same for a measured pose that leapt
        self._sure = False  # whether two measured poses have agreed
        self._rolled: tuple[FloatArray, FloatArray] | None = None  # last wheel pose, and the pose at that time

    def drive(self, twist: FloatArray, period: float) -> None:
        """Apply a commanded body twist (3,) for a period, s."""
        self.pose = compose(self.pose, exp(twist * period))
        self.travel += float(np.hypot(twist[0], twist[1])) * period

    def take(self, rolled: FloatArray | None, measured: FloatArray | None) -> tuple[float, float] | None:
        """Apply measurements of the plate; return the jump of its measured pose (m, rad), None without one.

        Args:
            rolled: Pose by the wheels in any fixed frame, (3,); only its change counts.
            measured: Pose in the world, (3,).
        """
        if rolled is not None:
            if self._rolled is not None:
                before, pose = self._rolled
                self.pose = compose(pose, relative(before, rolled))
            self._rolled, self.watched = (rolled, self.pose), True
        return None if measured is None else self._take_pose(measured)

    def _take_pose(self, pose: FloatArray) -> tuple[float, float] | None:
        """Apply a measured pose (3,); return its jump.

        A pose that leaps is wrong, or, if the next one confirms it, a jump of the measurement. In both cases the
        plate has moved by its commands or wheels. The first two poses must agree.
        """
        first, jump = self._measured is None, None
        offs = []
        for reference in (self._measured, self._leapt):
            if reference is None:
                continue
            before, odometry = reference
            offs.append(pose_error(relative(before, pose), relative(odometry, self.pose)))
            if offs[-1][0] <= JUMP[0] and offs[-1][1] <= JUMP[1]:
                leapt = reference is self._leapt
                jump = offs[0] if leapt and self._sure else None
                self.pose = pose if leapt and not self._sure else compose(odometry, relative(before, pose))
                self._measured, self._leapt, self._sure = (pose, self.pose), None, True
                break
        else:
            self.pose = pose if first else self.pose
            found = pose, self.pose
            self._measured, self._leapt = (found, None) if first else (self._measured, found)
        self.watched = True
        if self._rolled is not None:
            self._rolled = self._rolled[0], self.pose
        return jump
