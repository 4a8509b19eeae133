"""Measured poses: of objects by a simulated sensor, what was seen of them lately, and where the plate is."""

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
"""What (m, rad) the measured pose of the plate may be off from one to the next."""
MEMORY = 3.0
"""How long poses of the plate and measurements are kept, s."""
STILL = 2e-3
"""Way (m) of the plate that pushes during which measurements that repeat one another are no news of its load."""
OUTLIER = 4.0
"""Measurements of a mean are so many standard deviations from their median, at most."""
NOISY, CLOSE = 24, 0.15
"""Measurements of an object from which noise is estimated, and time (s) up to which one comes next to another."""


@dataclass(frozen=True)
class Sensor:
    """How objects are measured.

    Attributes:
        rate: Measurements per second, Hz.
        delay: From a measurement to its coming, s; trackers lag by about 0.1 s.
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
"""Largest values of a sensor; what came later than the memory would be dropped."""


class Measurements:
    """Measures objects as time goes by.

    Attributes:
        t: When each measurement was taken, s.
        poses: (n, 3) what was measured.
    """

    def __init__(self, sensor: Sensor, seed: int) -> None:
        """Begin at time 0 with a seed of the noise."""
        self._sensor, self._random = sensor, np.random.default_rng(seed)
        self._waiting: deque[tuple[float, FloatArray]] = deque()
        self.t: list[float] = []
        self.poses: list[FloatArray] = []

    @classmethod
    def recorded(cls, sensor: Sensor, measured: Measured) -> Self:
        """Return measurements that were made, as they came from the sensor."""
        again = cls(sensor, 0)
        again._waiting.extend((float(t), poses) for t, poses in zip(measured.t, measured.poses, strict=True))
        return again

    @property
    def measured(self) -> Measured:
        """All measurements so far."""
        return Measured(np.array(self.t), np.array(self.poses))

    def take(self, now: float, object_poses: FloatArray) -> None:
        """Measure the objects (n, 3), if it is time to."""
        sensor = self._sensor
        if now < len(self.t) / sensor.rate - 1e-9:
            return
        noise = self._random.normal(size=object_poses.shape) * [sensor.position, sensor.position, sensor.angle]
        self.t.append(now)
        self.poses.append(object_poses + noise)
        self._waiting.append((now, self.poses[-1]))

    def arrived(self, now: float) -> tuple[FloatArray, float] | None:
        """Return the latest measurement that has come since, and when it was taken; None where none has."""
        latest = None
        while self._waiting and self._waiting[0][0] + self._sensor.delay <= now + 1e-9:
            time, poses = self._waiting.popleft()
            latest = poses, time
        return latest


class Sightings:
    """Recent measurements, in the order of the times at which they were taken.

    Args:
        noise: (2,) standard deviations of measurements that come without, m and rad.

    Attributes:
        rides: Whether the last one came from a camera on the robot, which may see nothing on its way.
    """

    def __init__(self, noise: FloatArray) -> None:
        self._stated, self._usual, self.rides = noise, noise, False
        self._seen: deque[tuple[float, FloatArray]] = deque()
        self._ahead: deque[tuple[float, FloatArray, bool]] = deque()
        self._plates: deque[FloatArray] = deque()  # time and pose of each (4,)
        self._gate = Gate()
        self._last = np.zeros(0)  # when each object was seen last (n,); empty before the first measurement
        self._came: tuple[FloatArray, FloatArray] | None = None  # the last one, and where the plate was at first
        self._frozen = False

    @property
    def noise(self) -> FloatArray:
        """(2,) standard deviations of measurements, m and rad: as stated last, or as seen where that is more."""
        return self._gate.noise(self._stated)

    def noisier(self) -> str:
        """Return by how much measurements scatter more than is stated; empty where they do not."""
        stated, seen = self._stated, self._gate.noise(np.maximum(self._stated, self._usual))
        return f"{words(*seen)}, and {words(*stated)} are stated" if (seen > stated).any() else ""

    def see(
        self, time: float, object_poses: FloatArray, frame: str = "world", noise: FloatArray | None = None
    ) -> None:
        """Take down measured poses (n, 3) of the objects in a frame, `world` or `plate`, NaN where unseen.

        Raises:
            PushplanError: When it is another frame.
        """
        if frame not in ("world", "plate"):
            raise PushplanError(f"frame is {frame!r:.40}; allowed: 'world' and 'plate'")
        self._stated = self._usual if noise is None else noise
        self.rides = frame == "plate"
        self._ahead.append((time, object_poses, self.rides))

    def come(
        self, now: float, plate: FloatArray, pushing: bool, doubt: Callable[[str, int], None]
    ) -> list[tuple[float, FloatArray]]:
        """Return what has come since, in the world; measurements stamped ahead wait until `now` is there.

        What leaps is NaN until the next one agrees, see `Gate`; what repeats the measurement before to the last
        digit, though the load is pushed, is left out.

        Args:
            now: Time, s.
            plate: (3,) pose of the plate frame then, in the world, from which is seen what is measured in it.
                Not one that was learned from such measurements, which would confirm itself.
            pushing: Whether the plate pushes, all contacts being closed.
            doubt: Told what is wrong with measurements (`wrong`, `exchanged`, `frozen`), and the number of an object.
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
        """Return where the plate was (3,) at a time, s: at a constant twist between two steps."""
        after = next(k for k, row in enumerate(self._plates) if row[0] >= time)
        end = self._plates[after]
        begin = self._plates[max(after - 1, 0)]
        share = (time - begin[0]) / (end[0] - begin[0]) if time < end[0] and end[0] > begin[0] else 1.0
        return between(begin[1:], end[1:], max(share, 0.0))

    def latest(self) -> float:
        """Return the time of the last measurement that came; minus infinity before the first."""
        if self._ahead:
            return self._ahead[-1][0]
        return self._seen[-1][0] if self._seen else -np.inf

    def unseen(self, since: float, columns: list[int]) -> FloatArray:
        """Return when each of some objects was seen last (n,), or `since` where that is later or it never was."""
        return np.maximum(self._last[columns], since) if len(self._last) else np.array([since])

    def is_blind(self, unseen: float, was: bool, patience: float, tell: Callable[[str, str], None]) -> bool:
        """Tell once that no measurement has come for longer than one is waited for; return whether that is so."""
        blind = unseen > patience
        if blind and not was:
            tell("unseen", f"no measurement has come for {unseen:.2f} s: the plate stands still until one does")
        return blind

    def mean(self, around: FloatArray, least: int, since: float, columns: list[int]) -> FloatArray | None:
        """Return the mean poses (n, 3) of measurements of some objects, without outliers; None if there are too few.

        Args:
            around: (n, 3) poses about which angles are taken.
            least: Number of measurements that it takes.
            since: Only those from this time on count.
            columns: Numbers of the objects among all.
        """
        counted = [poses[columns] for time, poses in self._seen if time >= since]
        off = np.array(counted).reshape(-1, *around.shape) - around
        off[..., 2] = wrap_angle(off[..., 2])
        there = ~np.isnan(off[..., 0])
        if (there.sum(axis=0) < least).any():
            return None
        return np.asarray(around + [_middle(off[there[:, i], i]) for i in range(len(around))])


