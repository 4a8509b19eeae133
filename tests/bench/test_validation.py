"""A run of a batch counts as solved only with the margin that its plan kept, and only if it holds with inertia."""

from dataclasses import replace

import numpy as np
import pytest

import pushplan
from pushplan.bench.outcome import validated
from pushplan.bench.random_problems import DRIVES, generate
from pushplan.bench.schema import ProblemParameters
from pushplan.bench.validation import clearance, validation_error
from pushplan.plans.plan import Plan
from pushplan.plans.run import Run
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.model import CircleObstacle
from pushplan.util.stopwatch import Stopwatch


@pytest.fixture(scope="module")
def done() -> Run:
    """Return a run with all defaults."""
    return pushplan.run(pushplan.load_scenario("one-box"), iterations=2000)


def quasi_static(plan: Plan) -> Plan:
    """Return the plan with inertia left out of its scenario."""
    chain = plan.scenario.chain
    still = replace(chain.pusher, limits=replace(chain.pusher.limits, contact="quasi-static"))
    return replace(plan, scenario=replace(plan.scenario, chain=replace(chain, pusher=still)))


def test_an_execution_that_slips_with_inertia_is_no_solution(done: Run) -> None:
    plan, execution = done.plan, done.execution
    assert execution is not None
    assert execution.dynamic_margins is not None
    assert validation_error(plan, execution) == ""
    values = execution.dynamic_margins.copy()
    values[len(values) // 2, 0] = 0.0
    slipping = replace(execution, dynamic_margins=values)
    assert validation_error(plan, slipping) == "the smallest margin with inertia is 0; it must be above 0"
    assert validation_error(quasi_static(plan), slipping) == ""
    unseen = replace(execution, dynamic_margins=None)
    assert validation_error(plan, unseen) == "nobody looked at the margins with inertia"
    assert validation_error(quasi_static(plan), unseen) == ""


def test_the_outcome_of_a_run_has_its_margins(done: Run) -> None:
    found = validated("", done.scenario, done, Stopwatch())
    assert (found.status, found.message) == ("ok", "")
    assert done.execution is not None
    assert done.execution.dynamic_margins is not None
    assert found.values["margin"] == done.plan.margin
    assert found.values["min_margin"] == done.execution.margins.min()
    assert found.values["min_dynamic_margin"] == done.execution.dynamic_margins.min()
    slipping = replace(done.execution, dynamic_margins=np.full_like(done.execution.dynamic_margins, -0.1))
    lost = validated("", done.scenario, replace(done, execution=slipping), Stopwatch())
    assert (lost.status, lost.values["min_dynamic_margin"]) == ("invalid", -0.1)


def test_an_execution_is_validated_by_where_the_objects_are() -> None:
    """An obstacle where the chain would be if the robot held it all the time is none in the way."""
    rooms = ProblemParameters(objects=(1, 1), obstacles=(0, 0), drives=DRIVES, robot=(0.5, 1.0))
    scenario = scenario_from_text(generate(rooms, 1))
    result = pushplan.plan(scenario, first=True, time_limit=60.0)
    assert result.solved
    assert result.execution is not None
    assert validation_error(result, result.execution) == ""
    assert (clearance(scenario, result.execution) or 0.0) > 0.0
    middle = result.execution.objects[len(result.execution.t) // 2, 0, :2]
    hit = replace(result, scenario=replace(scenario, obstacles=(CircleObstacle(middle, 0.02),)))
    assert "obstacles[0]" in validation_error(hit, result.execution)
