"""Real pushes from published measurements against the slip simulator.

Run `python benchmarks/real_pushes.py real_pushes.npz [--fit] [--speed 10]`; prints every figure next to what is
wanted. The file holds pushes from github.com/robinzhoucmu/Pushing (Apache-2.0; the single pushes were recorded by the
MIT MCube lab, Yu et al., IROS 2016), as arrays in SI units:

* `push_*`: straight pushes with one round tip, against even pressure and an unmeasured friction; with `--fit`,
  friction, border share and two tilts of the pressure are fitted to 80 pushes a set and tested on others.
* `line_*`: pushes with two fingers. Each run is predicted from other runs: the outline's place in the
  measured frame from their resting poses, the friction from the other objects.
* `force_*`: force, moment and motion on three feet with loads that follow from the centre of mass.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from typing import Any

import numpy as np
import shapely
from finger_push import FingerPush
from random_chains import tell
from scipy.optimize import least_squares, minimize

from pushplan.bench.store import Machine
from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.mechanics.chain import PushedObject
from pushplan.mechanics.contacts import friction_wrench
from pushplan.mechanics.support import FeetSupport, Support, UniformSupport
from pushplan.scenario.file import scenario_from_document
from pushplan.sim.identify.identify import identify_pushes
from pushplan.sim.identify.measured_push import MeasuredPush
from pushplan.sim.identify.unknowns import MOST_BORDER, MOST_TILT, PressedOutline
from pushplan.sim.slip import simulate_poses
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray, IntArray

Data = Mapping[str, Any]

TIP = np.array([[0.0, 0.0, 4.75e-3]])
LAG = 0.1
"""Between a pose of the hand and the measured one of the object, s: see the data's README."""
TWO = np.array([[0.0, 9e-3, 2.5e-3], [0.0, -9e-3, 2.5e-3]])
"""Fingers: x, y in the hand's frame and radius, m."""
TIP_FRICTION = 0.225
"""The middle of what fits of others found, 0.15 to 0.30."""
LINE_FRICTIONS = (0.25, 0.3, 0.4, 0.5, 0.6)
"""Nobody measured it; those who planned the pushes so that nothing slips took 0.25 to 0.3 and called it cautious."""
SHAPES = {"bigrect_3pts": "bigrect", "bigrect_ridge": "bigrect", "tri": "smalltri", "butter": "smallbutter"}
STEP = 1e-3
FITTED = 80
"""Pushes of a set that are looked at for the fit."""


def resting_on(outline: FloatArray, support: Support) -> PushedObject:
    return PushedObject("object", outline, 1.0, 0.3, support, np.zeros(3))


def off(predicted: FloatArray, measured: FloatArray) -> FloatArray:
    """Return distance (mm) and angle (deg) between poses (k, 3)."""
    away = np.hypot(*(predicted - measured)[:, :2].T)
    return np.column_stack([1e3 * away, np.degrees(np.abs(se2.wrap_angle(predicted[:, 2] - measured[:, 2])))])


# Single pushes


def outcomes(data: Data, push: FingerPush, which: IntArray) -> FloatArray:
    """Return the predicted final poses of single pushes."""
    share = np.linspace(0.0, 1.0, 51)[:, None]
    found = []
    for i in which:
        begin, end = data["push_tip0"][i].astype(float), data["push_tip1"][i].astype(float)
        path = np.column_stack([begin + (end - begin) * share, np.zeros(len(share))])
        found.append(push.push(data["push_init"][i].astype(float), path)[-1])
    return np.array(found)


