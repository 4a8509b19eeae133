"""Checks of the inputs from a robot: invalid numbers, poses and times are dropped and reported."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from pushplan.errors import PushplanError
from pushplan.util.arrays import FloatArray, numbers
from pushplan.util.names import FARTHEST

AHEAD = 0.1
"""Largest lead of a time stamp over the current time, s; clocks of cameras and robots differ by less."""
LEAP = 5.0
"""Longest time from one step to the next, s."""
QUIET = 1.0
"""Time before the same cause is reported again, s."""


class Intake:
    """Checks the inputs of a controller or follower.

    Args:
        tell: Receiver of the message when an input is dropped.

    Attributes:
        now: Last valid time, s; NaN before the first.
        bad: Number of invalid times since then.
    """

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell, self._told = tell, dict[str, float]()
        self.now, self.bad = math.nan, 0

    def drop(self, cause: str, words: str) -> None:
        """Report a dropped input, unless the same cause was reported within `QUIET`."""
        if not self.now < self._told.get(cause, -math.inf) + QUIET:
            self._told[cause] = self.now
            self._tell(words)

    def clock(self, now: float) -> bool:
        """Set the time, s, and return True; False if it is invalid, goes back or leaps."""
        now = _number(now, "the time")
        if not abs(now) < math.inf or now < self.now or now - self.now > LEAP:
            last = "" if math.isnan(self.now) else f" after {self.now:.3f} s"
            self.drop("clock", f"a step at {now:.6g} s{last}; allowed: rising times, at most {LEAP:g} s apart")
            self.bad += 1
            return False
        self.now, self.bad = now, 0
        return True

    def elapsed(self, seconds: float) -> bool:
        """Advance the time by `seconds` and return True; False if it is invalid, negative or leaps."""
        seconds = _number(seconds, "the time elapsed")
        if not 0.0 <= seconds <= LEAP:
            self.drop("clock", f"{seconds:.6g} s elapsed; allowed: 0 to {LEAP:g} s")
            return False
        self.now = seconds if math.isnan(self.now) else self.now + seconds
        return True

    def stamp(self, time: float | None, latest: float, oldest: float) -> float | None:
        """Return the time of a measurement, s; None if it is a repetition or impossible.

        Args:
            time: Time stamp, s; None for now.
            latest: Time of the previous measurement, s.
            oldest: Earliest time with a known pose of the plate, s.
        """
        if time is None:
            return self.now
        time = _number(time, "the time of a measurement")
        if time == latest:
            return None  # a repetition: trackers that are polled too often send the last measurement again
        if max(math.nextafter(latest, math.inf), oldest) <= time <= self.now + AHEAD:
            return time
        allowed = f"{max(latest, oldest):.3f} to {self.now + AHEAD:.3f} s" if latest > oldest else "the last seconds"
        self.drop("stamp", f"a measurement stamped {time:.6g} s came at {self.now:.3f} s; allowed: {allowed}")
        return None

    def pose(self, values: ArrayLike | None, what: str) -> FloatArray | None:
        """Return a pose (3,); None if it is missing, or a number is not finite or absurdly large.

        Raises:
            PushplanError: If it has another shape, or holds text.
        """
        if values is None:
            return None
        (pose,) = self.poses([values], [what], what)
        return None if np.isnan(pose).any() else pose

    def deviations(self, covariance: ArrayLike | None, count: int) -> FloatArray | None:
        """Return the largest standard deviations (2,) of the objects, m and rad; None without a valid covariance.

        Args:
            covariance: Covariance of the measured poses x, y, theta: (3, 3) for all objects, or (n, 3, 3).
            count: Number of objects.

        Raises:
            PushplanError: If it has another shape, or holds text.
        """
        if covariance is None:
            return None
        found = numbers(covariance, "covariance")
        if found.shape not in ((3, 3), (count, 3, 3)):
            raise PushplanError(f"covariance has shape {found.shape}; it must be (3, 3) or ({count}, 3, 3)")
        found = found.reshape(-1, 3, 3)
        symmetric = np.allclose(found, found.swapaxes(1, 2), rtol=1e-6, atol=0.0)
        if not (np.abs(found) <= FARTHEST).all() or not symmetric or np.linalg.eigvalsh(found).min() < 0.0:
            self.drop("covariance", "an invalid covariance; allowed: symmetric, no eigenvalue below 0")
            return None
        position = np.linalg.eigvalsh(found[:, :2, :2])[:, -1].max()
        return np.sqrt([position, found[:, 2, 2].max()])

    def poses(self, values: object, names: list[str], what: str) -> FloatArray:
        """Return poses (n, 3), NaN for objects that were not seen (None, or a row of NaN) and for absurd numbers.

        Raises:
            PushplanError: If they have another shape, or hold text.
        """
        try:
            rows = [np.full(3, np.nan) if row is None else row for row in values]  # type: ignore[attr-defined]
            poses = np.array(rows, dtype=np.float64)
        except (TypeError, ValueError, OverflowError) as error:
            raise PushplanError(f"{what}: {error}; allowed: {len(names)} times x, y, theta") from error
        if poses.shape != (len(names), 3):
            has = poses.shape if what not in names else poses.shape[1:]
            wanted = (len(names), 3) if what not in names else (3,)
            raise PushplanError(f"{what} has shape {has}; it must be {wanted}")
        for name, pose in zip(names, poses, strict=True):
            if not (np.abs(pose) <= FARTHEST).all():
                if what in names or not np.isnan(pose).all():
                    self.drop(name, f"{name} at {pose.tolist()}; allowed: numbers from -{FARTHEST:g} to {FARTHEST:g}")
                pose[:] = np.nan
        return poses


def _number(value: float, what: str) -> float:
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise PushplanError(f"{what} is {value!r}; it must be a number, s") from error
