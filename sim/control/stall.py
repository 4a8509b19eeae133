"""Whether the plate stalls: what it pushes stands still in the measurements though the plate is driven on."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from pushplan.geometry.se2 import compose, relative, rotate
from pushplan.util.arrays import FloatArray

WINDOWS = (0.3, 0.6, 1.2)
"""Times over which the beginning is compared with the end, s."""
LATE = 0.25
"""By how much measurements may be late, s: what the plate did before that has to show in them."""
DRIVEN, SIGMAS = 0.016, 5.0
"""Way (m), and standard deviations of what is compared, by which objects would have had to move: a gap before the
load of up to three quarters of that, where the plate is not yet in contact or a load was displaced, is no stall."""
STILL = 0.25
"""Share of that way up to which an object stands still."""
PRESSED = 0.012
"""By how much (m) the plate has to be believed beyond where objects leave room, unless it is measured to stand: it
may not have met them before that."""
FEWEST = 6
"""Measurements that a window has to have."""
MEMORY = 2.0
"""Time after which poses of the plate are forgotten, s."""


class StallWatch:
    """Compares how the plate is told to move with how its load moves.

    A stall is of the whole load: every object stands still that would have moved. One that left its place, or was
    hindered alone, leaves others moving.

    Args:
        names: Of the load's objects.
        onto: What the load is pushed up to; empty where that is nothing.
    """

    def __init__(self, names: Sequence[str], onto: str = "") -> None:
        self._names, self._noise, self._onto = tuple(names), 0.0, onto
        self._told: deque[tuple[float, FloatArray, FloatArray]] = deque()
        self._seen: deque[tuple[float, FloatArray]] = deque()
        self._first: FloatArray | None = None
        self._last: FloatArray = np.zeros((len(names), 3))
        self._plate: FloatArray = np.zeros(3)
        self._times: FloatArray = np.zeros(0)
        self._fresh = False

    def driven(self, now: float, motion: FloatArray, believed: FloatArray) -> None:
        """Take down by what body motion (3,) of the load's frame the plate was told to move until now.

        Args:
            now: Time, s.
            motion: (3,) since it was taken down before.
            believed: (3,) pose of that frame in the world, as believed.
        """
        self._plate = compose(self._plate, motion)
        self._told.append((now, self._plate, believed))
        while self._told[0][0] < now - MEMORY:
            self._told.popleft()

    def see(self, time: float, poses: FloatArray, noise: float) -> None:
        """Take down measured poses (n, 3), NaN where unseen, and the standard deviation of their coordinates, m."""
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
        """Forget what was seen so far."""
        self._seen.clear()

    def stalled(self, places: FloatArray) -> tuple[str, ...]:
        """Return the names of what the plate cannot push on; none where it can, or that is not known yet.

        All objects stand still then, and measurements alone do not say which of them is too heavy: the load is named.
        Objects that have never moved while others have are named alone: the plate, or the load, has just met them.

        Args:
            places: (n, 3) poses of the objects in the load's frame.
        """
        if not self._fresh:
            return ()  # nothing was measured since it was asked before
        self._fresh = False
        self._times = np.array([time for time, *_ in self._told])
        for window in WINDOWS:
            seen = [one for one in self._seen if one[0] >= self._seen[-1][0] - window]
            third = len(seen) // 3
            if len(seen) >= FEWEST and self._stands(seen[:third], seen[-third:], places):
                return self._blamed()
        return ()

    def _stands(
        self, before: list[tuple[float, FloatArray]], after: list[tuple[float, FloatArray]], places: FloatArray
    ) -> bool:
        """Tell whether every object stood still between measurements that would have moved."""
        times = [float(np.mean([time for time, _ in part])) for part in (before, after)]
        poses = [np.array([poses[:, :2] for _, poses in part]) for part in (before, after)]
        seen = ~np.isnan(np.concatenate(poses)[..., 0]).any(axis=0)
        if not seen.any() or not self._told:
            return False
        moved = poses[1].mean(axis=0) - poses[0].mean(axis=0)
        most = max(DRIVEN, SIGMAS * self._noise * math.sqrt(2.0 / len(before)))
        for late in (0.0, LATE):
            (first, begin), (last, end) = (self._at(time - late) for time in times)
            way = compose(relative(first, last), places)[:, :2] - places[:, :2]
            size = np.hypot(way[:, 0], way[:, 1])
            counts = seen & (size >= most)
            if not counts.any() or (np.hypot(*moved[counts].T) > STILL * size[counts]).any():
                return False
            plate = self._told[-1][2]
            ahead = rotate(float(plate[2]), way) / np.maximum(size, 1e-9)[:, None]
            beyond = ((compose(plate, places)[:, :2] - poses[1].mean(axis=0)) * ahead).sum(axis=1)
            believed = compose(relative(begin, end), places)[:, :2] - places[:, :2]
            stands = np.hypot(believed[:, 0], believed[:, 1]) <= STILL * size
            if not (stands | (beyond >= PRESSED))[counts].all():
                return False
        return True

    def _at(self, time: float) -> tuple[FloatArray, FloatArray]:
        """Return where the plate was told to be, from where it began, and where it was believed to be (3,)."""
        return self._told[max(int(np.searchsorted(self._times, time, side="right")) - 1, 0)][1:]

    def _blamed(self) -> tuple[str, ...]:
        assert self._first is not None
        way = np.hypot(*(self._last[:, :2] - self._first[:, :2]).T)  # NaN of what was never seen
        most = max(0.5 * DRIVEN, SIGMAS * self._noise)
        rested = tuple(name for name, gone in zip(self._names, way, strict=True) if gone <= most)
        if not (way > most).any():
            return self._names
        return rested or ((self._onto,) if self._onto else self._names)