def single_pushes(data: Data, speed: int) -> bool:
    """Predict with even pressure, without a fit; the mean over sets counts."""
    rows, others = [], []
    for k, which in sets_of(data, speed):
        outline = data[f"shape_{data['set_shape'][k]}"].astype(float)
        push = FingerPush(resting_on(outline, UniformSupport(outline)), TIP, TIP_FRICTION)
        measured = data["push_final"][which].astype(float)
        rows.append(off(outcomes(data, push, which), measured).mean(axis=0))
        others.append([off(data[f"push_{name}"][which], measured).mean(axis=0) for name in ("quad", "poly4")])
        print(f"  {data['set_surface'][k]:8} {data['set_shape'][k]:6} {len(which):4}: {rows[-1].round(2)}")
    mean, published = np.mean(rows, axis=0), np.mean(others, axis=0)
    print(f"  published fits on the same sets: quadratic {published[0].round(2)}, 4th order {published[1].round(2)}")
    good = tell(f"single pushes, {len(rows)} sets, nothing fitted (mm)", float(mean[0]), "<=", 4.0)
    return good & tell(f"single pushes, {len(rows)} sets, nothing fitted (deg)", float(mean[1]), "<=", 5.2)


def sets_of(data: Data, speed: int) -> list[tuple[int, IntArray]]:
    """Return the sets that have pushes at a speed (mm/s), and these pushes."""
    numbers = np.flatnonzero(data["set_speed_mm_s"] == speed)
    found = [(int(k), np.flatnonzero(data["push_set"] == k)) for k in numbers]
    return [(k, which) for k, which in found if len(which)]


def fitted_push(outline: FloatArray, unknowns: FloatArray) -> FingerPush:
    """Return the push with the fitted friction, border and tilts, clipped to the allowed range."""
    border = float(np.clip(unknowns[1], 0.0, MOST_BORDER))
    tilts = np.clip(unknowns[2:4], -MOST_TILT, MOST_TILT)
    pressed = PressedOutline.from_outline(outline, degree=9, marks=48)
    return FingerPush(
        resting_on(outline, pressed.support(border, tilts)), TIP, float(np.clip(unknowns[0], 0.02, 0.8))
    )


def fit(data: Data, outline: FloatArray, which: IntArray) -> FloatArray:
    """Return friction, border and tilts with the smallest error of the predicted final poses."""
    measured = data["push_final"][which].astype(float)

    def cost(unknowns: FloatArray) -> float:
        try:
            errors = off(outcomes(data, fitted_push(outline, unknowns), which), measured)
        except PushplanError:
            return 1e3
        return float((errors[:, 0] + errors[:, 1]).mean())

    begin = np.array([TIP_FRICTION, 0.2, 0.0, 0.0])
    simplex = begin + np.vstack([np.zeros(4), np.diag([-0.08, 0.3, 0.2, 0.2])])
    options = {"initial_simplex": simplex, "maxfev": 90, "xatol": 5e-3, "fatol": 5e-3}
    return np.asarray(minimize(cost, begin, method="Nelder-Mead", options=options).x)


def identified_pushes(data: Data, speed: int) -> bool:
    """Fit on at most 80 pushes of each set, and predict the others."""
    rows = []
    for k, which in sets_of(data, speed):
        outline = data[f"shape_{data['set_shape'][k]}"].astype(float)
        mixed = np.random.default_rng(k).permutation(which)
        unknowns, left = fit(data, outline, mixed[:FITTED]), mixed[FITTED:]
        predicted = outcomes(data, fitted_push(outline, unknowns), left)
        rows.append(off(predicted, data["push_final"][left].astype(float)).mean(axis=0))
        print(
            f"  {data['set_surface'][k]:8} {data['set_shape'][k]:6} {len(left):4}: {rows[-1].round(2)}, friction "
            f"{unknowns[0]:.2f}, border {unknowns[1]:.2f}, tilts {unknowns[2:].round(2)}",
            flush=True,
        )
    mean = np.mean(rows, axis=0)
    good = tell(f"single pushes, identified from {FITTED} a set, the others (mm)", float(mean[0]), "<=", 3.5)
    return good & tell(f"single pushes, identified from {FITTED} a set, the others (deg)", float(mean[1]), "<=", 3.95)


# Pushes with two fingers


