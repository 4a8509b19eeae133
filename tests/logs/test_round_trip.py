"""What is written is read back bit for bit."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from pushplan.logging.old.messages import blocks
from pushplan.logging.old.messages.effort import Effort, exact
from pushplan.logging.old.messages.schemas import Array
from pushplan.logging.old.reader import read_run
from pushplan.logging.old.writer import RunLogWriter
from pushplan.plans.execution import StabilityLoss


@pytest.mark.parametrize("variant", ["solved", "unknown_loads", "lost"])
def test_a_run_comes_back_bit_for_bit(
    case: Any, tmp_path: Path, variant: str, assert_same: Callable[[Any, Any], None]
) -> None:
    if variant == "unknown_loads":
        case = case.unknown_loads()
    if variant == "lost":
        loss = StabilityLoss(time=1.0 / 3.0, contact=1, margin=-1e-17, pose=(0.1, 0.2, 0.3))
        case = dataclasses.replace(case, execution=dataclasses.replace(case.execution, loss=loss))
    run = read_run(case.write(tmp_path / "run.mcap"))
    assert_same(run.plan, case.result)
    assert_same(run.execution, case.execution)
    assert run.scenario == case.scenario
    assert run.scenario.source == case.scenario.source
    assert run.losses == ()
    assert run.outcome == "solved"
    assert_same(run.trajectory, case.plan.trajectory)
    assert_same(run.margins, case.execution.margins)


def test_an_unsolved_run_comes_back(
    case: Any, tmp_path: Path, assert_same: Callable[[Any, Any], None]
) -> None:
    unsolved = case.unsolved()
    with RunLogWriter.create(tmp_path / "run.mcap", unsolved.scenario, {}) as log:
        log.plan(unsolved.plan)
        log.finish("unsolved")
    run = read_run(tmp_path / "run.mcap")
    assert_same(run.plan, unsolved.plan)
    assert run.execution is None
    assert run.margins is None
    assert run.trajectory is None
    assert run.outcome == "unsolved"
    assert run.lines[0].level == "warning"


def test_times_of_the_phases_are_kept(case: Any, tmp_path: Path) -> None:
    with RunLogWriter.create(tmp_path / "run.mcap", case.scenario, {}) as log:
        log.finish("solved", {"search": 0.1, "logging": 1e-3})
    words = read_run(tmp_path / "run.mcap").words["pushplan.result"]
    assert (float(words["search_s"]), float(words["logging_s"])) == (0.1, 1e-3)


def test_arrays_that_were_read_cannot_be_changed(case: Any, tmp_path: Path) -> None:
    run = read_run(case.write(tmp_path / "run.mcap"))
    assert run.execution is not None
    for name in (
        "t",
        "poses",
        "twists",
        "margins",
        "friction_margins",
        "lambdas",
        "forces",
        "dynamic_margins",
    ):
        assert not getattr(run.execution, name).flags.writeable


@given(
    hnp.arrays(
        np.float64,
        hnp.array_shapes(min_dims=1, max_dims=3, max_side=9),
        elements=st.floats(allow_nan=True, width=64),
    )
)
def test_byte_planes_keep_every_double(values: np.ndarray[Any, np.dtype[np.float64]]) -> None:
    back = blocks.decode(blocks.encode("a", values))
    assert (back.shape, back.tobytes()) == (values.shape, values.tobytes())


@pytest.mark.parametrize("shape", [(), (3,), (0,), (2, 2, 2, 2), (1 << 31, 1 << 31)])
def test_an_array_that_does_not_fit_its_bytes_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="cannot have 16 bytes"):
        blocks.decode(Array(name="a", shape=shape, planes=bytes(16)))


@given(
    st.builds(
        Effort,
        st.floats(0.0, 1e9),
        st.none() | st.floats(0.0, 1e9),
        st.lists(st.floats(0.0, 1e9)).map(tuple),
        st.integers(0, 10**12 - 1),
    )
)
def test_what_planning_took_comes_back_from_words(effort: Effort) -> None:
    assert Effort.from_words(effort.to_words()) == effort


@given(st.floats(1e-9, 1e9), st.floats(1e-9, 1e9))
def test_all_times_take_the_same_room(first: float, second: float) -> None:
    assert len(exact(first)) == len(exact(second)) == len(exact(0.0))


def test_same_seed_gives_the_same_bytes_but_for_the_documented_words(
    case: Any, tmp_path: Path, differing: Callable[[bytes, bytes], set[str]]
) -> None:
    first = case.write(tmp_path / "a.mcap").read_bytes()
    slower = dataclasses.replace(
        case.plan,
        planning_s=123.4,
        first_solution_s=3.21,
        extensions=7,
        progress=tuple(
            dataclasses.replace(point, seconds=point.seconds + 1.0) for point in case.plan.progress
        ),
    )
    second = dataclasses.replace(case, plan=slower).write(tmp_path / "b.mcap").read_bytes()
    assert differing(first, second) == {
        "pushplan.run/started_at",
        "pushplan.run/crc32",
        "pushplan.planning/planning_s",
        "pushplan.planning/first_solution_s",
        "pushplan.planning/progress_s",
        "pushplan.planning/extensions",
        "pushplan.planning/crc32",
        "pushplan.result/planning_s",
        "pushplan.result/first_solution_s",
        "pushplan.result/progress_s",
        "pushplan.result/extensions",
        "pushplan.result/finished_at",
        "pushplan.result/crc32",
    }
