"""What was measured lately: places of the objects against the plate, each with the plate where it was then."""

from __future__ import annotations

from collections import deque

import numpy as np

from pushplan.errors import PushplanError
from pushplan.geometry.se2 import compose, exp, log, relative, wrap_angle
from pushplan.util.arrays import FloatArray

MEMORY = 3.0
"""How long poses of the plate and measurements are kept, s."""


class Sightings:
    """Recent poses of the plate, and measured places of the objects in the chain frame at that time.

    A measurement tells of a moment that is past: it is compared with where the plate was at that moment.
    """

    def __init__(self) -> None:
        self._plate: deque[tuple[float, FloatArray]] = deque()
        self._seen: deque[tuple[float, FloatArray]] = deque()

    def plate_at(self, time: float, pose: FloatArray) -> None:
        """Take down where the plate is."""
        self._plate.append((time, pose))
        while self._plate[0][0] < time - MEMORY:
            self._plate.popleft()

    def see(self, time: float, object_poses: FloatArray) -> None:
        """Take down measured poses (n, 3) of the objects in the world at a time.

        Raises:
            PushplanError: When that is before what is remembered of the plate, or in the future.
        """
        self._seen.append((time, relative(self._plate_then(time), object_poses)))
        while self._seen[0][0] < time - MEMORY:
            self._seen.popleft()

    def latest(self) -> float:
        """Return the time of the last measurement; minus infinity before the first."""
        return self._seen[-1][0] if self._seen else -np.inf

    def count(self, since: float) -> int:
        """Return the number of measurements from a time on."""
        return sum(time >= since for time, _ in self._seen)

    def places(self, around: FloatArray, last: int, since: float = -np.inf) -> FloatArray | None:
        """Return the mean places (n, 3) of the last measurements; None when there are less than that.

        Args:
            around: (n, 3) places about which angles are taken.
            last: Number of measurements.
            since: Only those from this time on count.
        """
        seen = [places for time, places in self._seen if time >= since][-last:]
        if len(seen) < last:
            return None
        off = np.array(seen) - around
        off[..., 2] = wrap_angle(off[..., 2])
        return np.asarray(around + off.mean(axis=0))

    def _plate_then(self, time: float) -> FloatArray:
        """Return where the plate was, between two poses along the arc that joins them."""
        times = [at for at, _ in self._plate]
        k = int(np.searchsorted(times, time + 1e-9)) - 1
        if k < 0 or time > times[-1] + 1e-9:
            raise PushplanError(
                f"a measurement was taken at {time:.3f} s; known is where the plate was from {times[0]:.3f} to "
                f"{times[-1]:.3f} s"
            )
        begin, pose = self._plate[k]
        if k + 1 == len(times):
            return pose
        end, after = self._plate[k + 1]
        return compose(pose, exp(log(relative(pose, after)) * (time - begin) / (end - begin)))
