"""The errands of one log: whether each begins where the ones before have left everything."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pushplan.geometry import se2
from pushplan.logging.old.check import Check
from pushplan.logging.old.messages import metadata
from pushplan.logging.old.messages.recorded import RecordedRun
from pushplan.logging.old.view.scene import obstacle_outline
from pushplan.plans.execution import Execution
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray
from pushplan.util.names import TO_ITS_GOAL

TOLERANCE = 1e-6
"""What an errand may begin beside where the one before ended, m and rad: files state poses to so many digits."""


def errand_of(run: RecordedRun) -> str:
    """Return the name of what an errand moves; empty where a run is no errand."""
    return run.words.get(metadata.RUN, {}).get("errand", "")


def delivers(run: RecordedRun) -> bool:
    """Tell whether an errand brings what it moves to a goal, or only out of the way."""
    return aim_of(run) == TO_ITS_GOAL


def aim_of(run: RecordedRun) -> str:
    """Return what an errand is for."""
    return run.words.get(metadata.RUN, {}).get("aim", "")


def check_errands(runs: Sequence[RecordedRun]) -> Iterator[Check]:
    """Yield whether each errand begins where the ones before have left the robot and all that they have moved."""
    plate: FloatArray | None = None
    moved: dict[str, RecordedRun] = {}
    for k, run in enumerate(runs, start=1):
        if plate is not None:
            yield _begins(f"errand {k}: the robot's pose", _plate(run)[0], plate)
        for name, before in moved.items():
            end = _executed(before).load_poses[-1]
            if name == errand_of(run):
                yield _begins(f"errand {k}: the pose of {name}", run.scenario.start, end)
                continue
            outlines = [se2.transform_points(end, obj.outline_chain) for obj in before.scenario.chain.objects]
            away = max(_distance(outline, run.scenario) for outline in outlines)
            yield Check(f"errand {k}: {name} among the obstacles", away, TOLERANCE)
        plate, moved[errand_of(run)] = _plate(run)[-1], run


def _begins(what: str, pose: FloatArray, end: FloatArray) -> Check:
    position, angle = se2.pose_error(pose, end)
    return Check(what, max(position, angle), TOLERANCE)


def _distance(outline: FloatArray, scenario: Scenario) -> float:
    """Return by how much the corners of the obstacle that is most like an outline differ from it."""
    shapes = [obstacle_outline(one) for one in scenario.obstacles]
    same = [float(np.abs(shape - outline).max()) for shape in shapes if shape.shape == outline.shape]
    return min(same, default=np.inf)


def _executed(run: RecordedRun) -> Execution:
    assert run.execution is not None
    return run.execution


def _plate(run: RecordedRun) -> FloatArray:
    """Return where the plate's frame is in the world (m, 3)."""
    return se2.compose(_executed(run).poses, run.scenario.chain.pusher.plate_pose)
