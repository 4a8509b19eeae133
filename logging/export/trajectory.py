"""The timed motion of a run as JSON, for programs in other languages; the documentation names every key."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.logging.messages.recorded import RecordedRun
from pushplan.mechanics.body import outline_of_all
from pushplan.plans.trajectory import Trajectory
from pushplan.util.arrays import FloatArray
from pushplan.util.outputs.write import write_whole

FORMAT = "pushplan-trajectory/1"


def write_trajectory(run: RecordedRun, path: Path | str) -> None:
    """Write the document of `trajectory_document`, all numbers in full precision.

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
