"""A run made by hand, without planner or simulator, and logs of it."""

from __future__ import annotations

import dataclasses
import struct
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import count, takewhile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pushplan.logging.old.messages.recorded import RecordedRun
from pushplan.logging.old.reader import read_run
from pushplan.logging.old.writer import RunLogWriter
from pushplan.plans.execution import Execution
from pushplan.plans.result import Diagnosis, PlanResult, ProgressPoint

from pushplan.mechanics.chain import Limits
from pushplan.planners.timing.arc_limits import Bounds
from pushplan.planners.timing.exact_timing import time_path
from pushplan.plans.path import PushPath, cost_rate
from pushplan.plans.robustness import Robustness
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.model import Scenario

SCENARIO = """\
format: pushplan/1
name: two-crates
floor: {friction: 0.30}
objects:
  - {name: near, shape: {box: [0.10, 0.08]}, mass: 1.2}
  - name: far
    shape: {polygon: [[-0.05, -0.04], [0.05, -0.04], [0.01, 0.0], [0.05, 0.04], [-0.05, 0.04]]}
    mass: 0.8
contacts: {friction: 0.25}
pusher: {width: 0.20, thickness: 0.03, friction: 0.55, limits: {contact: quasi-static}}
goal: {pose: [1.2, 0.8, 90 deg], of: far}
stability: {margin: 0.0}
trajectory: exact
workspace: {x: [-0.5, 2.0], y: [-0.5, 2.0]}
obstacles:
  - {polygon: [[0.5, 0.2], [0.7, 0.2], [0.6, 0.5]]}
  - {circle: 0.1, center: [1.0, 0.2]}
"""


@dataclass(frozen=True)
class Case:
    """A scenario, a plan and an execution that fit together in shape, filled with awkward numbers."""

    scenario: Scenario
    plan: PlanResult
    execution: Execution

    @property
    def result(self) -> PlanResult:
        """What planning returned: the plan with its execution."""
        return replace(self.plan, execution=self.execution)

    def write(self, path: Path, outcome: str = "solved") -> Path:
        """Write the log of the run."""
        settings = {"planner": self.plan.planner, "set": self.plan.stable_set, "seed": self.plan.seed}
        with RunLogWriter.create(path, self.scenario, settings) as log:
            log.plan(self.plan)
            log.execution(self.execution)
            log.finish(outcome)
        return path

    def unsolved(self) -> Case:
        """Return the same case without a solution."""
        plan = replace(self.plan, solved=False, reason="no path", path=None, trajectory=None, min_margin=None)
        numbers = {"passage": 0.1 + 0.2, "needed": 1.0 / 3.0}
        found = (Diagnosis("gap", "too narrow", True, numbers), Diagnosis("time", "not over", False))
        error = (0.25, 1.0 / 7.0)
        plan = replace(plan, diagnosis=found, approximate_path=self.plan.path, approximate_error=error)
        return replace(self, plan=replace(plan, first_solution_s=None, progress=()))

    def unknown_loads(self) -> Case:
        """Return the same case where nobody knows the contact forces."""
        execution = replace(self.execution, friction_margins=None, lambdas=None, forces=None)
        return replace(self, execution=execution)


def _plan() -> PlanResult:
    twists = np.array([[1.0, 0.0, 0.4], [1.0, 0.1, 0.0], [1.0, -0.05, -0.7]])
    path = PushPath(
        np.array([0.1, -0.2, 0.3]), twists / cost_rate(twists)[:, None], np.array([0.11, 0.07, 0.13])
    )
    rng = np.random.default_rng(7)
    return PlanResult(
        solved=True,
        reason="",
        planner="rrt",
        stable_set="ecof",
        seed=5,
        path=path,
        trajectory=time_path(path, Bounds(Limits())),
        first_solution_s=0.012345678901234567,
        planning_s=1.9876543210987654,
        progress=(ProgressPoint(0.0123, 3.3, 10), ProgressPoint(0.5, 1.0 / 3.0, 1000)),
        extensions=12345,
        min_margin=0.1 + 0.2,
        tree=rng.normal(size=(40, 2, 3)),
        lower_bound=0.1 + 0.2,
        objective="margin",
        margin_asked=1.0 / 3.0,
        margin=0.1 + 0.2,
        robustness=Robustness(0.1 + 0.2, 0.0, 1.0, 5e-324, 1.0 / 3.0),
    )


