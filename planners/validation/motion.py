"""A motion through given poses, by the travel of the body's farthest point: a constant twist between neighbours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pushplan.geometry import se2
from pushplan.plans.path import PushPath
from pushplan.util.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Motion:
    """Poses by travel.

    Attributes:
        poses: (m, 3) that it passes through, m > 0.
        twists: (m - 1, 3) whose exponentials lead from each pose to the next.
        travel: (m,) that no point of the body exceeds until each pose, m.
    """

    poses: FloatArray
    twists: FloatArray
    travel: FloatArray

    @classmethod
    def through(cls, poses: FloatArray, reach: float) -> Motion:
        """Return the motion of a body that reaches so far (m) from the frame's origin."""
        return cls._of(poses, _log(se2.relative(poses[:-1], poses[1:])), reach)

    @classmethod
    def along(cls, path: PushPath, reach: float) -> Motion:
        """Return the motion along a path."""
        return cls._of(path.knots, path.twists * path.lengths[:, None], reach)

    @classmethod
    def _of(cls, poses: FloatArray, twists: FloatArray, reach: float) -> Motion:
        steps = np.hypot(twists[:, 0], twists[:, 1]) + np.abs(twists[:, 2]) * reach
        return cls(poses, twists, np.concatenate([[0.0], np.cumsum(steps)]))

    def at(self, travel: FloatArray) -> FloatArray:
        """Return the poses (k, 3) at travels (k,), m."""
        if len(self.poses) == 1:
            return np.repeat(self.poses, len(travel), axis=0)
        i = np.clip(np.searchsorted(self.travel, travel, side="right") - 1, 0, len(self.twists) - 1)
        step = self.travel[i + 1] - self.travel[i]
        share = (travel - self.travel[i]) / np.where(step > 0.0, step, 1.0)
        return se2.compose(self.poses[i], se2.exp(self.twists[i] * share[:, None]))


def densify(poses: FloatArray, reach: float, spacing: float) -> FloatArray:
    """Insert poses on the constant-twist motion between neighbours: no body point moves more than `spacing`."""
    if len(poses) < 2:
        return poses
    motion = Motion.through(poses, reach)
    counts = np.maximum(1, np.ceil(np.diff(motion.travel) / spacing)).astype(int)
    owner = np.repeat(np.arange(len(counts)), counts)
    share = (np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[owner]
    inner = se2.compose(poses[owner], se2.exp(motion.twists[owner] * share[:, None]))
    return np.concatenate([inner, poses[-1:]])


def _log(pose: FloatArray) -> FloatArray:
    """Body twists (k, 3) whose exponential are the poses (k, 3); the inverse of `se2.exp`."""
    half = 0.5 * pose[:, 2]
    diagonal = 1.0 / np.where(
        np.abs(half) < 1e-6, 1.0 + half**2 / 3.0, np.tan(half) / np.where(half == 0, 1, half)
    )
    x = diagonal * pose[:, 0] + half * pose[:, 1]
    y = -half * pose[:, 0] + diagonal * pose[:, 1]
    return np.stack([x, y, pose[:, 2]], axis=1)
