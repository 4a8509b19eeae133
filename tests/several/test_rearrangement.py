"""Several objects to goals of their own: in an order that works, with as little as possible put out of the way."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import count

import numpy as np
import pytest
from several.conftest import Problem

from pushplan.errors import PlanningError
from pushplan.geometry import se2
from pushplan.rearrangement.plan import Rearrangement, Rearranging
from pushplan.scenario.model import PolygonObstacle, Scenario
from pushplan.util.arrays import FloatArray

LIMIT = 60.0
HERE, THERE = (1.0, 1.0), (1.0, 2.0)


def boxes(
    problem: Problem, ways: Mapping[str, tuple[tuple[float, float], tuple[float, float]]]
) -> dict[str, Scenario]:
    """Return a problem for each box: from one place to another, in any of four orientations."""
    return {
        name: problem(
            start=[x - 0.075, y, 0.0], goal={"pose": [*goal, 0.0], "of": "b0", "symmetry": 4}, name=name
        )
        for name, ((x, y), goal) in ways.items()
    }


def require_a_plan_for(asked: Rearranging, found: Rearrangement) -> None:
    """Check that legs follow one another, that what is not pushed stands still, and that all end at their goals."""
    assert found.solved, found.reason
    places = dict(zip((piece.name for piece in asked.pieces), asked.now.poses, strict=True))
    plate: FloatArray = asked.now.plate
    for leg in found.legs:
        assert leg.plan.solved
        assert leg.plan.execution is not None
        np.testing.assert_allclose(leg.scenario.start, places[leg.name], atol=1e-12)
        chain = leg.scenario.chain
        begin = se2.compose(leg.scenario.robot_start, chain.pusher.plate_pose)
        assert max(se2.pose_error(begin, plate)) < 1e-9
        standing = [o.outline for o in leg.scenario.obstacles if isinstance(o, PolygonObstacle)]
        for piece in asked.pieces:
            if piece.name != leg.name:
                outline = piece.outlines(places[piece.name])[0]
                assert any(np.allclose(outline, other) for other in standing)
        places[leg.name] = leg.plan.segments[-1].load_after
        plate = se2.compose(leg.plan.segments[-1].robot_path.end, chain.pusher.plate_pose)
    for piece in asked.pieces:
        if piece.wanted:
            errors = [max(se2.pose_error(places[piece.name], goal.pose_chain)) for goal in piece.goals]
            assert min(errors) < 1e-9


def test_boxes_go_in_an_order_in_which_goals_are_free_when_they_are_needed(problem: Problem) -> None:
    """One box stands on the other's goal, and has a free goal of its own: nothing is put out of the way."""
    asked = Rearranging.of(boxes(problem, {"a": (HERE, THERE), "b": (THERE, (2.0, 2.0))}))
    found = asked.plan(first=True, time_limit=LIMIT)
    require_a_plan_for(asked, found)
    assert [leg.name for leg in found.legs] == ["b", "a"]
    assert found.relocations == 0


def test_boxes_change_places_with_one_put_out_of_the_way(problem: Problem) -> None:
    asked = Rearranging.of(boxes(problem, {"a": (HERE, THERE), "b": (THERE, HERE)}))
    found = asked.plan(first=True, time_limit=LIMIT)
    require_a_plan_for(asked, found)
    assert found.relocations == 1
    assert len(found.legs) == 3


def test_what_has_no_goal_is_moved_only_where_it_is_in_the_way(problem: Problem) -> None:
    ways = {"a": (HERE, THERE), "on it": (THERE, THERE), "aside": ((3.0, 3.0), HERE)}
    asked = Rearranging.of(boxes(problem, ways), movable=["on it", "aside"])
    found = asked.plan(first=True, time_limit=LIMIT)
    require_a_plan_for(asked, found)
    assert [(leg.name, leg.delivers) for leg in found.legs] == [("on it", False), ("a", True)]


def test_more_search_makes_the_same_errands_cheaper(
    problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = Rearranging.of(boxes(problem, {"a": (HERE, THERE), "b": ((2.0, 1.0), (2.0, 0.0))}))
    first, looked = asked.plan(first=True, time_limit=LIMIT), count()
    monkeypatch.setattr("time.perf_counter", lambda: 0.01 * next(looked))  # a clock that nothing else slows
    better = asked.plan(time_limit=1.0)
    require_a_plan_for(asked, better)
    assert better.cost < first.cost


def test_objects_at_their_goals_stay_there(problem: Problem) -> None:
    asked = Rearranging.of(boxes(problem, {"a": (HERE, HERE)}))
    found = asked.plan(first=True, time_limit=LIMIT)
    assert found.solved
    assert not found.legs


def test_objects_in_a_single_push_problem_are_refused(problem: Problem) -> None:
    with pytest.raises(PlanningError, match=r"robot\.start"):
        Rearranging.of({"a": problem(robot={"start": None}, pushes=None)})
