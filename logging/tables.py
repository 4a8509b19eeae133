"""A run for other programs: its samples as a CSV table, its timed motion as JSON, every number in full precision."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.logging.recorded import RecordedRun
from pushplan.logging.shown import contact_names
from pushplan.plans.run import Run
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray
from pushplan.util.files import write_pieces, write_whole

_AT_ONCE = 10_000
"""Rows that exist as text in memory."""


def write_csv(run: Run | RecordedRun, path: Path | str) -> None:
    """Write the columns of `table` as CSV: a line of names, then a line a sample.

    Raises:
        PushplanError: When nothing was executed.
        OutputError: When the file cannot be written.
    """
    columns = table(run)
    rows = np.column_stack(list(columns.values()))
    parts = (rows[begin : begin + _AT_ONCE].tolist() for begin in range(0, len(rows), _AT_ONCE))
    write_pieces(path, map(_lines, chain([[list(columns)]], parts)))


def _lines(rows: Iterable[Iterable[object]]) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue().encode()


def table(run: Run | RecordedRun) -> dict[str, FloatArray]:
    """Return the columns (m,) by name; SI units, radians; NaN where an object is not pushed.

    `t`, `segment`; `x`, `y`, `theta` of the plate frame in the world; `vx`, `vy`, `omega` of its body twist;
    `base_x`, `base_y`, `base_theta`, `base_vx`, `base_vy`, `base_omega` of the robot's base, in its own frame; for
    each object O `O.x`, `O.y`, `O.theta` in the world; where contacts may slip `fx`, `fy`, `torque` with which the
    plate pushes, contact's frame; then for each contact C `C.margin` and, where they are known, `C.dynamic_margin`,
    `C.friction_margin`, `C.lambda`, `C.force_x`, `C.force_y` (contact's frame).

    Raises:
        PushplanError: When nothing was executed.
    """
    execution = run.execution
    if execution is None:
        raise PushplanError(f"{run.log}: nothing was executed, so there is no table to write")
    base = base_in_plate(run.scenario)
    series: dict[tuple[str, ...], FloatArray] = {
        ("x", "y", "theta"): execution.poses,
        ("vx", "vy", "omega"): execution.twists,
        ("base_x", "base_y", "base_theta"): se2.compose(execution.poses, base),
        ("base_vx", "base_vy", "base_omega"): se2.twist_of(base, execution.twists),
    }
    for k, name in enumerate(execution.names):
        series[f"{name}.x", f"{name}.y", f"{name}.theta"] = execution.objects[:, k]
    if execution.wrenches is not None:
        series["fx", "fy", "torque"] = execution.wrenches
    if execution.needed_forces is not None:
        series["needed_force",] = execution.needed_forces[:, None]
    columns = {"t": execution.t, "segment": execution.segment.astype(np.float64)}
    for names, values in series.items():
        columns |= dict(zip(names, values.T, strict=True))
    known = {
        "margin": execution.margins,
        "dynamic_margin": execution.dynamic_margins,
        "friction_margin": execution.friction_margins,
        "lambda": execution.lambdas,
        "force_x": None if execution.forces is None else execution.forces[..., 0],
        "force_y": None if execution.forces is None else execution.forces[..., 1],
    }
    for k, contact in enumerate(contact_names(run.scenario)):
        columns |= {f"{contact}.{name}": values[:, k] for name, values in known.items() if values is not None}
    return columns


def base_in_plate(scenario: Scenario) -> FloatArray:
    """Return the pose (3,) of the robot's base in the plate frame."""
    return se2.relative(scenario.pusher.plate_pose, scenario.pusher.base_pose)


FORMAT = "pushplan-trajectory/2"


def write_trajectory(run: Run | RecordedRun, path: Path | str) -> None:
    """Write the document of `trajectory_document` as JSON, all numbers in full precision.

    Raises:
        PushplanError: When there is no trajectory.
        OutputError: When the file cannot be written.
    """
    write_whole(path, (json.dumps(trajectory_document(run), allow_nan=False) + "\n").encode())


def trajectory_document(run: Run | RecordedRun) -> dict[str, Any]:
    """Return segments, trajectory and samples of plate and base as plain data; SI units, radians, angles run on.

    Raises:
        PushplanError: When there is no trajectory.
    """
    plan, scenario = run.plan, run.scenario
    if plan is None or plan.trajectory is None:
        raise PushplanError(f"{run.log}: there is no plan, so there is no trajectory to write")
    trajectory, base = plan.trajectory, base_in_plate(scenario)
    goals = [
        {
            "objects": list(load.names),
            "pose": goal.pose_chain.tolist(),
            "tolerance": {"position": goal.position_tolerance, "angle": goal.angle_tolerance},
        }
        for load in scenario.loads
        for goal in scenario.goals.get(load.name, ())
    ]
    segments = [
        {
            "kind": segment.kind,
            "objects": [] if segment.load is None else list(segment.load.names),
            "t0": begin,
            "start": segment.path.start.tolist(),
            "arcs": [
                {"twist": twist, "length": length}
                for twist, length in zip(segment.path.twists.tolist(), segment.path.lengths.tolist(), strict=True)
            ],
        }
        for segment, begin in zip(plan.segments, plan.times.tolist(), strict=False)
    ]
    return {
        "format": FORMAT,
        "scenario": scenario.name,
        "duration": trajectory.duration,
        "base_in_plate": base.tolist(),
        "footprint": scenario.footprint.tolist(),
        "goals": goals,
        "segments": segments,
        "polynomials": {"breaks": trajectory.breaks.tolist(), "coefficients": trajectory.coefficients.tolist()},
        "samples": {
            "rate": trajectory.rate,
            "t": trajectory.t.tolist(),
            "plate_poses": trajectory.poses.tolist(),
            "plate_twists": trajectory.twists.tolist(),
            "base_poses": se2.compose(trajectory.poses, base).tolist(),
            "base_twists": se2.twist_of(base, trajectory.twists).tolist(),
        },
    }
