"""The search of multi-push plans: exact graphs, sound bounds, monotonic descents, usable faces."""

import itertools
import time
import tracemalloc
from itertools import pairwise, permutations, product

import numpy as np
import pytest
from conftest import there
from several.conftest import Problem, problem_document

from pushplan.core.pushes import ARCS, PackedMode, find_passings, find_push, word_costs
from pushplan.core.samples import descend, pushed_at_random
from pushplan.core.sequences import cheapest_sequence, cheapest_tours
from pushplan.geometry import se2
from pushplan.mechanics.faces import places
from pushplan.planner import plan
from pushplan.planners.multi.contact_modes import ContactMode, find_modes
from pushplan.planners.multi.graph import Graph
from pushplan.planners.multi.multi_push import MultiPushSearch
from pushplan.planners.multi.room import Query, lower_bounds
from pushplan.planners.multi.search import Limits, search
from pushplan.planners.multi.transfers import plates_after
from pushplan.plans.settings import Observer, PlanSettings
from pushplan.scenario.file import scenario_from_document
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray


def modes_of(scenario: Scenario) -> tuple[ContactMode, ...]:
    return find_modes(scenario, PlanSettings().completed(scenario))


def prepared_of(scenario: Scenario) -> MultiPushSearch:
    return MultiPushSearch.of(scenario, PlanSettings().completed(scenario))


def by_enumeration(pushes: FloatArray, changes: FloatArray, first: FloatArray, goals: int, most: int) -> float:
    """Return the smallest cost of all sequences, by enumeration."""
    modes, nodes, _ = pushes.shape
    best = np.inf
    for count in range(1, most + 1):
        for by in product(range(modes), repeat=count):
            for between in product(range(goals + 1, nodes), repeat=count - 1):
                for goal in range(1, goals + 1):
                    at = (0, *between, goal)
                    cost = first[by[0]] + sum(pushes[m, at[k], at[k + 1]] for k, m in enumerate(by))
                    cost += sum(changes[at[k + 1], by[k], by[k + 1]] for k in range(count - 1))
                    best = min(best, cost)
    return float(best)


@pytest.mark.parametrize("seed", range(4))
def test_the_cheapest_sequence_matches_enumeration(seed: int) -> None:
    random = np.random.default_rng(seed)
    pushes, changes, first = random.random((2, 5, 5)), 0.1 * random.random((5, 2, 2)), random.random(2)
    pushes[random.random(pushes.shape) < 0.5] = np.inf
    pushes[:, :, 0] = pushes[:, 1:3] = np.inf
    changes[:, [0, 1], [0, 1]] = np.inf
    cost, steps = cheapest_sequence(pushes, changes, first, 2, 3)
    assert cost == pytest.approx(by_enumeration(pushes, changes, first, 2, 3))
    if np.isfinite(cost):
        along = first[steps[0, 0]] + sum(pushes[m, u, v] for m, u, v in steps)
        along += sum(changes[a[2], a[0], b[0]] for a, b in pairwise(steps))
        assert along == pytest.approx(cost)
        assert (steps[1:, 1] == steps[:-1, 2]).all()


def test_the_cheapest_tours_match_all_orders() -> None:
    random = np.random.default_rng(5)
    entries, exits = (2, 1, 3), (1, 3, 2)
    pushes = [random.random((3, 2, m, e)) for m, e in zip(entries, exits, strict=True)]
    ways = [random.random((sum(exits), m)) for m in entries]
    tours = cheapest_tours(ways, pushes)
    own = np.split(np.arange(sum(exits)), np.cumsum(exits)[:-1])
    for bits in product((0, 1), repeat=3):
        loads = [k for k in range(3) if bits[k]]
        best = np.full(sum(exits), np.inf)
        for order in permutations(loads):
            rest = np.zeros(sum(exits))
            for at in reversed(range(len(order))):
                left, load = order[at:], order[at]
                push = np.max([pushes[load][k, int(k in left)] for k in range(3)], axis=0) + rest[own[load]]
                rest = (ways[load] + push.min(axis=1)).min(axis=1)
            best = np.minimum(best, rest)
        np.testing.assert_allclose(tours[sum(1 << k for k in loads)], best if loads else 0.0)
    with pytest.raises(ValueError, match="table of transits"):
        cheapest_tours(ways[::-1], pushes)


