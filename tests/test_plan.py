"""Planning end to end on packaged scenarios, judged by shapely, the margin and the integrated execution."""

from dataclasses import replace

import numpy as np
import pytest
from plain import load_plain

from pushplan.errors import ScenarioError
from pushplan.geometry import se2
from pushplan.planners.clearance import find_collision
from pushplan.planners.planner import plan
from pushplan.plans.plan import Plan
from pushplan.plans.settings import Observer
from pushplan.scenario.file import example_names, example_text, load_scenario, scenario_from_text
from pushplan.scenario.model import PolygonObstacle, Scenario
from pushplan.util.names import PLANNERS

PATIENT = 60.0
"""A time limit that no test reaches, so that results do not depend on the machine."""


def _check(scenario: Scenario, result: Plan) -> None:
    assert result.solved, result.reason
    execution = result.execution
    assert execution is not None
    assert result.path is not None
    assert execution.loss is None
    assert execution.margins.min() > 0.0
    assert max(execution.goal_error) < 1e-6
    pushed = se2.compose(execution.poses, se2.inverse(scenario.chain.pusher.plate_pose))
    assert find_collision(scenario, pushed) is None
    np.testing.assert_allclose(pushed[-1], result.path.end, atol=1e-9)


@pytest.mark.parametrize("name", example_names())
def test_packaged_scenarios_solve_exactly_with_six_seeds(name: str) -> None:
    scenario = load_scenario(name)
    for seed in range(1, 7):
        result = plan(scenario, seed=seed, time_limit=PATIENT, first=True)
        assert result.solved, f"seed {seed}: {result.reason}"
        execution = result.execution
        assert execution is not None
        assert execution.margins.min() > 0.0, f"seed {seed}"
        assert max(execution.goal_error) < 1e-6, f"seed {seed}"
    _check(scenario, result)


@pytest.mark.parametrize("planner", sorted(PLANNERS))
@pytest.mark.parametrize("name", ["carts", "narrow-gap"])
def test_every_planner_solves_and_shortens(planner: str, name: str) -> None:
    scenario = load_plain(name)
    first = plan(scenario, planner=planner, time_limit=PATIENT, first=True)
    result = plan(scenario, planner=planner, time_limit=PATIENT, iterations=2 * first.iterations + 5_000)
    _check(scenario, result)
    assert first.path is not None
    assert result.path is not None
    assert result.path.cost <= first.path.cost + 1e-9
    assert result.improvements[0].cost == pytest.approx(first.improvements[0].cost)
    assert first.path.cost <= first.improvements[0].cost
    assert result.improvements[-1].cost == pytest.approx(result.path.cost, abs=1e-9)


@pytest.mark.parametrize("planner", sorted(PLANNERS))
def test_the_same_seed_gives_the_same_plan(planner: str) -> None:
    scenario = load_scenario("two-crates")
    one, two = (plan(scenario, planner=planner, seed=7, time_limit=PATIENT, first=True) for _ in range(2))
    assert one.path is not None
    assert two.path is not None
    np.testing.assert_array_equal(one.path.twists, two.path.twists)
    np.testing.assert_array_equal(one.path.lengths, two.path.lengths)
    assert one.iterations == two.iterations


TIGHT = "stability: {margin: 1e-6}"


def test_a_path_that_leaves_no_room_for_inertia_is_a_result_with_a_reason() -> None:
    """The shortest path turns at the boundary of the stable set; ranked by time, paths keep away from it."""
    scenario = scenario_from_text(f"{example_text('free-space')}\n{TIGHT}\n", "tight.yaml")
    assert plan(scenario, time_limit=PATIENT, iterations=20_000).solved
    result = plan(scenario, time_limit=PATIENT, iterations=20_000, cost="travel")
    assert not result.solved
    assert result.reason.startswith("a plan was found that cannot be driven: an arc along the twist")
    assert (result.path, result.trajectory) == (None, None)
    assert result.execution is None


def test_dynamic_contact_limits_without_a_margin_are_refused_on_reading() -> None:
    text = f"{example_text('two-crates')}\nstability: {{margin: 0}}\n"
    with pytest.raises(ScenarioError, match=r"needs a stability\.margin above 0") as caught:
        scenario_from_text(text, "no-room.yaml")
    (finding,) = caught.value.findings
    assert finding.where == "pusher.limits.contact"


def test_improvements_are_told_as_they_happen() -> None:
    heard: list[float] = []
    observer = Observer(improved=lambda better: heard.append(better.cost))
    result = plan(load_scenario("one-box"), observer=observer, time_limit=PATIENT)
    assert heard == [point.cost for point in result.improvements]
    assert len(heard) > 1


def test_a_limit_that_ends_while_the_problem_is_posed_is_an_ordinary_failure() -> None:
    scenario = load_scenario("one-box")
    corner = np.array([[9.0, 9.0], [9.9, 9.0], [9.9, 9.3], [9.3, 9.3], [9.3, 9.9], [9.0, 9.9]])
    result = plan(replace(scenario, obstacles=(PolygonObstacle(corner),)), time_limit=1e-6)
    assert not result.solved
    assert "the time limit ended while the problem was posed" in result.reason
    assert [item.cause for item in result.diagnosis] == ["time"]
    assert (result.path, result.trajectory, result.improvements) == (None, None, ())
