"""Planar poses (x, y, theta) and body twists (vx, vy, omega): composition, inverse, exact exponential."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pushplan.util.arrays import FloatArray


def wrap_angle(angle: ArrayLike) -> FloatArray:
    """Return `angle` shifted by multiples of 2 pi into [-pi, pi), rad."""
    return (np.asarray(angle, dtype=np.float64) + np.pi) % (2.0 * np.pi) - np.pi


def pose_error(pose: FloatArray, goal: FloatArray) -> tuple[float, float]:
    """Return the distance (m) and the absolute angle (rad) between two poses (3,)."""
    return float(np.hypot(*(pose[:2] - goal[:2]))), float(abs(wrap_angle(pose[2] - goal[2])))


def pose_errors(poses: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return the distances (m) and absolute angles (rad) between two arrays of poses (n, 3), (n, 2)."""
    off = poses - wanted
    return np.column_stack([np.hypot(off[:, 0], off[:, 1]), np.abs(wrap_angle(off[:, 2]))])


def rotate(angle: ArrayLike, vectors: ArrayLike) -> FloatArray:
    """Rotate vectors (..., 2) counter-clockwise by angles (...), rad."""
    vectors = np.asarray(vectors, dtype=np.float64)
    c, s = np.cos(angle), np.sin(angle)
    x, y = c * vectors[..., 0] - s * vectors[..., 1], s * vectors[..., 0] + c * vectors[..., 1]
    turned = np.empty((*x.shape, 2))
    turned[..., 0], turned[..., 1] = x, y
    return turned


def transform_points(pose_a_b: ArrayLike, points_b: ArrayLike) -> FloatArray:
    """Map points (..., 2) from frame b to frame a, with the pose (3,) of b in a."""
    pose = np.asarray(pose_a_b, dtype=np.float64)
    return pose[:2] + rotate(pose[2], points_b)


def compose(pose_a_b: ArrayLike, pose_b_c: ArrayLike) -> FloatArray:
    """Return the pose(s) (..., 3) of c in a, from the poses of b in a and of c in b."""
    first, second = np.asarray(pose_a_b, dtype=np.float64), np.asarray(pose_b_c, dtype=np.float64)
    if first.ndim == 1 and second.ndim == 1:  # plain numbers take a fifth of the time of arrays
        (x, y, theta), (u, v, turn) = first.tolist(), second.tolist()
        c, s = float(np.cos(theta)), float(np.sin(theta))
        return np.array([x + (c * u - s * v), y + (s * u + c * v), theta + turn])
    cosine, sine, angle = np.cos(first[..., 2]), np.sin(first[..., 2]), first[..., 2] + second[..., 2]
    pose = np.empty((*angle.shape, 3))
    pose[..., 0] = first[..., 0] + (cosine * second[..., 0] - sine * second[..., 1])
    pose[..., 1] = first[..., 1] + (sine * second[..., 0] + cosine * second[..., 1])
    pose[..., 2] = angle
    return pose


def chained(start: FloatArray, steps: FloatArray) -> FloatArray:
    """Return the poses (m + 1, 3) that begin at `start` (3,); each step (m, 3) is relative to the previous pose."""
    poses = np.empty((len(steps) + 1, 3))
    poses[0], poses[1:, 2] = start, steps[:, 2]
    np.cumsum(poses[:, 2], out=poses[:, 2])
    poses[1:, :2] = rotate(poses[:-1, 2], steps[:, :2])
    np.cumsum(poses[:, :2], axis=0, out=poses[:, :2])
    return poses


def inverse(pose_a_b: ArrayLike) -> FloatArray:
    """Return the pose(s) (..., 3) of a in b, from the pose of b in a."""
    pose = np.asarray(pose_a_b, dtype=np.float64)
    x, y, theta = pose.tolist() if pose.ndim == 1 else (pose[..., 0], pose[..., 1], pose[..., 2])
    c, s = np.cos(theta), np.sin(theta)
    back = np.empty(pose.shape)
    back[..., 0], back[..., 1], back[..., 2] = -c * x - s * y, s * x - c * y, -theta
    return back


def relative(pose_a_b: ArrayLike, pose_a_c: ArrayLike) -> FloatArray:
    """Return the pose(s) (..., 3) of c in b, from the poses of both in a."""
    return compose(inverse(pose_a_b), pose_a_c)


def twist_of(pose_a_b: ArrayLike, twists_a: ArrayLike) -> FloatArray:
    """Return the body twists (..., 3) of a body in its frame b, from its twists in its frame a.

    The origin of b, at (x, y) in a, moves with (vx - omega y, vy + omega x).

    Args:
        pose_a_b: Pose (3,) of b in a.
        twists_a: Body twists (..., 3) in a.
    """
    (x, y, theta), v = np.asarray(pose_a_b, dtype=np.float64), np.asarray(twists_a, dtype=np.float64)
    linear = v[..., :2] + v[..., 2:] * np.array([-y, x])
    return np.concatenate([rotate(-theta, linear), v[..., 2:]], axis=-1)


def exp(twist: ArrayLike) -> FloatArray:
    """Return the pose(s) (..., 3) reached from the origin by the body twist(s) (..., 3) in unit time.

    With phi = omega: x = (sin phi / phi) vx - ((1 - cos phi) / phi) vy and
    y = ((1 - cos phi) / phi) vx + (sin phi / phi) vy. The angle is not wrapped.
    """
    v = np.asarray(twist, dtype=np.float64)
    half = 0.5 * v[..., 2]
    sine = np.sin(half)
    chord = np.where(half == 0.0, 1.0, sine / np.where(half == 0.0, 1.0, half))  # sin(phi/2) / (phi/2)
    a, b = chord * np.cos(half), chord * sine
    pose = np.empty(v.shape)
    pose[..., 0] = a * v[..., 0] - b * v[..., 1]
    pose[..., 1] = b * v[..., 0] + a * v[..., 1]
    pose[..., 2] = v[..., 2]
    return pose


def log(pose: ArrayLike) -> FloatArray:
    """Return the body twist(s) (..., 3) that reach the pose(s) (..., 3) from the origin in unit time; see `exp`."""
    p = np.asarray(pose, dtype=np.float64)
    half = np.asarray(0.5 * p[..., 2])
    sine, straight = np.sin(half), half == 0.0
    chord = np.where(straight, 1.0, sine / np.where(straight, 1.0, half))  # sin(phi/2) / (phi/2)
    a, b = np.cos(half) / chord, sine / chord
    twist = np.empty(p.shape)
    twist[..., 0], twist[..., 1] = a * p[..., 0] + b * p[..., 1], a * p[..., 1] - b * p[..., 0]
    twist[..., 2] = p[..., 2]
    return twist


def between(begin: ArrayLike, end: ArrayLike, share: ArrayLike) -> FloatArray:
    """Return the pose(s) (..., 3) at a share of the motion with a constant twist from `begin` to `end`."""
    return compose(begin, exp(np.asarray(share) * log(relative(begin, end))))