def line_pushes(data: Data) -> bool:
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
        p50, p90 = np.percentile(off_by, [50, 90], axis=0).round(2)
        print(f"  friction {friction:4}: median {p50}, p90 {p90} (mm, deg)")
    found = errors[chosen, np.arange(len(samples))]
    for name in SHAPES:
        here = found[objects == name]
        p50, p90 = np.percentile(here, [50, 90], axis=0).round(2)
        friction = LINE_FRICTIONS[chosen[objects == name][0]]
        print(f"  {name:14} {len(here):3}: median {p50}, p90 {p90}, friction {friction} by the others")
    p50, p90 = np.percentile(found, [50, 90], axis=0)
    good = tell(f"{len(found)} held-out two-finger pushes, median (mm)", float(p50[0]), "<=", 2.0)
    good &= tell(f"{len(found)} held-out two-finger pushes, median (deg)", float(p50[1]), "<=", 0.8)
    print(f"  p90 of all: {p90[0]:.1f} mm, {p90[1]:.1f} deg")
    fits = found[objects != "butter"]  # whose outline does not fit where it rests
    p90 = np.percentile(fits, 90, axis=0)
    return good & tell(f"{len(fits)} of them, without the butterfly, p90 (mm)", float(p90[0]), "<=", 4.0)


def _with_friction(data: Data, samples: list[FloatArray], friction: float) -> FloatArray:
    """Return the final errors of all pushes (k, 2), mm and deg, with the outline pose from other runs."""
    found = np.zeros((len(samples), 2))
    for name, shape in SHAPES.items():
        outline = data[f"shape_{shape}"].astype(float)
        own = np.flatnonzero(data["line_object"] == name)
        for run in np.unique(data["line_run"][own]):
            here = own[data["line_run"][own] == run]
            resting = [samples[k][-1] for k in own if k not in here]
            placed = outline + frame_offset(outline, resting)
            push = FingerPush(resting_on(placed, UniformSupport(placed)), TWO, friction)
            for k in here:
                course = from_rest(samples[k])
                predicted = push.push(course[0, 1:4], resampled(course[:, 4:7]))[-1]
                found[k] = off(predicted[None], course[-1:, 1:4])[0]
    return found


def identified_lines(data: Data) -> bool:
    """Identify with `pushplan identify` from half of the pushes of an object's side, and predict the other half."""
    samples = np.split(data["line_samples"].astype(float), data["line_start"][1:-1])
    rows, plain = [], []
    for name, shape in SHAPES.items():
        own = np.flatnonzero(data["line_object"] == name)
        outline = data[f"shape_{shape}"].astype(float)
        outline = outline + frame_offset(outline, [samples[k][-1] for k in own])
        for side in np.unique(data["line_action"][own]):
            here = own[data["line_action"][own] == side]
            if len(here) < 4 or name == "butter":
                continue
            world, pushes = _as_measured(outline, [samples[k] for k in here])
            for k in (0, 1):
                found = identify_pushes(world, pushes[k::2], jobs=1)
                middle = np.median(found.samples, axis=0)
                rows += [_ends_off(found.unknowns.world_for(middle), push) for push in pushes[1 - k :: 2]]
                plain += [_ends_off(world, push) for push in pushes[1 - k :: 2]]
                spans = "; ".join(
                    f"{one.unknown.name} {one.low:.2f} to {one.high:.2f}" for one in found.estimates if one.determined
                )
                print(f"  {name}, side {side}, half {k + 1}: {spans or 'nothing determined'}", flush=True)
    p50, p90 = (np.percentile(rows, q, axis=0) for q in (50, 90))
    even = np.percentile(plain, 50, axis=0)
    print(f"  not learned (friction 0.5, even load): median {even.round(2)}; learned: p90 {p90.round(2)}")
    good = tell(f"{len(rows)} two-finger pushes, learned from others (mm)", float(p50[0]), "<=", 1.8)
    return good & tell(f"{len(rows)} two-finger pushes, learned from others (deg)", float(p50[1]), "<=", 0.8)