def side_by_side(problem: Problem, second_is: float = 0.15) -> Scenario:
    """Return two boxes 5 cm apart, side by side before a plate of 40 cm; the chain frame is at the first one."""
    objects = [
        {"name": "a", "shape": {"box": [0.15, 0.15]}, "mass": 1.0, "offset": 0.1},
        {"name": "b", "shape": {"box": [second_is, 0.15]}, "mass": 1.0, "pose": [0.5 * second_is, -0.2, 0.0]},
    ]
    robot, goal = ({"footprint": {"box": [0.4, 0.4], "pose": [-0.215, 0, 0]}}, {"pose": [2.0, 1.2, 0.3], "of": "a"})
    return problem("differential", objects=objects, pusher={"width": 0.4}, robot=robot, goal=goal)


def test_stacks_side_by_side_are_pushed_only_where_the_plate_touches_all(problem: Problem) -> None:
    modes = modes_of(side_by_side(problem))
    assert [(mode.place.face, mode.place.touched) for mode in modes] == [
        ("a and b front", (0, 1)),
        ("a and b rear", (0, 1)),
    ]
    assert [mode.load.names for mode in modes] == [("a", "b"), ("a", "b")]
    assert {mode.place.face for mode in modes_of(side_by_side(problem, 0.2))} == {"a and b rear"}


def test_a_push_goes_around_an_obstacle_that_blocks_every_single_steering_path(problem: Problem) -> None:
    """The box can only be pushed from behind, and a pillar blocks its path."""
    pillar = [{"circle": 0.3, "center": [2.0, 1.0]}]
    goal = {"pose": [3.0, 1.0, 0.0], "of": "b0"}
    asked = problem("omnidirectional", pusher={"faces": ["rear"]}, obstacles=pillar, goal=goal)
    found = plan(asked, first=True, time_limit=60.0)
    assert found.solved, found.reason
    (push,) = (segment for segment in found.segments if segment.pushes)
    assert len(push.path.lengths) > ARCS
    assert [segment.kind for segment in found.segments] == ["transit", "approach", "push", "retreat"]


def test_the_plate_takes_no_pose_with_an_overlap(problem: Problem) -> None:
    """In the notch of an L, the plate of 20 cm has no room; on its outer faces it has."""
    notched = [[0.0, 0.0], [0.3, 0.0], [0.3, 0.1], [0.1, 0.1], [0.1, 0.3], [0.0, 0.3]]
    document = problem_document(goal={"pose": [1.0, 2.0, 0.0], "of": "b0"})
    document["objects"][0]["shape"] = {"polygon": notched}
    scenario = scenario_from_document(document)
    found = list(places(scenario.chain, scenario.transport.faces, scenario.transport.offsets))
    assert sorted(place.face for place in found) == ["front", "left", "rear", "right"]
    outline = scenario.chain.objects[0].outline_chain
    for place in found:
        ahead = se2.rotate(place.contact[2], [1.0, 0.0])
        assert ((outline - place.contact[:2]) @ ahead).min() > -1e-9


def question_of(prepared: MultiPushSearch) -> Query:
    scenario = prepared.scenario
    goals = np.array([goal.pose_chain for goal in scenario.goals[scenario.load.name]])
    return Query(scenario.robot_start, scenario.start, goals)


def test_a_descent_never_climbs_and_ends_below_where_it_began(problem: Problem) -> None:
    room = prepared_of(problem("omnidirectional")).room(0)
    modes = [contact.packed for contact in room.contacts]
    ends = np.array([[0.0, 0.0, 0.0], [0.3, 0.2, 0.4]])
    sequence, state = np.array([0, 1, 2]), np.array([3], dtype=np.uint64)
    poses = np.array([[0.5, -0.5, 1.0], [-0.4, 0.6, -1.0]])
    before = [descend(modes, sequence, ends, poses, 0.3, n, state) for n in (0, 50, 50, 200)]
    assert all(later <= earlier for earlier, later in pairwise(before))
    assert before[-1] < 0.7 * before[0]


def test_a_push_without_obstacles_costs_as_much_as_its_steering_path(problem: Problem) -> None:
    contact = prepared_of(problem("omnidirectional", workspace=None)).room(0).contacts[0]
    random = np.random.default_rng(4)
    for start, goal in random.uniform(-2.0, 0.0, (20, 2, 3)) - [2.0, 2.0, 0.0]:
        words = word_costs(contact.packed, start[None], goal[None], np.zeros(1), np.zeros(1), np.inf)
        cost, arcs = find_push(contact.scene, contact.packed, start, goal)
        assert cost == words[0, 0] == pytest.approx(arcs[:, 3].sum())
        end = se2.compose(start, contact.packed.contact)
        for arc in arcs:
            end = se2.compose(end, se2.exp(arc[:3] * arc[3]))
        assert max(se2.pose_error(end, se2.compose(goal, contact.packed.contact))) < 1e-9


