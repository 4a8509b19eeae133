"""Detection of a stall: the measured load stands still although the plate is commanded to move."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from pushplan.geometry.se2 import compose, relative, rotate
from pushplan.util.arrays import FloatArray

WINDOWS = (0.3, 0.6, 1.2)
"""Lengths of the time windows whose beginning and end are compared, s."""
LATE = 0.25
"""Largest delay of measurements, s; older motions of the plate must show in them."""
DRIVEN, SIGMAS = 0.016, 5.0
"""Smallest expected motion of an object for a stall: a distance (m), and standard deviations of the compared means.
A gap before the load of up to three quarters of this distance does not count as a stall."""
STILL = 0.25
"""Largest share of the expected motion of an object that stands still."""
PRESSED = 0.012
"""Smallest overlap (m) of the believed plate with the objects, unless the plate is measured to stand; with less, it
might not have met them yet."""
FEWEST = 6
"""Smallest number of measurements in a window."""
MEMORY = 2.0
"""Time after which poses of the plate are dropped, s."""


class StallWatch:
    """Compares the commanded motion of the plate with the measured motion of its load.

    In a stall, every object that should move stands still. If one object has slipped or is blocked alone, others
    still move.

    Args:
        names: Names of the load's objects.
        onto: Name of the object that the load is pushed up to; empty without one.
    """

    def __init__(self, names: Sequence[str], onto: str = "") -> None:
        self._names, self._noise, self._onto = tuple(names), 0.0, onto
        self._commanded: deque[tuple[float, FloatArray, FloatArray]] = deque()
        self._seen: deque[tuple[float, FloatArray]] = deque()
        self._first: FloatArray | None = None
        self._last: FloatArray = np.zeros((len(names), 3))
        self._plate: FloatArray = np.zeros(3)
        self._times: FloatArray = np.zeros(0)
        self._fresh = False

    def driven(self, now: float, motion: FloatArray, believed: FloatArray) -> None:
        """Record the commanded motion of the plate.

        Args:
            now: Time, s.
            motion: Commanded body motion of the load's frame since the last call, (3,).
            believed: Believed pose of that frame in the world, (3,).
        """
        self._plate = compose(self._plate, motion)
        self._commanded.append((now, self._plate, believed))
        while self._commanded[0][0] < now - MEMORY:
            self._commanded.popleft()

    def see(self, time: float, poses: FloatArray, noise: float) -> None:
        """Record measured poses (n, 3), NaN for unseen objects, and the standard deviation of coordinates, m."""
        self._noise = noise
        if self._first is None:
            self._first = self._last = poses
        self._first = np.where(np.isnan(self._first), poses, self._first)
        self._last = np.where(np.isnan(poses), self._last, poses)
        self._seen.append((time, poses))
        self._fresh = True
        while self._seen[0][0] < time - WINDOWS[-1]:
            self._seen.popleft()

    def restart(self) -> None:
        """Drop all measurements."""
        self._seen.clear()

    def stalled(self, places: FloatArray) -> tuple[str, ...]:
        """Return the names of the objects that the plate cannot push; empty without a stall.

        All objects stand still in a stall, so measurements do not show which of them is too heavy, and the whole load
        is named. If only some objects have never moved, these are named: the plate or the load has just met them.

        Args:
            places: Poses of the objects in the load's frame, (n, 3).
        """
        if not self._fresh:
            return ()  # no measurement since the last call
        self._fresh = False
        self._times = np.array([time for time, *_ in self._commanded])
        for window in WINDOWS:
            seen = [one for one in self._seen if one[0] >= self._seen[-1][0] - window]
            third = len(seen) // 3
            if len(seen) >= FEWEST and self._stands(seen[:third], seen[-third:], places):
                return self._stalled_objects()
        return ()

    def _stands(
        self, before: list[tuple[float, FloatArray]], after: list[tuple[float, FloatArray]], places: FloatArray
    ) -> bool:
        """Return whether every object that should have moved stood still between two groups of measurements."""
        times = [float(np.mean([time for time, _ in part])) for part in (before, after)]
        poses = [np.array([poses[:, :2] for _, poses in part]) for part in (before, after)]
        seen = ~np.isnan(np.concatenate(poses)[..., 0]).any(axis=0)
        if not seen.any() or not self._commanded:
            return False
        moved = poses[1].mean(axis=0) - poses[0].mean(axis=0)
        most = max(DRIVEN, SIGMAS * self._noise * math.sqrt(2.0 / len(before)))
        for late in (0.0, LATE):
            (first, begin), (last, end) = (self._plate_at(time - late) for time in times)
            way = compose(relative(first, last), places)[:, :2] - places[:, :2]
            size = np.hypot(way[:, 0], way[:, 1])
            counts = seen & (size >= most)
            if not counts.any() or (np.hypot(*moved[counts].T) > STILL * size[counts]).any():
                return False
            plate = self._commanded[-1][2]
            ahead = rotate(float(plate[2]), way) / np.maximum(size, 1e-9)[:, None]
            beyond = ((compose(plate, places)[:, :2] - poses[1].mean(axis=0)) * ahead).sum(axis=1)
            believed = compose(relative(begin, end), places)[:, :2] - places[:, :2]
            stands = np.hypot(believed[:, 0], believed[:, 1]) <= STILL * size
            if not (stands | (beyond >= PRESSED))[counts].all():
                return False
        return True

    def _plate_at(self, time: float) -> tuple[FloatArray, FloatArray]:
        """Return the commanded pose of the plate, relative to its start, and its believed pose (3,)."""
        return self._commanded[max(int(np.searchsorted(self._times, time, side="right")) - 1, 0)][1:]

    def _stalled_objects(self) -> tuple[str, ...]:
        assert self._first is not None
        way = np.hypot(*(self._last[:, :2] - self._first[:, :2]).T)  # NaN for objects that were never seen
        most = max(0.5 * DRIVEN, SIGMAS * self._noise)
        rested = tuple(name for name, gone in zip(self._names, way, strict=True) if gone <= most)
        if not (way > most).any():
            return self._names
        return rested or ((self._onto,) if self._onto else self._names)
