"""Proofs of boxed-in bodies: all reachable poses lie in the cells, and no solvable problem is refused."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from conftest import there
from plans_of import load_plain, plain

from pushplan.bench.random_problems import generate
from pushplan.bench.schema import ProblemParameters
from pushplan.core.infeasible import CLOSED, ORIGIN, Steps
from pushplan.core.problem import Problem
from pushplan.geometry import se2
from pushplan.mechanics.sphere import twists_at
from pushplan.planners.clearance import find_collision
from pushplan.planners.controls import segment_ends
from pushplan.planners.infeasible import pockets as pocket
from pushplan.planners.infeasible.pockets import LEVELS, make_steps, push_hull, reached
from pushplan.planners.problem import build_problem, standing_in
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import CircleObstacle, PolygonObstacle
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray, IntArray

RANDOM = ProblemParameters(objects=(1, 5), obstacles=(0, 30), drives=("omnidirectional", "differential", "car"))


def _random(seed: int) -> tuple[Scenario, StableSet, Problem]:
    scenario = plain(scenario_from_text(generate(RANDOM, seed), f"random {seed}"))
    stable = scenario.stable_set()
    return scenario, stable, build_problem(scenario, stable)


def _closed(scenario: Scenario, problem: Problem, end: int) -> tuple[Steps, IntArray]:
    """Return steps and cells of the first level on which the expansion from an end (0 for the start) is complete."""
    ends = np.array([scenario.start, scenario.goal.pose_chain])
    hull = push_hull(segment_ends(problem.segments), problem.scene.body_bound[:2])
    for level in LEVELS:
        steps = make_steps(problem.scene, hull, level, scenario.clearance, back=end == 1)
        outcome, cells = reached(problem.scene, ends[end], ends[1 - end], steps, 1 << 18)
        if outcome == CLOSED:
            return steps, cells
    raise AssertionError("no level is closed")


def _wander(
    scenario: Scenario, problem: Problem, pose: FloatArray, sign: float, travel: float, rng: np.random.Generator
) -> list[FloatArray]:
    """Return poses (3,) after each `travel` of the body's centre, along random pushes, until a collision."""
    middle = problem.scene.body_bound
    poses: list[FloatArray] = []
    while True:
        left = travel
        while left > 1e-12:
            row = problem.segments[rng.integers(len(problem.segments))]
            share = rng.choice([0.0, 1.0, rng.random()])
            twist = (1.0 - share) * row[:3] + share * row[3:]
            part = min(left, travel * rng.choice([0.2, 0.5, 1.0]))
            pose = se2.compose(pose, se2.exp(sign * part / (twist[0] - twist[2] * middle[1]) * twist))
            left -= part
        if find_collision(scenario, pose[None]) is not None:
            return poses
        poses.append(pose)


@pytest.mark.parametrize(("is_goal", "seed"), [(False, 31), (True, 5)])  # in which obstacles enclose start or goal
def test_random_pushes_stay_within_the_cells(is_goal: bool, seed: int) -> None:
    """Poses are checked once per step, like the cells; both ignore the motion between."""
    scenario, _, problem = _random(seed)
    steps, cells = _closed(scenario, problem, int(is_goal))
    known = {tuple(cell) for cell in cells.tolist()}
    begin = np.array(scenario.goal.pose_chain if is_goal else scenario.start)
    middle, rng = problem.scene.body_bound[:2], np.random.Generator(np.random.PCG64(seed))
    origin = np.append(se2.transform_points(begin, middle), begin[2])
    seen, longest = 0, 0
    for _ in range(60):
        poses = _wander(scenario, problem, begin, steps.sign, steps.travel, rng)
        for pose in poses:
            position = np.append(se2.transform_points(pose, middle), pose[2])
            x, y, turn = se2.compose(se2.inverse(origin), position)
            column, row = round(x / steps.side) + ORIGIN, round(y / steps.side) + ORIGIN
            heading = round(turn * steps.headings / (2.0 * np.pi)) % steps.headings
            assert (column, row, heading) in known
        seen, longest = seen + len(poses), max(longest, len(poses))
    assert seen > 30
    assert longest < 200
    found = [each for each in pocket.find_pocket(scenario, scenario.stable_set(), problem) if each is not None]
    assert found[-1].is_goal == is_goal
    farthest = steps.side * np.linalg.norm(cells[:, :2] - ORIGIN, axis=1).max()
    assert found[-1].radius == pytest.approx(farthest + steps.side + steps.longest)


def test_the_cells_are_the_same_in_a_turned_world() -> None:
    scenario, _, problem = _random(31)
    steps, cells = _closed(scenario, problem, 0)
    area = there(scenario.workspace)
    (x0, y0), (x1, y1) = area.outline[0], area.outline[2]
    sides = ((-1.0, y0, x0, y1), (x1, y0, 9.0, y1), (-1.0, -1.0, 9.0, y0), (-1.0, y1, 9.0, 9.0))
    walls = [PolygonObstacle(np.array(shapely.box(*side).exterior.coords[:-1])) for side in sides]
    turn = np.array([1.0, -2.0, 1.1])
    turned = [
        PolygonObstacle(se2.transform_points(turn, one.outline))
        if isinstance(one, PolygonObstacle)
        else CircleObstacle(se2.transform_points(turn, one.center), one.radius)
        for one in (*scenario.obstacles, *walls)
    ]
    scene = problem.scene.with_obstacles(*standing_in(replace(scenario, obstacles=tuple(turned), workspace=None)))
    ends = [se2.compose(turn, pose) for pose in (scenario.start, scenario.goal.pose_chain)]
    outcome, again = reached(scene, ends[0], ends[1], steps, 1 << 18)
    assert outcome == CLOSED
    before, after = (set(map(tuple, found.tolist())) for found in (cells, again))
    assert len(before ^ after) <= 0.01 * len(before)  # some are decided by rounding


@pytest.mark.parametrize("name", ["asymmetric", "five-objects", "narrow-gap", "two-crates"])
def test_every_stable_twist_lies_in_the_hull(name: str) -> None:
    """Also twists between the meridians of the hull."""
    scenario = load_plain(name)
    stable = scenario.stable_set()
    problem = build_problem(scenario, stable)
    middle = problem.scene.body_bound[:2]
    hull = push_hull(pocket._extreme_twists(scenario, stable, problem), middle)
    found, length = (stable.meridians(scenario.required_margin, count=30_011), stable.chain.characteristic_length)
    twists = np.concatenate([twists_at(found.longitude, ends, length) for ends in (found.lower, found.upper)])
    ahead = twists[:, 0] - twists[:, 2] * middle[1]
    points = np.stack([(twists[:, 1] + twists[:, 2] * middle[0]) / ahead, twists[:, 2] / ahead], axis=1)
    assert shapely.contains_xy(hull, points).all()
    exact = shapely.convex_hull(shapely.MultiPoint(points))
    assert hull.area < 1.1 * exact.area
