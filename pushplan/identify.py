"""Identify friction and loads from the logs of pushes."""

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
    """Identify contact friction, loads and ratios of floor friction from recorded pushes of one chain.

    Args:
        logs: Paths of logs that hold object poses: executions with slip, or with poses on /measured.
        seed: Seed of the random numbers.
        jobs: Number of threads; None for one per processor.
        progress: Callback with the number of finished rounds and of all rounds.

    Raises:
        RunLogError: If a log cannot be read, holds no object poses, or is a run of another chain.
        PushplanError: If there is no log, or nothing moves.
    """
    paths = [logs] if isinstance(logs, Path | str) else list(logs)
    if not paths:
        raise PushplanError("no log is given; name at least one")
    read = [read_push(path) for path in paths]
    scenario = read[0][0]
    for path, (other, _) in zip(paths, read, strict=True):
        _require_same_chain(scenario, other, str(path), str(paths[0]))
    pushes: list[MeasuredPush] = [push for _, push in read]
    return identify_pushes(_world([one for one, _ in read]), pushes, seed=seed, jobs=jobs, progress=progress)


def read_push(path: Path | str) -> tuple[Scenario, MeasuredPush]:
    """Return the scenario and the measured push of a log: the sensor's poses, or else those simulated with slip.

    Raises:
        RunLogError: If the log cannot be read, is not of a single push, or holds no object poses.
    """
    run = load_run(path)
    scenario, execution = run.scenario, run.execution
    if not scenario.task.held:
        raise RunLogError(str(path), f"a run of a {scenario.kind}; identification needs a run of a single push")
    frame = se2.inverse(scenario.chain.pusher.plate_pose)
    if execution is None or execution.wrenches is None:
        raise RunLogError(
            str(path),
            "the log holds no measured object poses; identification needs a log of an execution with slip "
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
    """Return the world of the first scenario, with obstacles and workspace only if all scenarios share them."""
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
