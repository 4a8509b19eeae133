"""Gate for measured poses: a pose that leaps is held back until the next measurement confirms it.

Between two measurements an object rests or moves with the plate. If it does neither, it was displaced, or its
measurement is wrong: a reflection, or another object. A displaced object is measured at its new pose again. Objects
that are measured at the poses of others have exchanged names. The scatter of measurements gives their noise.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from pushplan.geometry.se2 import compose, pose_error, relative
from pushplan.util.arrays import FloatArray

LEAP = np.array([0.01, np.radians(5.0)])
"""Smallest leap that is held back (m, rad); the control loop itself detects smaller ones."""
SIGMAS = 8.0
"""Smallest leap that is held back, in standard deviations of the noise."""
LATELY, FEWEST = 128, 24
"""Largest and smallest number of measurements from which the noise is estimated."""
SURE = 6.5
"""Threshold of the estimated noise: it counts above 1 + SURE / sqrt(number of measurements) times the nominal noise,
1.57 for 128. The median of 128 scatters by a tenth."""
MEDIANS = np.array([1.665, 0.954])
"""Medians of the distance and of the angle between two measurements, in standard deviations of one."""
ELSEWHERE = 0.5
"""Largest distance from another object's last pose, as a share of the leap, at which a pose can belong to it."""


class Seen(NamedTuple):
    """Measured pose of an object (3,), and the pose of the plate at that time (3,)."""

    pose: FloatArray
    plate: FloatArray


class Gate:
    """Holds back poses that leap, and restores exchanged names."""

    def __init__(self) -> None:
        self._kept: dict[int, Seen] = {}
        self._held: dict[int, Seen] = {}
        self._lately: deque[FloatArray] = deque(maxlen=LATELY)

    def noise(self, stated: FloatArray) -> FloatArray:
        """Return the standard deviations (2,) of measurements, m and rad: nominal, or estimated if larger."""
        count = len(self._lately)
        if count < FEWEST:
            return stated
        seen = np.median(self._lately, axis=0) / MEDIANS
        return np.where(seen > (1.0 + SURE / math.sqrt(count)) * stated, seen, stated)

    def passed(self, poses: FloatArray, plate: FloatArray, noise: FloatArray) -> tuple[FloatArray, list[int], bool]:
        """Return the accepted part of a measurement.

        Args:
            poses: Measured poses, NaN for unseen objects, (n, 3).
            plate: Pose of the plate at that time, by odometry, (3,).
            noise: Standard deviations, m and rad, (2,).

        Returns:
            Poses (n, 3), NaN for those held back; indices of objects whose previous measurement was wrong; and
            whether names were exchanged.
        """
        allowed = np.maximum(LEAP, SIGMAS * noise)
        passed, wrong, leapt = np.full_like(poses, np.nan), [], dict[int, Seen]()
        for i in np.flatnonzero(~np.isnan(poses[:, 0])).tolist():
            now = Seen(poses[i].copy(), plate)
            off = _leap(self._kept[i], now) if i in self._kept else np.full(2, np.inf)
            if (off > allowed).any():
                leapt[i] = now
                continue
            self._lately.append(off)
            held = self._held.pop(i, None)
            if held is not None and (_leap(held, now) > allowed).any():
                wrong.append(i)
            self._kept[i], passed[i] = now, now.pose
        gone = [k for k in self._kept if np.isnan(passed[k, 0])]
        was = {k: self._kept[k] for k in gone}
        exchanged = False
        for i, now in leapt.items():
            others = {k: _leap(was[k], now) for k in gone if k != i}
            other = min(others, key=lambda k: float(others[k][0]), default=i)
            if other != i and (others[other] <= allowed).all():
                self._kept[other], passed[other], exchanged = now, now.pose, True
                continue
            held, off = self._held.get(i), _leap(was[i], now) if i in was else np.zeros(2)
            there = other != i and others[other][0] < ELSEWHERE * off[0]
            if i in was and not there:
                self._lately.append(off)
            if held is not None and (_leap(held, now) <= allowed).all() and not there:
                self._kept[i], passed[i] = now, now.pose
                del self._held[i]
            else:
                self._held[i] = now
        return passed, wrong, exchanged


def _leap(before: Seen, now: Seen) -> FloatArray:
    """Return the leap (2,), m and rad: the pose error from rest or from motion with the plate, the smaller one."""
    carried = compose(now.plate, relative(before.plate, before.pose))
    return np.array(min((pose_error(now.pose, pose) for pose in (before.pose, carried)), key=lambda e: e[0]))
