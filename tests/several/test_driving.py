"""Transits of the robot: steering paths that end at the goal, respect the drive, and avoid obstacles."""

import math

import numpy as np
import pytest
from conftest import there
from ompl import base
from several.conftest import Problem

from pushplan.core.driving import Surroundings, WheelKind, Wheels, find_drives, find_reeds_shepp
from pushplan.core.transit import find_transit, shortened
from pushplan.geometry import se2
from pushplan.planners.clearance import Motion, Moving, Room, Standing, find_collisions
from pushplan.planners.multi.room import _scenes, wheels_of
from pushplan.plans.path import PushPath, cost_rate
from pushplan.scenario.parts import PolygonObstacle
from pushplan.util.arrays import FloatArray

AXLE = np.array([-0.3, 0.02, 0.1])
KINDS = pytest.mark.parametrize("kind", list(WheelKind.__members__.values()))


def driven(start: FloatArray, arcs: FloatArray) -> FloatArray:
    for arc in arcs:
        start = se2.compose(start, se2.exp(arc[:3] * arc[3]))
    return start


def test_the_shortest_steering_path_of_a_car_is_as_long_as_ompl_s() -> None:
    space = base.ReedsSheppStateSpace(1.0)
    first, second = space.allocState(), space.allocState()
    first.setX(0.0), first.setY(0.0), first.setYaw(0.0)
    random = np.random.default_rng(1)
    for scale in np.repeat([0.1, 1.0, 5.0], 150):
        x, y = scale * random.uniform(-1.0, 1.0, 2)
        phi = random.uniform(-math.pi, math.pi)
        second.setX(x), second.setY(y), second.setYaw(phi)
        shortest = min(np.abs(lengths).sum() for _, lengths in find_reeds_shepp(x, y, phi))
        assert shortest == pytest.approx(space.distance(first, second), abs=1e-9)


@KINDS
def test_every_steering_path_leads_to_the_goal(kind: WheelKind) -> None:
    wheels, random = Wheels(kind, AXLE, 1.0), np.random.default_rng(2)
    for start, goal in random.uniform(-3.0, 3.0, (100, 2, 3)):
        words = find_drives(wheels, start, goal)
        assert words
        for arcs in words:
            assert max(se2.pose_error(driven(start, arcs), goal)) < 1e-9
            np.testing.assert_allclose(cost_rate(arcs[:, :3]), 1.0, atol=1e-12)


@pytest.mark.parametrize("kind", [WheelKind.DIFFERENTIAL, WheelKind.CAR])
def test_an_axle_never_moves_sideways_and_a_car_turns_no_tighter_than_it_can(kind: WheelKind) -> None:
    wheels, random = Wheels(kind, AXLE, 0.8), np.random.default_rng(3)
    for start, goal in random.uniform(-3.0, 3.0, (50, 2, 3)):
        for arcs in find_drives(wheels, start, goal):
            turned = se2.rotate(-AXLE[2], arcs[:, :2] + arcs[:, 2:3] * np.array([-AXLE[1], AXLE[0]]))
            np.testing.assert_allclose(turned[:, 1], 0.0, atol=1e-12)
            if kind == WheelKind.CAR:
                assert (np.abs(arcs[:, 2]) * 0.8 <= np.abs(turned[:, 0]) + 1e-12).all()


@pytest.mark.parametrize("drive", ["car", "differential", "omnidirectional"])
def test_ways_are_shortened_anywhere_in_the_world(problem: Problem, drive: str) -> None:
    for x, y in ((0.0, 0.0), (7.0, -4.0)):
        start, goal = np.array([x, y, 0.3]), np.array([x + 1.4, y + 0.3, 2.0])
        standing = [{"box": [0.3, 1.5], "pose": [x + 0.6, y, 0.2]}, {"circle": 0.2, "center": [x - 0.6, y + 0.8]}]
        room = {"x": [x - 2.0, x + 4.0], "y": [y - 2.0, y + 4.0]}
        ends = {"start": [x + 3.0, y + 3.0, 0.0], "goal": {"pose": [x + 3.0, y + 1.5, 0.0], "of": "b0"}}
        scenario = problem(drive, obstacles=standing, robot={"start": start.tolist()}, workspace=room, **ends)
        around, state = Surroundings(*_scenes(scenario), scenario.start), np.array([1], dtype=np.uint64)
        wheels = wheels_of(scenario.chain.pusher.drive, np.array([-0.2, 0.0]))
        arcs = there(
            find_transit(around, wheels, start, goal, (x - 2.0, y - 2.0, x + 4.0, y + 4.0), 1.0, state, 2000)
        )
        shorter = shortened(around, wheels, start, arcs, state, 200)
        assert max(se2.pose_error(driven(start, shorter), goal)) < 1e-6
        assert shorter[:, 3].sum() < 0.92 * arcs[:, 3].sum()


@pytest.mark.parametrize("drive", ["car", "differential", "omnidirectional"])
def test_paths_around_obstacles_pass_the_independent_checker(problem: Problem, drive: str) -> None:
    standing = [{"box": [0.3, 1.5], "pose": [0.6, 0.0, 0.0]}, {"circle": 0.2, "center": [-0.6, 0.8]}]
    scenario = problem(drive, obstacles=standing, start=[3.0, 3.0, 0.0], robot={"start": [0.0, 0.0, 0.0]})
    robot, load = _scenes(scenario)
    wheels = wheels_of(scenario.chain.pusher.drive, np.array([-0.2, 0.0]))
    place = np.array([0.5, 1.1, 0.0])
    around = Surroundings(robot, load, place)
    start, goal = np.zeros(3), np.array([1.4, 0.1, 2.0])
    state = np.array([1], dtype=np.uint64)
    arcs = there(find_transit(around, wheels, start, goal, (-2.0, -2.0, 4.0, 4.0), 1.0, state, 2000))
    assert len(arcs) > 1
    shorter = shortened(around, wheels, start, arcs, state, 100)
    assert shorter[:, 3].sum() <= arcs[:, 3].sum()
    outlines = [se2.transform_points(place, obj.outline_chain) for obj in scenario.chain.objects]
    resting = [PolygonObstacle(outline) for outline in outlines]
    everything = Standing.of((*scenario.obstacles, *resting))
    room = Room((Moving.of(scenario.chain.carried),), scenario.workspace, everything)
    for way in (arcs, shorter):
        path = PushPath(start, way[:, :3], way[:, 3])
        assert max(se2.pose_error(path.end, goal)) < 1e-9
        assert find_collisions(room, (Motion.along(path, scenario.chain.reach),), scenario.clearance) == [None]
