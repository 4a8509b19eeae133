"""Learn friction and loads from the logs of pushes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pushplan.errors import PushplanError, RunLogError
from pushplan.geometry import se2
from pushplan.logging.reader import load_run
from pushplan.scenario.model import Scenario
from pushplan.sim.identify.identify import identify_pushes
from pushplan.sim.identify.measured_push import Identification, MeasuredPush
from pushplan.slip.world import World


def identify(
    logs: Sequence[Path | str] | Path | str,
    *,
    seed: int = 1,
    jobs: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Identification:
    """Find contact friction, loads and ratios of floor friction from recorded pushes of one chain.

    Args:
        logs: Paths of logs in which the objects' poses are: executions with slip, or with poses on /measured.
        seed: Of the random numbers.
        jobs: Threads; None for one a processor.
        progress: Called with the rounds that are done, and how many there are.

    Raises:
        RunLogError: When a log cannot be read, tells nothing of the objects, or is one of another chain.
        PushplanError: When there is no log, or nothing moves.
    """
    paths = [logs] if isinstance(logs, Path | str) else list(logs)
    if not paths:
        raise PushplanError("there is no log to learn from; name at least one")
    read = [read_push(path) for path in paths]
    scenario = read[0][0]
    for path, (other, _) in zip(paths, read, strict=True):
        _require_same_chain(scenario, other, str(path), str(paths[0]))
    pushes: list[MeasuredPush] = [push for _, push in read]
    return identify_pushes(_world([one for one, _ in read]), pushes, seed=seed, jobs=jobs, progress=progress)


def read_push(path: Path | str) -> tuple[Scenario, MeasuredPush]:
    """Return the scenario of a log, and what was measured of its push: by a sensor, else as simulated with slip.

    Raises:
        RunLogError: When the log cannot be read, is not of a single push, or tells nothing of where the objects were.
    """
    run = load_run(path)
    scenario, execution = run.scenario, run.execution
    if not scenario.task.held:
        raise RunLogError(str(path), f"a run of a {scenario.kind}; only single pushes can be learned from")
    frame = se2.inverse(scenario.chain.pusher.plate_pose)
    if execution is None or execution.wrenches is None:
        raise RunLogError(
            str(path),
            "nobody measured where the objects went; learning needs a log of an execution whose contacts may slip "
            "(pushplan trial --worst) or of a closed loop",
        )
    plate = se2.compose(execution.poses, frame)
    measured = None if run.feedback is None else run.feedback.measured
    if measured is None or not len(measured.t):
        return scenario, MeasuredPush(plate, execution.objects, str(path), execution.wrenches)
    rows = (measured.t >= execution.t[0]) & (measured.t <= execution.t[-1])
    plate[:, 2] = np.unwrap(plate[:, 2])
    plates, wrenches = (
        np.stack([np.interp(measured.t[rows], execution.t, column) for column in values.T], axis=1)
        for values in (plate, execution.wrenches)
    )
    return scenario, MeasuredPush(plates, measured.poses[rows], str(path), wrenches)


def _world(scenarios: Sequence[Scenario]) -> World:
    """Return the world of the first scenario; what stands in the way only where it is the same in all."""
    world = World.from_scenario(scenarios[0])
    rooms = [(one.resolved().get("obstacles"), one.resolved().get("workspace")) for one in scenarios]
    return world if all(room == rooms[0] for room in rooms) else replace(world, obstacles=(), workspace=None)


def _require_same_chain(first: Scenario, other: Scenario, path: str, begun: str) -> None:
    pairs = list(zip(first.chain.objects, other.chain.objects, strict=False))
    same = len(first.chain.objects) == len(other.chain.objects) and all(
        a.name == b.name
        and a.outline.shape == b.outline.shape
        and np.allclose(a.outline, b.outline, atol=1e-6)
        and np.allclose(a.pose_chain, b.pose_chain, atol=1e-6)
        for a, b in pairs
    )
    if not same:
        raise RunLogError(path, f"a run of another chain than {begun}; all logs must be of the same objects")
