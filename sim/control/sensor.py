"""A simulated sensor of objects: noise, a rate, and a delay."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from pushplan.errors import PushplanError
from pushplan.plans.events import Measured
from pushplan.util.arrays import FloatArray


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
            value = getattr(self, field.name)
            if not 0.0 <= value < math.inf or (field.name == "rate" and value == 0.0):
                allowed = "> 0" if field.name == "rate" else ">= 0"
                raise PushplanError(f"{field.name} of the sensor is {value}; it must be finite and {allowed}")


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
        noise = self._random.normal(size=object_poses.shape) * [
            sensor.position,
            sensor.position,
            sensor.angle,
        ]
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
