"""A run of a batch counts as solved only with the margin that its plan kept, and only if it holds with inertia."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import pushplan
from pushplan.bench.processes.validation import flaw, plan_flaw, with_kept_margin
from pushplan.bench.processes.work import figures
from pushplan.errors import PushplanError
from pushplan.plans.result import Run
from pushplan.scenario.model import Scenario
from pushplan.util.stopwatch import Stopwatch


@pytest.fixture(scope="module")
def done() -> Run:
    """Return a run with all defaults."""
    return pushplan.run(pushplan.load_scenario("one-box"), iterations=2000)


def quasi_static(scenario: Scenario) -> Scenario:
    """Return the scenario with inertia left out."""
    pusher = scenario.chain.pusher
    still = replace(pusher, limits=replace(pusher.limits, contact="quasi-static"))
    return replace(scenario, chain=replace(scenario.chain, pusher=still))


def test_auto_stands_for_the_margin_that_the_plan_kept(done: Run) -> None:
    assert done.plan.margin is not None
    assert with_kept_margin(done.scenario, done.plan).required_margin == done.plan.margin
    assert plan_flaw(done.scenario, done.plan) == ""
    with pytest.raises(PushplanError, match="'auto'"):
        plan_flaw(done.scenario, replace(done.plan, margin=None))


def test_a_plan_may_not_lower_a_margin_that_is_stated(done: Run) -> None:
    assert done.plan.min_margin is not None
    stated = done.scenario.with_margin(done.plan.min_margin)
    lowered = replace(done.plan, margin=0.0)
    assert with_kept_margin(stated, lowered).required_margin == done.plan.min_margin
    assert plan_flaw(stated, lowered) == (
        f"the smallest margin is {done.plan.min_margin:.3g}; it must be above {done.plan.min_margin:g}"
    )


def test_an_execution_that_slips_with_inertia_is_no_solution(done: Run) -> None:
    scenario, execution = with_kept_margin(done.scenario, done.plan), done.execution
    assert execution is not None
    assert execution.dynamic_margins is not None
    assert flaw(scenario, execution) == ""
    values = execution.dynamic_margins.copy()
    values[len(values) // 2, 0] = 0.0
    slipping = replace(execution, dynamic_margins=values)
    assert flaw(scenario, slipping) == "the smallest margin with inertia is 0; it must be above 0"
    assert flaw(quasi_static(scenario), slipping) == ""
    unseen = replace(execution, dynamic_margins=None)
    assert flaw(scenario, unseen) == "nobody looked at the margins with inertia"
    assert flaw(quasi_static(scenario), unseen) == ""


def test_figures_of_a_run_have_its_margins(done: Run) -> None:
    found = figures(done.scenario, done, Stopwatch())
    assert (found.reason, found.valid, found.status) == ("", True, "ok")
    assert done.execution is not None
    assert done.execution.dynamic_margins is not None
    assert found.margin == done.plan.margin
    assert found.min_margin == done.execution.margins.min()
    assert found.min_dynamic_margin == done.execution.dynamic_margins.min()
    slipping = replace(done.execution, dynamic_margins=np.full_like(done.execution.dynamic_margins, -0.1))
    lost = figures(done.scenario, replace(done, execution=slipping), Stopwatch())
    assert (lost.valid, lost.status, lost.min_dynamic_margin) == (False, "invalid", -0.1)