@pytest.mark.parametrize("drive", ["car", "differential", "omnidirectional"])
def test_more_search_never_makes_a_plan_worse_and_none_beats_the_bound(problem: Problem, drive: str) -> None:
    prepared = prepared_of(problem(drive, goal={"pose": [0.9, 1.1, 0.5]}))
    room, question = prepared.room(0), question_of(prepared)
    costs: list[float] = []
    limits = Limits(time.perf_counter() + 60.0, iterations=6)
    found = search(room, question, limits, 1, lambda best, _: costs.append(best.cost))
    assert found.best is not None
    assert costs == sorted(costs, reverse=True)
    assert found.lower_bound <= found.best.cost
    for step in found.best.steps:
        to, on = lower_bounds(room, question, step.after[None])
        assert float(to[0] + on[0]) <= found.best.cost + 1e-9


def test_a_graph_keeps_the_poses_that_a_cheaper_plan_can_pass(problem: Problem) -> None:
    """Those whose bounds to the start and to the goals come to less in sum; the goal is three times as far away."""
    prepared = prepared_of(problem("car", goal={"pose": [2.5, 2.2, 0.5], "of": "b0"}))
    room, question = prepared.room(0), question_of(prepared)
    graph = Graph(room, question, 1, lambda: False)
    known, poses = len(graph.poses), np.random.default_rng(2).uniform(-1.0, [3.0, 3.0, 2.0], (200, 3))
    bounds = np.array(graph.lower_bounds(poses)).sum(axis=0)
    below = float(np.median(bounds))
    graph.add(poses, below, lambda: False)
    np.testing.assert_array_equal(graph.poses[known:], poses[bounds < below])


def test_costs_to_go_start_at_the_plate_after_the_retreat(problem: Problem) -> None:
    """For each contact and goal, as in a plan; the plate stands beside the middle of a face."""
    pusher = {"faces": "all", "offsets": ["-20 mm", "30 mm"]}
    pushes = {"approach": 0.04, "retreat": 0.08}
    goals = [{"pose": pose, "of": "b0"} for pose in ([1.0, 0.8, 0.5], [-0.9, 1.2, -2.0])]
    for goal in goals:
        scenario = problem(
            "car", pusher=pusher, pushes=pushes, goal=[goal, *(one for one in goals if one is not goal)]
        )
        room, found = prepared_of(scenario).room(0), plan(scenario, first=True, time_limit=60.0)
        push, retreat = found.segments[-2:]
        assert retreat.kind == "retreat"
        ends = np.array([scenario.load.start_for(retreat.after["b0"]), np.zeros(3)])
        plates = plates_after(room, ends).reshape(len(room.contacts), len(ends), 3)
        mine = [k for k, contact in enumerate(room.contacts) if contact.mode.load.links == there(push.load).links]
        assert len(mine) == 1
        assert max(se2.pose_error(plates[mine[0], 0], retreat.path.end)) < 1e-6


def test_two_pushes_move_a_box_aside_where_one_takes_six_metres(problem: Problem) -> None:
    aside = {"goal": {"pose": [1.0, 1.05, 0.0]}, "pusher": {"faces": ["front", "rear"]}}
    prepared = prepared_of(problem("differential", **aside))
    room, question = prepared.room(0), question_of(prepared)
    until = time.perf_counter() + 60.0
    first = there(search(room, question, Limits(until, first=True), 1).best)
    better = there(search(room, question, Limits(until, iterations=10), 1).best)
    assert len(first.steps) == 1
    assert sum(step.cost for step in first.steps) > 3.0
    assert sum(step.cost for step in better.steps) < 0.6