def _as_measured(outline: FloatArray, courses: list[FloatArray]) -> tuple[World, list[MeasuredPush]]:
    """Return pushes of one side of an object as measured pushes of the package; the two fingers are a plate."""
    turned = float(np.median([se2.relative(course[-1, 4:7], course[-1, 1:4])[2] for course in courses]))
    along = np.diff(se2.rotate(turned, np.vstack([outline, outline[:1]])), axis=0)
    off_square = se2.wrap_angle(np.arctan2(along[:, 1], along[:, 0]) + 0.5 * np.pi)  # of faces to the rear
    turned -= float(off_square[np.argmin(np.abs(off_square))])  # what is measured is not quite square
    points = [[float(x), float(y)] for x, y in se2.rotate(turned, outline)]
    scenario = scenario_from_document(
        {
            "format": "pushplan/1",
            "name": "real",
            "floor": {"friction": 0.3},
            "contacts": {"friction": 0.5},
            "objects": [{"name": "object", "shape": {"polygon": points}, "mass": 1.0}],
            "pusher": {"width": 2.0 * float(TWO[0, 1] + TWO[0, 2]), "friction": 0.5},
            "start": [0.0, 0.0, 0.0],
            "goal": {"pose": [1.0, 0.0, 0.0]},
        }
    )
    pushes = []
    for course in map(from_rest, courses):
        t, heading = course[:, 0], np.unwrap(course[:, 3])
        # Measured poses of the object come a tenth of a second after those of the hand.
        lagged = [np.interp(t + LAG, t, column) for column in (course[:, 1], course[:, 2], heading)]
        objects = se2.compose(np.column_stack(lagged), [0.0, 0.0, -turned])
        plate = se2.compose(course[:, 4:7], [TWO[0, 2], 0.0, 0.0])
        pushes.append(MeasuredPush(plate[::5], objects[::5, None]))
    return World.from_scenario(scenario), pushes


def _ends_off(world: World, push: MeasuredPush) -> tuple[float, float]:
    """Return the error of a push's predicted final pose, mm and deg."""
    there, plate = world.with_object_poses(push.object_poses[0]), resampled(push.plate_poses)
    report = simulate_poses(np.arange(len(plate), dtype=float), plate, there)
    distance, angle = off(report.objects[-1], push.object_poses[-1])[0]
    return float(distance), float(angle)


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


# Forces


def wrench_directions(data: Data) -> bool:
    """Compare the direction of the floor's wrench with the measured one, moments over the feet's mean distance."""
    angles: dict[str, list[float]] = {}
    for name, feet, twist, wrench in zip(
        data["force_name"], data["force_feet"], data["force_twist"], data["force_wrench"], strict=True
    ):
        feet = feet.astype(float)
        loads = np.linalg.solve(np.vstack([np.ones(3), feet.T]), [1.0, 0.0, 0.0])
        length = float(np.sqrt(loads @ (feet**2).sum(axis=1)))
        obj = resting_on(np.array([[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]]), FeetSupport(feet, loads))
        scale = np.array([1.0, 1.0, 1.0 / length])
        predicted, measured = -friction_wrench(obj, twist[None].astype(float))[0] * scale, wrench * scale
        cosine = predicted @ measured / np.linalg.norm(predicted) / np.linalg.norm(measured)
        angles.setdefault(str(name), []).append(float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))))
    for name, own in angles.items():
        print(f"  {name:24} {len(own):3}: median {np.median(own):.1f} deg, p90 {np.percentile(own, 90):.1f}")
    worst = max(float(np.median(own)) for own in angles.values())
    return tell(f"wrenches on three feet, {len(angles)} sets, the worst set's median (deg)", worst, "<=", 15.0)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", help="the file real_pushes.npz")
    parser.add_argument("--fit", action="store_true", help="identify each set, too: some minutes")
    parser.add_argument("--speed", type=int, default=10, help="of the single pushes, mm/s")
    arguments = parser.parse_args()
    print(Machine.this().words)
    data = dict(np.load(arguments.data))
    good = wrench_directions(data) & line_pushes(data) & single_pushes(data, arguments.speed)
    if arguments.fit:
        good &= identified_lines(data) & identified_pushes(data, arguments.speed)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