def _middle(values: FloatArray) -> FloatArray:
    """Return the mean (3,) of those of the values (k, 3) that are not far from their median."""
    off = np.abs(values - np.median(values, axis=0))
    usual = OUTLIER * 1.48 * np.median(off, axis=0) + 1e-9
    return np.asarray(values[(off <= usual).all(axis=1)].mean(axis=0))


def noise_between(times: FloatArray, errors: FloatArray) -> FloatArray | None:
    """Return the standard deviations (2,), m and rad, by which errors differ from one measurement to the next.

    Args:
        times: (k,) of measurements, s.
        errors: (k, n, 3) of objects, NaN where unseen.

    Returns:
        None where there are too few that come next to one another.
    """
    steps = np.diff(errors, axis=0)[np.diff(times) < CLOSE] / math.sqrt(2.0)
    steps = steps[~np.isnan(steps[..., 0])]
    if len(steps) < NOISY:
        return None
    size = 1.48 * np.median(np.abs(steps), axis=0)
    return np.array([0.5 * (size[0] + size[1]), size[2]])


class Odometry:
    """Where the plate is: by what it was told, by its wheels where they tell, and by its measured pose.

    Attributes:
        pose: (3,) of the plate frame in the world.
        travel: So far, as it was told, m.
        watched: Whether it is measured how the plate moves, by its pose or by its wheels.
    """

    def __init__(self, pose: FloatArray) -> None:
        """Begin at a pose (3,)."""
        self.pose, self.travel, self.watched = pose, 0.0, False
        self._measured: tuple[FloatArray, FloatArray] | None = None
        self._leapt: tuple[FloatArray, FloatArray] | None = None  # one that leapt, likewise
        self._sure = False  # whether two have agreed
        self._rolled: tuple[FloatArray, FloatArray] | None = None  # what was told last, and the pose then

    def drive(self, twist: FloatArray, period: float) -> None:
        """Go on by a body twist (3,) for a time, s."""
        self.pose = compose(self.pose, exp(twist * period))
        self.travel += float(np.hypot(twist[0], twist[1])) * period

    def take(self, rolled: FloatArray | None, measured: FloatArray | None) -> tuple[float, float] | None:
        """Take how the plate has moved; return by what its measured pose jumped (m, rad), None if it did not.

        Args:
            rolled: (3,) pose by the wheels, in a frame that stays: what counts is how it has changed.
            measured: (3,) pose in the world.
        """
        if rolled is not None:
            if self._rolled is not None:
                before, pose = self._rolled
                self.pose = compose(pose, relative(before, rolled))
            self._rolled, self.watched = (rolled, self.pose), True
        return None if measured is None else self._take_pose(measured)

    def _take_pose(self, pose: FloatArray) -> tuple[float, float] | None:
        """Take a measured pose (3,); return by what it jumped.

        One that leaps is wrong, or a jump of the measurement if the next one agrees: then the plate has moved as it
        was told to, or as its wheels say. The first two have to agree.
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
