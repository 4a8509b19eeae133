"""Logs of every format that was ever released stay readable; `data/format-N.mcap` is one of each.

`data/before-margins.mcap` is a blended push with dynamic contact limits from before plans kept a margin with inertia.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pushplan.logging.messages.metadata import FORMAT
from pushplan.logging.reader import read_run
from pushplan.logging.verify import verify

DATA = Path(__file__).with_name("data")


def test_there_is_a_log_of_every_format() -> None:
    assert sorted(path.name for path in DATA.glob("format-*.mcap")) == [
        f"format-{n + 1}.mcap" for n in range(FORMAT)
    ]


@pytest.mark.parametrize("number", range(1, FORMAT + 1))
def test_an_old_log_says_what_it_always_said(number: int) -> None:
    run = read_run(DATA / f"format-{number}.mcap")
    assert run.words["pushplan.run"]["format"] == str(number)
    assert run.scenario.name == "two-crates"
    assert [obj.name for obj in run.scenario.chain.objects] == ["near", "far"]
    assert run.plan is not None
    assert run.plan.path is not None
    assert run.plan.trajectory is not None
    assert run.execution is not None
    assert run.plan.path.lengths.tolist() == [0.004, 0.003, 0.002]
    assert run.plan.trajectory.duration == 0.8511448786505826
    assert run.plan.min_margin == 0.1 + 0.2
    assert run.plan.planning_s == 1.9876543210987654
    assert [point.cost for point in run.plan.progress] == [3.3, 1.0 / 3.0]
    assert len(run.execution.t) == 87
    assert run.execution.margins.min() == 0.09680252527684588
    np.testing.assert_allclose(run.execution.poses[-1], [0.10824604, -0.19722482, 0.30023158], atol=1e-8)
    assert run.plan.tolerance is None
    assert run.outcome == "solved"


def test_an_old_trajectory_executes_as_it_did() -> None:
    """The path may be timed better today; the trajectory that was recorded must still do what it did.

    The least margin of that plan was made up.
    """
    timing = {"duration", "commanded twist", "commanded pose", "/plan/result min_margin"}
    mismatches = verify(read_run(DATA / "format-1.mcap")).mismatches
    assert [check.text for check in mismatches if check.quantity not in timing] == []


def test_a_log_from_before_margins_with_inertia_verifies() -> None:
    """It leaves the defaults of its time open, which its resolved scenario states."""
    run = read_run(DATA / "before-margins.mcap")
    assert run.plan is not None
    assert (run.plan.objective, run.plan.margin_asked, run.plan.margin) == ("", None, None)
    assert run.plan.lowered == ""
    assert run.execution is not None
    assert run.execution.dynamic_margins is None
    assert run.plan.min_dynamic_margin is None
    assert run.scenario.planner.cost == "travel"
    assert b"cost" not in run.scenario.source
    assert [check.text for check in verify(run).mismatches] == []
