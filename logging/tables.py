"""Exports for other programs: samples as a CSV table, timed motion as JSON, all numbers in full precision."""

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
from pushplan.logging.signals import series_of
from pushplan.plans.run import Run
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray
from pushplan.util.files import write_pieces, write_whole

_AT_ONCE = 10_000
"""Largest number of rows in memory as text."""


def write_csv(run: Run | RecordedRun, path: Path | str) -> None:
    """Write the columns of `table` as CSV: a line of names, then a line for each sample.

    Raises:
        PushplanError: If nothing was executed.
        OutputError: If the file cannot be written.
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
    """Return the columns (m,) by name, in SI units and radians; NaN while an object is not pushed.

    These are the columns of `signals.SIGNALS` that the run has: first those of the plate; then `base_x`, `base_y`,
    `base_theta`, `base_vx`, `base_vy`, `base_omega` of the robot's base, twists in its own frame; then `O.x` and so
    on of each object O, and `C.margin` and so on of each contact C.

    Raises:
        PushplanError: If nothing was executed.
    """
    execution = run.execution
    if execution is None:
        raise PushplanError(f"{run.log}: nothing was executed, so there is no table to write")
    base, columns = base_in_plate(run.scenario), dict[str, FloatArray]()
    moved = np.column_stack([se2.compose(execution.poses, base), se2.twist_of(base, execution.twists)])
    owners = {"plate": ("",), "object": execution.names, "contact": contact_names(run.scenario)}
    for of, names in owners.items():
        for k, name in enumerate(names):
            for signal, values in series_of(execution):
                if signal.of == of:
                    own = (values if of == "plate" else values[:, k]).reshape(len(values), -1)
                    titles = (f"{name}.{column}" if name else column for column in signal.columns)
                    columns |= dict(zip(titles, own.T.astype(np.float64), strict=True))
        if of == "plate":
            names = ("base_x", "base_y", "base_theta", "base_vx", "base_vy", "base_omega")
            columns |= dict(zip(names, moved.T, strict=True))
    return columns


def base_in_plate(scenario: Scenario) -> FloatArray:
    """Return the pose (3,) of the robot's base in the plate frame."""
    return se2.relative(scenario.pusher.plate_pose, scenario.pusher.base_pose)


FORMAT = "pushplan-trajectory/2"


def write_trajectory(run: Run | RecordedRun, path: Path | str) -> None:
    """Write the document of `trajectory_document` as JSON, with all numbers in full precision.

    Raises:
        PushplanError: If there is no trajectory.
        OutputError: If the file cannot be written.
    """
    write_whole(path, (json.dumps(trajectory_document(run), allow_nan=False) + "\n").encode())


def trajectory_document(run: Run | RecordedRun) -> dict[str, Any]:
    """Return segments, trajectory and samples of plate and base as plain data, in SI units and unwrapped radians.

    Raises:
        PushplanError: If there is no trajectory.
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
