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
from pushplan.logging.old.messages.recorded import RecordedRun
from pushplan.mechanics.body import outline_of_all
from pushplan.plans.trajectory import Trajectory
from pushplan.util.arrays import FloatArray
from pushplan.util.files import write_pieces, write_whole

_AT_ONCE = 10_000
"""Rows that exist as text in memory."""


def write_csv(run: RecordedRun, path: Path | str) -> None:
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


def table(run: RecordedRun) -> dict[str, FloatArray]:
    """Return the columns (m,) by name; SI units, radians.

    `t`; `x`, `y`, `theta` of the chain frame in the world; `vx`, `vy`, `omega` of the body twist in the chain
    frame; of several pushes, these are the robot's frame and `load_x`, `load_y`, `load_theta` that of the objects;
    where contacts may slip, for each object O `O.x`, `O.y`, `O.theta` in the world, and `fx`, `fy`, `torque` with
    which the plate pushes, chain frame;
    `base_x`, `base_y`, `base_theta`, `base_vx`, `base_vy`, `base_omega` of the robot's base, in its own frame;
    then for each contact C `C.margin` and, where the loads are known, `C.friction_margin`, `C.lambda`,
    `C.force_x`, `C.force_y` (chain frame).

    Raises:
        PushplanError: When nothing was executed.
    """
    execution = run.execution
    if execution is None:
        raise PushplanError(f"{run.path}: nothing was executed, so there is no table to write")
    columns = {
        "t": execution.t,
        **dict(zip(("x", "y", "theta"), execution.poses.T, strict=True)),
        **dict(zip(("vx", "vy", "omega"), execution.twists.T, strict=True)),
    }
    if execution.loads is not None:
        columns |= dict(zip(("load_x", "load_y", "load_theta"), execution.loads.T, strict=True))
    if execution.object_poses is not None:
        for k, obj in enumerate(run.scenario.chain.objects):
            names = [f"{obj.name}.{name}" for name in ("x", "y", "theta")]
            columns |= dict(zip(names, execution.object_poses[:, k].T, strict=True))
    if execution.wrenches is not None:
        columns |= dict(zip(("fx", "fy", "torque"), execution.wrenches.T, strict=True))
    base = run.scenario.chain.pusher.base_pose
    columns |= dict(
        zip(("base_x", "base_y", "base_theta"), se2.compose(execution.poses, base).T, strict=True)
    )
    columns |= dict(
        zip(("base_vx", "base_vy", "base_omega"), se2.twist_of(base, execution.twists).T, strict=True)
    )
    for k in range(execution.margins.shape[1]):
        name = run.scenario.chain.contact_name(k)
        columns[f"{name}.margin"] = execution.margins[:, k]
        if execution.friction_margins is not None:
            columns[f"{name}.friction_margin"] = execution.friction_margins[:, k]
        if execution.lambdas is not None:
            columns[f"{name}.lambda"] = execution.lambdas[:, k]
        if execution.forces is not None:
            columns[f"{name}.force_x"] = execution.forces[:, k, 0]
            columns[f"{name}.force_y"] = execution.forces[:, k, 1]
    return columns


FORMAT = "pushplan-trajectory/1"


def write_trajectory(run: RecordedRun, path: Path | str) -> None:
    """Write the document of `trajectory_document` as JSON, all numbers in full precision.

    Raises:
        PushplanError: When there is no trajectory.
        OutputError: When the file cannot be written.
    """
    write_whole(path, (json.dumps(trajectory_document(run), allow_nan=False) + "\n").encode())


def trajectory_document(run: RecordedRun) -> dict[str, Any]:
    """Return path, trajectory and samples of chain and base as plain data; SI units, radians, angles run on.

    Raises:
        PushplanError: When there is no trajectory.
    """
    plan, goal, chain = run.plan, run.scenario.goal, run.scenario.chain
    if plan is None or plan.path is None or plan.trajectory is None:
        raise PushplanError(f"{run.path}: there is no plan, so there is no trajectory to write")
    trajectory, path = plan.trajectory, plan.path
    footprint = se2.transform_points(se2.inverse(trajectory.base), outline_of_all(chain.bodies))
    arcs = zip(path.twists.tolist(), path.lengths.tolist(), strict=True)
    return {
        "format": FORMAT,
        "scenario": run.scenario.name,
        "duration": trajectory.duration,
        "base_in_chain": trajectory.base.tolist(),
        "footprint": footprint.tolist(),
        "goal": {
            "chain": goal.pose_chain.tolist(),
            "base": se2.compose(goal.pose_chain, trajectory.base).tolist(),
            "tolerance": {"position": goal.position_tolerance, "angle": goal.angle_tolerance},
        },
        "path": {
            "start": path.start.tolist(),
            "arcs": [{"twist": twist, "length": length} for twist, length in arcs],
        },
        "polynomials": {
            "breaks": trajectory.breaks.tolist(),
            "coefficients": trajectory.coefficients.tolist(),
        },
        "samples": {"rate": trajectory.rate, **_samples(trajectory)},
    }


def _samples(trajectory: Trajectory) -> dict[str, Any]:
    columns: dict[str, FloatArray] = {
        "t": trajectory.t,
        "chain_poses": trajectory.poses,
        "chain_twists": trajectory.twists,
        "base_poses": trajectory.base_poses,
        "base_twists": trajectory.base_twists,
    }
    return {name: column.tolist() for name, column in columns.items()}