def _execution(plan: PlanResult) -> Execution:
    assert plan.trajectory is not None
    t = plan.trajectory.t
    rng = np.random.default_rng(11)
    margins = rng.uniform(0.05, 0.4, size=(len(t), 2))
    margins[0] = 5e-324, 0.1  # the smallest double there is
    forces = rng.normal(size=(len(t), 2, 2)) * 10.0 ** rng.integers(-300, 300, size=(len(t), 2, 2))
    forces[1] = -0.0
    return Execution(
        t=t,
        poses=plan.trajectory.poses,
        twists=plan.trajectory.twists,
        margins=margins,
        friction_margins=rng.normal(size=(len(t), 2)),
        lambdas=rng.uniform(size=(len(t), 2)),
        forces=forces,
        loss=None,
        goal_error=(1e-9, 1e-17),
        dynamic_margins=rng.uniform(0.02, 0.4, size=(len(t), 2)),
    )


@pytest.fixture(scope="session")
def case() -> Case:
    """Return a solved run."""
    plan = _plan()
    return Case(scenario_from_text(SCENARIO), plan, _execution(plan))


@pytest.fixture(scope="session")
def whole_log(case: Case, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Return the bytes of the log of that run."""
    return case.write(tmp_path_factory.mktemp("whole") / "run.mcap").read_bytes()


def _metadata_places(log: bytes) -> dict[str, slice]:
    """Return where each word of the metadata lies in a log, found without the project's reader."""
    places = {}
    improvements = (f"pushplan.progress.{k:04d}" for k in count())
    logged = takewhile(lambda name: name.encode() in log, improvements)
    for name in ("pushplan.run", *logged, "pushplan.planning", "pushplan.result"):
        marker = struct.pack("<I", len(name)) + name.encode()
        at = log.index(marker) + len(marker)
        end = at + 4 + struct.unpack_from("<I", log, at)[0]
        at += 4
        while at < end:
            key, at = _text(log, at)
            begin = at + 4
            _, at = _text(log, at)
            places[f"{name}/{key}"] = slice(begin, at)
    return places


def _text(log: bytes, at: int) -> tuple[str, int]:
    end = at + 4 + struct.unpack_from("<I", log, at)[0]
    return log[at + 4 : end].decode(), end


@pytest.fixture(scope="session")
def differing() -> Callable[[bytes, bytes], set[str]]:
    """Return a function that names the words in which two logs differ; it fails if anything else does."""

    def words(first: bytes, second: bytes) -> set[str]:
        places = _metadata_places(first)
        assert places == _metadata_places(second)
        different = np.flatnonzero(
            np.frombuffer(first, dtype=np.uint8) != np.frombuffer(second, dtype=np.uint8)
        )
        found = {name: set(range(place.start, place.stop)) for name, place in places.items()}
        assert set(different.tolist()) <= set().union(*found.values())
        return {name for name, bytes_ in found.items() if bytes_ & set(different.tolist())}

    return words


def _assert_same(first: Any, second: Any) -> None:
    """Compare dataclasses, arrays and numbers bit for bit."""
    assert type(first) is type(second)
    if dataclasses.is_dataclass(first):
        for field in dataclasses.fields(first):
            _assert_same(getattr(first, field.name), getattr(second, field.name))
    elif isinstance(first, np.ndarray):
        assert (first.shape, first.dtype, first.tobytes()) == (second.shape, second.dtype, second.tobytes())
    elif isinstance(first, tuple):
        assert len(first) == len(second)
        for a, b in zip(first, second, strict=True):
            _assert_same(a, b)
    else:
        assert first == second or (first != first and second != second)


@pytest.fixture(scope="session")
def assert_same() -> Callable[[Any, Any], None]:
    """Return the comparison."""
    return _assert_same


@pytest.fixture(scope="session")
def recorded(case: Any, tmp_path_factory: pytest.TempPathFactory) -> RecordedRun:
    """Return a run read back."""
    return read_run(case.write(tmp_path_factory.mktemp("exports") / "run.mcap"))


@pytest.fixture(scope="session")
def unsolved(case: Any, tmp_path_factory: pytest.TempPathFactory) -> RecordedRun:
    """Return a run without a path, read back."""
    path = tmp_path_factory.mktemp("exports") / "run.mcap"
    with RunLogWriter.create(path, case.scenario, {}) as log:
        log.plan(case.unsolved().plan)
        log.finish("unsolved")
    return read_run(path)
