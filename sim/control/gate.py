"""Which measured poses are held back: those that leap, until the next one agrees.

From one measurement to the next an object rests, or moves with the plate. One that does neither was displaced, or its
measurement is wrong: a reflection, another object taken for it. What was displaced is measured there again; objects
that are measured where others were have exchanged their names. How much measurements differ tells their noise.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from pushplan.geometry.se2 import compose, pose_error, relative
from pushplan.util.arrays import FloatArray

LEAP = np.array([0.01, np.radians(5.0)])
"""What (m, rad) an object may leap at least: less is told from noise by what the loop expects of it."""
SIGMAS = 8.0
"""Standard deviations of noise that it may leap."""
LATELY, FEWEST = 128, 24
"""Measurements that tell the noise, and the fewest of them."""
SURE = 6.5
"""Noise is more than stated where it seems so by a share of this over the root of the number of measurements: by 0.57
of 128. The median of so many scatters by a tenth."""
MEDIANS = np.array([1.665, 0.954])
"""Medians of the distance and of the angle between two measurements, in standard deviations of one."""
ELSEWHERE = 0.5
"""Up to this share of its leap from where another object was, one that leapt may be that one."""


class Seen(NamedTuple):
    """Where an object was measured (3,), and where the plate was then (3,)."""

    pose: FloatArray
    plate: FloatArray


class Gate:
    """Holds back what leaps, and gives objects that were taken for one another their names back."""

    def __init__(self) -> None:
        self._kept: dict[int, Seen] = {}
        self._held: dict[int, Seen] = {}
        self._lately: deque[FloatArray] = deque(maxlen=LATELY)

    def noise(self, stated: FloatArray) -> FloatArray:
        """Return standard deviations (2,) of measurements, m and rad: as stated, or as seen if that is more."""
        count = len(self._lately)
        if count < FEWEST:
            return stated
        seen = np.median(self._lately, axis=0) / MEDIANS
        return np.where(seen > (1.0 + SURE / math.sqrt(count)) * stated, seen, stated)

    def passed(self, poses: FloatArray, plate: FloatArray, noise: FloatArray) -> tuple[FloatArray, list[int], bool]:
        """Return what of a measurement counts.

        Args:
            poses: (n, 3) measured, NaN where unseen.
            plate: (3,) pose of the plate then, by odometry.
            noise: (2,) standard deviations, m and rad.

        Returns:
            Poses (n, 3), NaN of what is held back; the objects of which the measurement before was wrong; and whether
            names were exchanged.
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
    """Return how far (2,), m and rad, an object is from where it would be at rest or on the plate, the nearer one."""
    carried = compose(now.plate, relative(before.plate, before.pose))
    return np.array(min((pose_error(now.pose, pose) for pose in (before.pose, carried)), key=lambda e: e[0]))
