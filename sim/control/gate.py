"""Which measured poses are held back: those that leap, until the next one agrees.

From one measurement to the next an object rests, or moves with the plate. One that does neither was displaced, or its
measurement is wrong: a reflection, another object taken for it. What was displaced is measured there again.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

from pushplan.geometry.se2 import compose, pose_error, relative
from pushplan.util.arrays import FloatArray

LEAP = np.array([0.01, np.radians(5.0)])
"""What (m, rad) an object may leap at least: less is told from noise by what the loop expects of it."""
SIGMAS = 6.0
"""Standard deviations of noise, and medians of what was measured lately, that it may leap."""
LATELY = 32
"""Measurements that these medians are of."""
AGREED = 3.0
"""Time between two measurements that can agree, s."""


class Seen(NamedTuple):
    """Where an object was measured (3,), when (s), and where the plate was (3,)."""

    time: float
    pose: FloatArray
    plate: FloatArray


class Gate:
    """Holds back what leaps."""

    def __init__(self) -> None:
        self._kept: dict[int, Seen] = {}
        self._held: dict[int, Seen] = {}
        self._lately: deque[FloatArray] = deque(maxlen=LATELY)

    def passed(self, time: float, poses: FloatArray, plate: FloatArray, noise: FloatArray) -> tuple[FloatArray, int]:
        """Return poses (n, 3) with NaN for those that are held back, and which before was wrong; -1 for none.

        Args:
            time: Of the measurement, s.
            poses: (n, 3) measured, NaN where unseen.
            plate: (3,) pose of the plate then, by odometry.
            noise: (2,) standard deviations as stated, m and rad.
        """
        often = np.median(self._lately, axis=0) if len(self._lately) > LATELY // 2 else np.zeros(2)
        allowed = np.maximum(LEAP, SIGMAS * np.maximum(noise, often))
        poses, wrong, leapt = poses.copy(), -1, dict[int, Seen]()
        for i in np.flatnonzero(~np.isnan(poses[:, 0])).tolist():
            now, kept = Seen(time, poses[i], plate), self._kept.get(i)
            off = None if kept is None or time - kept.time > AGREED else _leap(kept, now)
            if off is not None:
                self._lately.append(off)
            if off is None or (off <= allowed).all():
                held = self._held.pop(i, None)
                if held is not None and (_leap(held, now) > allowed).any():
                    wrong = i
                self._kept[i] = now
            else:
                leapt[i] = now
        for i, now in leapt.items():
            held = self._held.get(i)
            agrees = held is not None and time - held.time <= AGREED and (_leap(held, now) <= allowed).all()
            # Where another was that has leapt, too, it is taken for that.
            swapped = any((_leap(self._kept[k], now) <= allowed).all() for k in leapt if k != i)
            if agrees and not swapped:
                self._kept[i] = Seen(time, now.pose.copy(), plate)
                del self._held[i]
            else:
                self._held[i] = Seen(time, now.pose.copy(), plate)
                poses[i] = np.nan
        return poses, wrong


def _leap(before: Seen, now: Seen) -> FloatArray:
    """Return how far (2,), m and rad, an object is from where it would be at rest or on the plate, the nearer one."""
    carried = compose(now.plate, relative(before.plate, before.pose))
    return np.array(min((pose_error(now.pose, pose) for pose in (before.pose, carried)), key=lambda e: e[0]))
