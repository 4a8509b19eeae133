"""A recorded plan executed again gives what was recorded, and what was altered is found, with its time."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pushplan.logging.old.messages.recorded import RecordedRun
from pushplan.logging.old.reader import read_run
from pushplan.logging.old.verify import verify
from pushplan.sim.judging import execute

from pushplan.planners.infeasible.bounds import lower_bound
from pushplan.planners.problem.controls import margins_to_try
from pushplan.planners.problem.problem import Posing
from pushplan.sim.robustness import robustness_of

SERIES = ("t", "poses", "twists", "margins", "dynamic_margins", "friction_margins", "lambdas", "forces")


@pytest.fixture(scope="module")
def recorded(case: Any, tmp_path_factory: pytest.TempPathFactory) -> RecordedRun:
    """Return the log of a plan that the simulator has executed."""
    honest = sincere(case)
    return read_run(honest.write(tmp_path_factory.mktemp("verify") / "run.mcap"))


def sincere(case: Any) -> Any:
    """Return the case with the numbers that follow from its scenario and its path, not with awkward ones."""
    path = case.plan.path
    margin = float(case.scenario.stable_set(case.plan.stable_set).margin(path.twists).min())
    asked = margins_to_try(case.scenario, case.scenario.stable_set(case.plan.stable_set))[0]
    controls = Posing().controls(
        case.scenario.with_margin(asked), case.scenario.stable_set(case.plan.stable_set)
    )
    plan = dataclasses.replace(
        case.plan,
        min_margin=margin,
        lower_bound=lower_bound(case.scenario, controls.segments, path.cost),
        objective=case.scenario.planner.cost,
        margin_asked=asked,
        margin=asked,
        robustness=robustness_of(case.scenario.chain, case.plan.trajectory),
    )
    return dataclasses.replace(case, plan=plan, execution=execute(case.scenario, plan))


def altered(run: RecordedRun, name: str, index: tuple[int, ...], by: float) -> RecordedRun:
    """Return the run with one number of its execution changed."""
    values = np.array(getattr(run.execution, name))
    values[index] += by
    execution = dataclasses.replace(run.execution, **{name: values})  # type: ignore[type-var]
    return dataclasses.replace(run, execution=execution)


def test_a_recorded_execution_repeats_to_the_last_bit(recorded: RecordedRun) -> None:
    report = verify(recorded)
    assert report.matches
    assert {check.quantity for check in report.checks} >= {"pose", "twist", "margin", "contact force"}
    assert [check.difference for check in report.checks] == [0.0] * len(report.checks)


@pytest.mark.parametrize(
    ("name", "index", "quantity"),
    [
        ("poses", (40, 1), "pose"),
        ("twists", (40, 2), "twist"),
        ("margins", (40, 1), "margin"),
        ("dynamic_margins", (40, 0), "margin with inertia"),
        ("friction_margins", (40, 0), "friction margin"),
        ("lambdas", (40, 0), "point of application (lambda)"),
        ("forces", (40, 0, 1), "contact force"),
        ("t", (40,), "time"),
    ],
)
@pytest.mark.parametrize("by", [1e-6, float("nan"), float("inf")])
def test_an_altered_number_is_found_where_it_is(
    recorded: RecordedRun, name: str, index: tuple[int, ...], quantity: str, by: float
) -> None:
    report = verify(altered(recorded, name, index, by))
    (check,) = report.mismatches
    assert check.quantity == quantity
    if name != "t":
        assert check.time == pytest.approx(0.4)
    if by == 1e-6:
        assert check.difference == pytest.approx(1e-6)
        assert "differs by 1e-06 at 0.400 s (> " in check.text or name == "t"


def test_rounding_is_no_difference(recorded: RecordedRun) -> None:
    assert verify(altered(recorded, "poses", (40, 1), 1e-12)).matches


def test_a_path_that_does_not_give_the_trajectory_is_found(recorded: RecordedRun) -> None:
    assert recorded.plan is not None
    assert recorded.plan.path is not None
    path = dataclasses.replace(recorded.plan.path, lengths=recorded.plan.path.lengths * [1.0, 1.1, 1.0])
    plan = dataclasses.replace(recorded.plan, path=path)
    found = {check.quantity for check in verify(dataclasses.replace(recorded, plan=plan)).mismatches}
    assert found == {"duration", "commanded twist", "commanded pose"}


def test_samples_that_are_missing_are_found(recorded: RecordedRun) -> None:
    execution = recorded.execution
    assert execution is not None
    shorter = dataclasses.replace(execution, **{name: getattr(execution, name)[:-5] for name in SERIES})
    (check,) = verify(dataclasses.replace(recorded, execution=shorter)).mismatches
    assert (check.quantity, check.difference) == ("number of samples", 5)


def test_a_log_cut_short_is_compared_as_far_as_it_goes(recorded: RecordedRun) -> None:
    execution = recorded.execution
    assert execution is not None
    cut = {name: getattr(execution, name)[:50] for name in SERIES}
    nan = float("nan")
    shorter = dataclasses.replace(execution, **cut, goal_error=(nan, nan))
    report = verify(dataclasses.replace(recorded, execution=shorter))
    assert report.matches
    assert "pose" in {check.quantity for check in report.checks}


def test_a_scenario_in_which_something_is_in_the_way_is_found(recorded: RecordedRun) -> None:
    from pushplan.scenario.model import PolygonObstacle

    block = PolygonObstacle(np.array([[0.2, -0.3], [0.4, -0.3], [0.4, 0.1], [0.2, 0.1]]))
    scenario = dataclasses.replace(recorded.scenario, obstacles=(block,))
    (check,) = verify(dataclasses.replace(recorded, scenario=scenario)).mismatches
    assert check.quantity == "collision"
    assert "meets obstacle" in check.text


def test_a_path_that_an_older_version_timed_by_other_rules_is_not_timed_again(recorded: RecordedRun) -> None:
    """It knew no margin with inertia; all else is compared."""
    assert recorded.plan is not None
    chain = recorded.scenario.chain
    limits = dataclasses.replace(chain.pusher.limits, contact="dynamic")
    pusher = dataclasses.replace(chain.pusher, limits=limits)
    scenario = dataclasses.replace(recorded.scenario, chain=dataclasses.replace(chain, pusher=pusher))
    plan = dataclasses.replace(recorded.plan, margin=0.001)
    newer = dataclasses.replace(recorded, scenario=scenario, plan=plan)
    assert "duration" in {check.quantity for check in verify(newer).mismatches}
    older = dataclasses.replace(newer, plan=dataclasses.replace(recorded.plan, margin=None))
    quantities = {check.quantity for check in verify(older).checks}
    assert {"timing", "collision", "pose", "margin", "lost contact"} <= quantities
    assert not quantities & {"duration", "commanded twist", "commanded pose"}
    assert "timing: not compared" in {check.text.partition(": when")[0] for check in verify(older).checks}


def test_an_unsolved_run_has_nothing_to_verify(case: Any, tmp_path: Path) -> None:
    unsolved = dataclasses.replace(case.unsolved(), execution=case.execution)
    report = verify(read_run(unsolved.write(tmp_path / "run.mcap", "unsolved")))
    assert report.matches
    assert report.checks == ()
