"""Multi-push plans: complete, timed, executed, checked; or refused with the reason."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from conftest import there
from several.conftest import DRIVES, Problem

from pushplan.errors import PlanningError
from pushplan.geometry import se2
from pushplan.mechanics.faces import pushed_at
from pushplan.mechanics.perturb import with_contact_friction
from pushplan.planner import Planner, plan
from pushplan.planners.validator import Validator
from pushplan.plans.load import Load
from pushplan.plans.plan import Plan
from pushplan.plans.segment import Segment
from pushplan.plans.settings import Observer
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import CircleObstacle
from pushplan.sets.named import stable_set
from pushplan.sim.control.rest import CAREFUL, RestPlanner
from pushplan.util.names import FACES

ROUND = {"goal": {"pose": [0.5, 1.0, 0.0], "of": "b0"}}
"""Goal behind the box, towards the robot, which must drive around the box."""


@pytest.fixture(scope="module", params=DRIVES)
def planned(problem: Problem, request: pytest.FixtureRequest) -> tuple[Scenario, Plan]:
    scenario = problem(request.param, **ROUND)
    return scenario, plan(scenario, iterations=3, time_limit=60.0)


def test_a_goal_behind_the_box_is_reached_from_its_other_side(planned: tuple[Scenario, Plan]) -> None:
    _, plan = planned
    assert plan.solved, plan.reason
    assert max(there(plan.execution).goal_error) < 1e-9
    assert there(plan.min_margin) > there(plan.margin)
    kinds = [segment.kind for segment in plan.segments]
    assert kinds == ["transit", "approach", "push", "retreat"] * (len(kinds) // 4)
    assert plan.cost == pytest.approx(plan.improvements[-1].cost, abs=1e-9)
    assert there(plan.lower_bound) <= there(plan.cost)
    assert there(plan.segments[-1].load).face == "front"


def moved(segment: Segment, by: float) -> Segment:
    x, y, theta = segment.path.start
    path = replace(segment.path, start=np.array([x, y + by, theta]))
    return replace(segment, path=path)


def from_face(segment: Segment, face: str) -> Segment:
    problem = there(segment.load).problem
    return replace(segment, load=Load.of(problem.with_load(chain=pushed_at(problem.chain, face)), face, 0.0))


BROKEN: dict[str, tuple[int, Any, str]] = {
    "a transit that begins elsewhere": (0, lambda s: moved(s, 1e-3), "does not begin where"),
    "an approach that moves the load": (
        1, lambda s: replace(s, after={"b0": s.after["b0"] + np.array([1e-3, 0.0, 0.0])}), "moves an object that it"
    ),
    "a push of another face": (2, lambda s: from_face(s, "front"), "does not begin with its contacts closed"),
    "an approach to another face": (1, lambda s: from_face(s, "rear"), "does not follow an approach"),
    "a retreat from another face": (3, lambda s: from_face(s, "rear"), "not followed by a retreat"),
}  # fmt: skip


@pytest.mark.parametrize("what", BROKEN)
def test_a_plan_that_was_tampered_with_is_refused(planned: tuple[Scenario, Plan], what: str) -> None:
    scenario, plan = planned
    k, change, words = BROKEN[what]
    segments = tuple(change(s) if i == k else s for i, s in enumerate(plan.segments))
    validator = Validator(scenario)
    assert validator.flaw(plan.segments, plan.execution) == ""
    assert words in validator.flaw(segments, plan.execution)


def test_a_transit_that_the_wheels_cannot_drive_is_refused_also_for_its_last_arc(
    planned: tuple[Scenario, Plan],
) -> None:
    scenario, plan = planned
    transit = plan.segments[0]
    aside = np.array([[0.0, 1.0, 0.0]])

    def flaw(twists: Any, lengths: Any) -> str:
        path = replace(transit.path, twists=twists, lengths=np.array(lengths))
        return Validator(scenario).flaw_of(replace(transit, path=path, trajectory=None))

    ahead = transit.path
    assert flaw(ahead.twists, ahead.lengths) == ""
    refused = flaw(np.concatenate([ahead.twists, aside]), [*ahead.lengths, 1e-3])
    assert ("0 m/s ahead, 1 m/s sideways" in refused) == (scenario.pusher.drive.kind != "omnidirectional")


def test_a_row_of_boxes_is_taken_from_its_other_end(problem: Problem) -> None:
    scenario = problem("omnidirectional", boxes=3, goal={"pose": [0.7, 1.0, 0.0]})
    found = plan(scenario, first=True, time_limit=60.0)
    assert found.solved, found.reason
    assert [push.load.face for push in found.pushes if push.load] == ["b2 front"]
    assert there(found.execution).margins.shape[1] == 3


def test_a_square_box_may_end_in_any_of_its_orientations(problem: Problem) -> None:
    goal = {"pose": [2.0, 1.0, 1.5707963267948966], "of": "b0", "symmetry": 4}
    found = plan(problem("car", goal=goal), first=True, time_limit=60.0)
    assert found.solved, found.reason
    assert found.pushed_distance == pytest.approx(
        0.925
    )  # to where its frame, 75 mm ahead of the chain's, is at x = 2 m
    assert se2.wrap_angle(found.segments[-1].after["b0"][2]) == pytest.approx(0.0, abs=1e-9)


def test_a_robot_that_touches_the_box_backs_off_first(problem: Problem) -> None:
    scenario = problem("car", robot={"start": [1.0, 1.0, 0.0]}, **ROUND)
    found = plan(scenario, first=True, time_limit=60.0)
    assert found.solved, found.reason
    assert [segment.kind for segment in found.segments[:2]] == ["retreat", "transit"]


def test_a_box_that_no_push_frees_from_a_corner_is_reported(problem: Problem) -> None:
    corner = {"start": [0.01, 0.085, 0.0], "workspace": {"x": [0.0, 3.0], "y": [0.0, 3.0]}}
    changes = {"robot": {"start": [1.5, 1.5, 0.0]}, "goal": {"pose": [1.0, 1.0, 0.0]}}
    found = plan(problem("car", **corner, **changes), time_limit=60.0)
    assert not found.solved
    assert found.planning_s < 30.0
    assert found.diagnosis[0].cause == "boxed in"
    assert found.diagnosis[0].proven
    assert "the robot has no room before any allowed face" in found.reason


def test_a_goal_without_room_for_a_retreat_is_reported(problem: Problem) -> None:
    walls = [{"box": [0.5, 0.02], "pose": [2.0, 1.0 + y, 0.0]} for y in (-0.1, 0.1)]
    walls += [{"box": [0.02, height], "pose": [2.0 + x, 1.0, 0.0]} for x, height in ((-0.14, 0.2), (0.45, 0.6))]
    scenario = problem("car", obstacles=walls, goal={"pose": [2.0, 1.0, 0.0], "of": "b0"})
    found = plan(scenario, time_limit=60.0)
    assert not found.solved
    assert found.diagnosis[0].proven
    assert "at the goal, the robot has no room" in found.reason
    assert found.blocking == {0, 1, 2, 3}


def test_offsets_are_suggested_where_they_give_the_robot_room(problem: Problem) -> None:
    # A box in a niche: the robot, 0.28 m wide, fits behind it only more than 2 cm farther to the left.
    niche = [{"box": [0.14, 0.02], "pose": [2.0, 1.0 + y, 0.0]} for y in (-0.1, 0.1)]
    niche += [{"box": [0.02, 0.2], "pose": [2.14, 1.0, 0.0]}, {"box": [0.3, 0.02], "pose": [1.6, 0.87, 0.0]}]
    goal = {"pose": [2.0, 1.0, 0.0], "of": "b0"}
    found = plan(problem("omnidirectional", obstacles=niche, goal=goal), time_limit=10.0, iterations=20)
    assert not found.solved
    assert "with pusher.offsets [-0.04, 0, 0.04] there is room" in found.reason
    offset = plan(
        problem("omnidirectional", obstacles=niche, goal=goal, pusher={"offsets": [-0.04, 0.0, 0.04]}),
        first=True,
        time_limit=60.0,
        iterations=500,
    )
    assert offset.solved, offset.reason


@pytest.mark.parametrize("option", [{"planner": "rrt"}, {"cost": "time"}])
def test_options_of_single_pushes_are_refused(problem: Problem, option: Any) -> None:
    with pytest.raises(PlanningError, match=r"multi-push plans \(robot.start\)"):
        plan(problem("car"), **option)


def test_only_contacts_that_a_plan_uses_count_for_its_margin(problem: Problem) -> None:
    result = plan(
        problem("omnidirectional", **ROUND, pusher={"offsets": [0.0, 0.15]}),
        first=True,
        iterations=3,
        time_limit=600.0,
    )
    assert {push.load.offset for push in result.pushes if push.load is not None} == {0.0}
    assert result.notes == []
    assert there(result.margin) == there(result.margin_asked) == min(push.margin for push in result.pushes)


def test_a_planner_gives_the_same_plan_as_plan_and_replans_with_other_obstacles(problem: Problem) -> None:
    scenario = problem("car", **ROUND)
    planner = Planner(scenario)
    goals = [goal.pose_chain for goal in scenario.goals[scenario.load.name]]
    once = plan(scenario, first=True, time_limit=60.0)
    answers = [planner.plan(scenario.start, goals, robot=scenario.plate_start) for _ in range(2)]
    assert [answer.cost for answer in answers] == [once.cost] * 2
    transit = once.segments[0].path
    x, y, _ = transit.poses_at(np.array([0.5 * transit.cost]))[0]
    blocked = planner.with_obstacles([CircleObstacle(np.array([x, y]), 0.05)])
    around = blocked.plan(scenario.start, goals, time_limit=60.0)
    assert around.solved, around.reason
    assert around.cost != once.cost


def test_a_plan_for_the_rest_has_a_margin_for_corrections_unless_travel_is_too_long(problem: Problem) -> None:
    scenario = problem("differential", contacts={"friction": 0.5})
    first = plan(scenario, seed=1, iterations=1, time_limit=60.0)
    rest = RestPlanner(scenario, first, (5e-3, np.radians(1.0)), 0.2, Observer())
    given = 1.0, scenario.plate_start, scenario.poses, (), frozenset[str](), 1
    careful, usual = (there(rest.plan(*given, most, {}).result) for most in (np.inf, 0.0))
    for found, margin in ((careful, CAREFUL), (usual, 0.05)):
        assert found.solved, found.reason
        assert min(push.margin for push in found.pushes) == pytest.approx(margin)
    walled = (*given[:3], (CircleObstacle(scenario.plate_start[:2], 0.1),), *given[4:])
    attempts = rest.plan(*given, np.inf, {}), rest.plan(*walled, np.inf, {})
    assert [(attempt.rest, attempt.solved) for attempt in attempts] == [(True, True), (True, False)]
    wary = there(rest.plan(*given, np.inf, {"b0": 2}).result)
    for push in (*careful.pushes, *wary.pushes):  # the loop believes the nominal scenario
        assert there(push.load).chain.contacts[0].friction == pytest.approx(0.5)
    less = [with_contact_friction(there(push.load).chain, 0.8) for push in wary.pushes]
    margins = [
        stable_set(chain).margin(push.contact_path.twists).min()
        for chain, push in zip(less, wary.pushes, strict=True)
    ]
    assert min(margins) > 0.0
    avoided = there(rest.plan(*given, np.inf, {}, careful.pushes[0].pushed_load.faces).result)
    assert careful.pushes[0].pushed_load.face not in {push.pushed_load.face for push in avoided.pushes}
    shut = rest.plan(*given, np.inf, {}, FACES)
    assert shut.solved, shut.reason  # there is no other plan
    stated = scenario.with_margin(0.1)
    rest = RestPlanner(stated, first, (5e-3, np.radians(1.0)), 0.2, Observer())
    assert min(push.margin for push in there(rest.plan(*given, 0.0, {}).result).pushes) == pytest.approx(0.1)
