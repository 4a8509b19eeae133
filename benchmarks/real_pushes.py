"""Real pushes from published measurements against the slip simulator.

    python benchmarks/real_pushes.py real_pushes.npz [--speed 10]

The file holds pushes from
github.com/robinzhoucmu/Pushing (Apache-2.0; the single pushes were recorded by the MIT MCube lab, Yu et al., IROS
2016), as arrays in SI units:

* `push_*`: straight pushes with one round tip, predicted with even pressure and a friction that nobody measured.
* `line_*`: pushes with two fingers. Each run is predicted from what other runs tell: the outline's place in the
  measured frame by their resting poses, the friction by the other objects.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import shapely
from finger_push import FingerPush
from scipy.optimize import least_squares
from script import options

from pushplan.geometry import se2
from pushplan.mechanics.chain import PushedObject
from pushplan.mechanics.support import UniformSupport
from pushplan.util.arrays import FloatArray, IntArray

Data = Mapping[str, Any]

TIP = np.array([[0.0, 0.0, 4.75e-3]])
TWO = np.array([[0.0, 9e-3, 2.5e-3], [0.0, -9e-3, 2.5e-3]])
"""Fingers: x, y in the hand's frame and radius, m."""
TIP_FRICTION = 0.225
"""The middle of the values that others fitted, 0.15 to 0.30."""
LINE_FRICTIONS = (0.25, 0.3, 0.4, 0.5, 0.6)
"""Candidates, because nobody measured it; who planned the pushes took 0.25 to 0.3 as a cautious value."""
SHAPES = {"bigrect_3pts": "bigrect", "bigrect_ridge": "bigrect", "tri": "smalltri", "butter": "smallbutter"}
STEP = 1e-3


def pushed_by(fingers: FloatArray, outline: FloatArray, friction: float) -> FingerPush:
    """Return an object with even pressure and the fingers that push it."""
    obj = PushedObject("object", outline, 1.0, 0.3, UniformSupport(outline), np.zeros(3))
    return FingerPush(obj, fingers, friction)


def off(predicted: FloatArray, measured: FloatArray) -> FloatArray:
    """Return distance (mm) and angle (deg) between poses (k, 3)."""
    return se2.pose_errors(predicted, measured) * [1e3, np.degrees(1.0)]


def quantiles(errors: FloatArray) -> str:
    p50, p90 = np.percentile(errors, [50, 90], axis=0).round(2)
    return f"median {p50}, 90 % {p90} (mm, deg)"


def outcomes(data: Data, push: FingerPush, which: IntArray) -> FloatArray:
    """Return the predicted final poses of single pushes."""
    share = np.linspace(0.0, 1.0, 51)[:, None]
    found = []
    for i in which:
        begin, end = data["push_tip0"][i].astype(float), data["push_tip1"][i].astype(float)
        path = np.column_stack([begin + (end - begin) * share, np.zeros(len(share))])
        found.append(push.push(data["push_init"][i].astype(float), path)[-1])
    return np.array(found)


def single_pushes(data: Data, speed: int) -> None:
    """Predict with even pressure, nothing fitted; the mean over sets counts."""
    rows, others = [], []
    for k, which in sets_of(data, speed):
        outline = data[f"shape_{data['set_shape'][k]}"].astype(float)
        push = pushed_by(TIP, outline, TIP_FRICTION)
        measured = data["push_final"][which].astype(float)
        rows.append(off(outcomes(data, push, which), measured).mean(axis=0))
        others.append([off(data[f"push_{name}"][which], measured).mean(axis=0) for name in ("quad", "poly4")])
        print(f"  {data['set_surface'][k]:8} {data['set_shape'][k]:6} {len(which):4}: {rows[-1].round(2)}")
    mean, published = np.mean(rows, axis=0), np.mean(others, axis=0)
    print(f"  published fits on the same sets: quadratic {published[0].round(2)}, 4th order {published[1].round(2)}")
    print(f"single pushes, {len(rows)} sets, nothing fitted: {mean.round(2)} (mm, deg)")


def sets_of(data: Data, speed: int) -> list[tuple[int, IntArray]]:
    """Return the sets that have pushes at a speed (mm/s), and these pushes."""
    numbers = np.flatnonzero(data["set_speed_mm_s"] == speed)
    found = [(int(k), np.flatnonzero(data["push_set"] == k)) for k in numbers]
    return [(k, which) for k, which in found if len(which)]