def test_pushes_pass_goals_at_the_nearest_of_many_poses(problem: Problem) -> None:
    room = prepared_of(problem("car", 2)).room(0)
    inner, load, far = room.scenario.chain.objects[0].pose_chain, np.array([0.3, -0.2, 0.7]), 4.0
    random, within, passed = np.random.default_rng(1), np.array([0.05, 0.2]), 0
    for mode in (contact.packed for contact in room.contacts):
        begin = se2.compose(se2.compose(load, mode.contact), se2.exp(mode.settling * mode.settle))
        twists = [twist for twist in mode.families.reshape(-1, 3) if twist.any()]
        arcs = [se2.compose(begin, se2.exp(np.linspace(0.0, far, 400)[:, None] * twist)) for twist in twists]
        loads = [se2.compose(arc, se2.inverse(mode.contact)) for arc in arcs]
        goals = se2.compose(np.array([own[random.integers(400)] for own in loads]), inner)
        goals += random.uniform(-1.5, 1.5, goals.shape) * [0.03, 0.03, 0.1]
        expected = []
        for own in loads:
            apart = se2.compose(own, inner)[:, None] - goals
            away, turned = np.hypot(apart[..., 0], apart[..., 1]), np.abs(se2.wrap_angle(apart[..., 2]))
            share = np.maximum(away / within[0], turned / within[1])
            k, goal = np.unravel_index(share.argmin(), share.shape)
            if share[k, goal] <= 1.0:
                expected.append((*own[k], goal))
        poses, rows = find_passings(mode, load, inner, goals, within, far)
        np.testing.assert_allclose(np.column_stack([poses, rows]), np.array(expected).reshape(-1, 4), atol=1e-9)
        passed += len(rows)
    assert passed > 0


@pytest.mark.parametrize("seed", range(1, 5))
@pytest.mark.parametrize("heading", [0.0, 0.7])
def test_a_box_goes_through_a_door_beside_its_way_with_any_seed(problem: Problem, heading: float, seed: int) -> None:
    """Straight pushes along the wall, through the door and back; sampling alone finds this in seconds, if at all."""
    walls = [[[1.96, -0.2], [2.04, -0.2], [2.04, 2.0], [1.96, 2.0]], [[1.96, 2.8], [2.04, 2.8], [2.04, 4], [1.96, 4]]]
    room = {"workspace": {"x": [-0.2, 4.2], "y": [-0.2, 4.0]}, "obstacles": [{"polygon": wall} for wall in walls]}
    goal, robot = {"pose": [3.0, 0.9, 0.0], "of": "b0"}, {"start": [0.5, 0.5, 0.0]}
    scenario = problem(
        "omnidirectional", start=[1.0, 0.8, heading], goal=goal, robot=robot, pushes={"most": 4}, **room
    )
    found = plan(scenario, seed=seed, first=True, iterations=6, time_limit=60.0)
    assert found.solved, found.reason


def test_many_goals_and_offsets_need_little_memory_and_respect_the_time_limit(problem: Problem) -> None:
    around = [[1.0 + np.cos(a), 1.0 + np.sin(a), float(a)] for a in np.linspace(0.0, 6.0, 24)]
    pusher = {"faces": "all", "offsets": ["-20 mm", 0, "20 mm"]}
    scenario = problem("omnidirectional", goal=[{"pose": pose, "of": "b0"} for pose in around], pusher=pusher)
    tracemalloc.start()
    try:
        found = plan(scenario, iterations=4, time_limit=600.0)
        assert (found.solved, found.iterations) == (True, 4)
        assert tracemalloc.get_traced_memory()[1] < 1e8
    finally:
        tracemalloc.stop()
    looks = itertools.count()
    plan(scenario, time_limit=600.0, observer=Observer(cancelled=lambda: next(looks) >= 20))
    assert next(looks) < 60


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_random_push_follows_one_of_the_contact_s_twists(sense: float) -> None:
    """For every position and heading of the contact on the load."""
    families = np.array([[[0.5, 0.1, 2.0], [1.0, 0.0, 0.0], [0.5, -0.2, -1.0]]])
    contact, load, state = np.array([0.1, 0.07, 0.5]), np.array([1.0, -2.0, 2.5]), np.array([3], dtype=np.uint64)
    mode = PackedMode(families, contact, np.zeros(3), families[0, 1], 0.02, 0.05, 0.05, 0.0, 2.0)
    for _ in range(20):
        pushed = pushed_at_random(mode, load, sense, state)
        before, after = se2.compose(load, contact), se2.compose(pushed, contact)
        away = se2.relative(before, after) if sense > 0.0 else se2.relative(after, before)
        lengths = [abs(away[2] / w) if w else float(np.hypot(*away[:2])) for w in families[0, :, 2]]
        ways = [se2.exp(length * twist) for length, twist in zip(lengths, families[0], strict=True)]
        assert min(np.abs(way - away).max() for way in ways) < 1e-9
