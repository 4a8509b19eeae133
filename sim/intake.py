"""What comes in from a robot: what is no number, no pose or no time is dropped, and told."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from pushplan.errors import PushplanError
from pushplan.util.arrays import FloatArray, numbers
from pushplan.util.names import FARTHEST

AHEAD = 0.1
"""How far ahead of now a measurement may be stamped, s: clocks of cameras and robots are apart by less."""
LEAP = 5.0
"""Longest time from one step to the next, s."""
QUIET = 1.0
"""For how long the same cause is not told again, s."""


class Intake:
    """Looks through what a controller or follower is given.

    Args:
        tell: Takes the sentence of an event when something is dropped.

    Attributes:
        now: The last time that was one, s; NaN before the first.
        bad: Times since that were none.
    """

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell, self._told = tell, dict[str, float]()
        self.now, self.bad = math.nan, 0

    def drop(self, cause: str, words: str) -> None:
        """Tell that something is dropped, unless the same cause was told a moment ago."""
        if not self.now < self._told.get(cause, -math.inf) + QUIET:
            self._told[cause] = self.now
            self._tell(words)

    def clock(self, now: float) -> bool:
        """Take over the time, s; False where it is none, goes back or leaps."""
        now = _number(now, "the time")
        if not abs(now) < math.inf or now < self.now or now - self.now > LEAP:
            last = "" if math.isnan(self.now) else f" after {self.now:.3f} s"
            self.drop("clock", f"a step at {now:.6g} s{last}; allowed: times that go on, by {LEAP:g} s at most")
            self.bad += 1
            return False
        self.now, self.bad = now, 0
        return True

    def elapsed(self, seconds: float) -> bool:
        """Go on by a time, s; False where it is none, negative or leaps."""
        seconds = _number(seconds, "the time elapsed")
        if not 0.0 <= seconds <= LEAP:
            self.drop("clock", f"{seconds:.6g} s elapsed; allowed: 0 to {LEAP:g} s")
            return False
        self.now = seconds if math.isnan(self.now) else self.now + seconds
        return True

    def stamp(self, time: float | None, latest: float, oldest: float) -> float | None:
        """Return when something was measured, s; None where that cannot be.

        Args:
            time: As stated; None stands for now.
            latest: Of the measurement before.
            oldest: That there is a pose of the plate for.
        """
        if time is None:
            return self.now
        time = _number(time, "the time of a measurement")
        if time == latest:
            return None  # the same once more, as trackers send it that are asked too often
        if max(math.nextafter(latest, math.inf), oldest) <= time <= self.now + AHEAD:
            return time
        allowed = f"{max(latest, oldest):.3f} to {self.now + AHEAD:.3f} s" if latest > oldest else "the last seconds"
        self.drop("stamp", f"a measurement stamped {time:.6g} s came at {self.now:.3f} s; allowed: {allowed}")
        return None

    def pose(self, values: ArrayLike | None, what: str) -> FloatArray | None:
        """Return a pose (3,); None where there is none, or a number is none or absurd.

        Raises:
            PushplanError: When it has another shape, or holds words.
        """
        if values is None:
            return None
        (pose,) = self.poses([values], [what], what)
        return None if np.isnan(pose).any() else pose

    def deviations(self, covariance: ArrayLike | None, count: int) -> FloatArray | None:
        """Return the standard deviations (2,), m and rad, of the worst of some objects; None without, or with none.

        Args:
            covariance: (3, 3) of each measured pose x, y, theta, or (n, 3, 3).
            count: Number of objects.

        Raises:
            PushplanError: When it has another shape, or holds words.
        """
        if covariance is None:
            return None
        found = numbers(covariance, "covariance")
        if found.shape not in ((3, 3), (count, 3, 3)):
            raise PushplanError(f"covariance has shape {found.shape}; it must be (3, 3) or ({count}, 3, 3)")
        found = found.reshape(-1, 3, 3)
        symmetric = np.allclose(found, found.swapaxes(1, 2), rtol=1e-6, atol=0.0)
        if not (np.abs(found) <= FARTHEST).all() or not symmetric or np.linalg.eigvalsh(found).min() < 0.0:
            self.drop("covariance", "a covariance that is none; allowed: symmetric, no eigenvalue below 0")
            return None
        position = np.linalg.eigvalsh(found[:, :2, :2])[:, -1].max()
        return np.sqrt([position, found[:, 2, 2].max()])

    def poses(self, values: object, names: list[str], what: str) -> FloatArray:
        """Return poses (n, 3), NaN where an object was not seen (None, or a row of NaN) or a number is absurd.

        Raises:
            PushplanError: When they have another shape, or hold words.
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