def line_pushes(data: Data) -> None:
    """Predict the resting poses after pushes with two fingers, each run from what other runs tell.

    The outlines' place in the measured frame comes from the resting poses of the other runs of the same object; the
    friction, which nobody measured, is the one of `LINE_FRICTIONS` with which the other objects are predicted best.
    """
    samples = np.split(data["line_samples"].astype(float), data["line_start"][1:-1])
    errors = np.stack([_with_friction(data, samples, friction) for friction in LINE_FRICTIONS])
    objects, chosen = data["line_object"], np.zeros(len(samples), dtype=int)
    for name in SHAPES:
        others = np.median(errors[:, objects != name], axis=1)
        chosen[objects == name] = int(np.argmin(others[:, 0] + others[:, 1]))
    for friction, off_by in zip(LINE_FRICTIONS, errors, strict=True):
        print(f"  friction {friction:4}: {quantiles(off_by)}")
    found = errors[chosen, np.arange(len(samples))]
    for name in SHAPES:
        here = found[objects == name]
        friction = LINE_FRICTIONS[chosen[objects == name][0]]
        print(f"  {name:14} {len(here):3}: {quantiles(here)}, friction {friction} by the others")
    print(f"{len(found)} held-out two-finger pushes: {quantiles(found)}")


def _with_friction(data: Data, samples: list[FloatArray], friction: float) -> FloatArray:
    """Return the final errors of all pushes (k, 2), mm and deg, with the outline pose from other runs."""
    found = np.zeros((len(samples), 2))
    for name, shape in SHAPES.items():
        outline = data[f"shape_{shape}"].astype(float)
        own = np.flatnonzero(data["line_object"] == name)
        for run in np.unique(data["line_run"][own]):
            here = own[data["line_run"][own] == run]
            resting = [samples[k][-1] for k in own if k not in here]
            push = pushed_by(TWO, outline + frame_offset(outline, resting), friction)
            for k in here:
                course = from_rest(samples[k])
                predicted = push.push(course[0, 1:4], resampled(course[:, 4:7]))[-1]
                found[k] = off(predicted[None], course[-1:, 1:4])[0]
    return found


def frame_offset(outline: FloatArray, resting: list[FloatArray]) -> FloatArray:
    """Return the offset (2,) of the outline in the measured frame, from fingers that touch it at rest."""

    def gaps(offset: FloatArray) -> FloatArray:
        polygon = shapely.Polygon(outline + offset)
        found = []
        for row in resting:
            tips = se2.transform_points(se2.relative(row[1:4], row[4:7]), TWO[:, :2])
            points = shapely.points(tips)
            inside = np.where(shapely.contains(polygon, points), -1.0, 1.0)
            found.append(1e3 * (inside * shapely.distance(polygon.exterior, points) - TWO[:, 2]))
        return np.concatenate(found)

    return np.asarray(least_squares(gaps, np.zeros(2), x_scale=1e-3, diff_step=1e-3, loss="soft_l1").x)


def from_rest(course: FloatArray) -> FloatArray:
    """Return the measured push from the last moment at which the hand stood still before the object moved."""
    way = np.hypot(*(course[:, 1:3] - course[0, 1:3]).T) + 0.03 * np.abs(course[:, 3] - course[0, 3])
    steps = np.hypot(*np.diff(course[:, 4:6], axis=0).T) + 0.03 * np.abs(np.diff(course[:, 6]))
    still = np.flatnonzero(steps[: int(np.argmax(way > 1.5e-3))] < 2e-5)
    return course[int(still[-1]) if len(still) else 0 :]


def resampled(poses: FloatArray) -> FloatArray:
    """Return poses between which the hand moves by `STEP`."""
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T) + 0.03 * np.abs(np.diff(poses[:, 2]))
    way = np.concatenate([[0.0], np.cumsum(steps)])
    kept = np.append(True, np.diff(way) > 1e-9)
    marks = np.linspace(0.0, way[-1], max(2, int(way[-1] / STEP)) + 1)
    return np.column_stack([np.interp(marks, way[kept], poses[kept, j]) for j in range(3)])


def main() -> None:
    asked = options(__doc__, "data", speed=10)
    data = dict(np.load(asked.data))
    line_pushes(data)
    single_pushes(data, asked.speed)


if __name__ == "__main__":
    main()
