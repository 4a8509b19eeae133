"""The independent checker: it finds what is there, whoever hits it, and refines coarse motions."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from pushplan.geometry import se2
from pushplan.planners.clearance import SPACING, Motion, Room, densify, find_collision
from pushplan.scenario.file import load_scenario, scenario_from_text
from pushplan.scenario.model import CircleObstacle, Scenario
from pushplan.util.names import CLEARANCE_ROOM

TEXT = """
format: pushplan/1
name: lane
floor: {friction: 0.3}
objects:
  - {name: box, shape: {box: [0.1, 0.1]}, mass: 1.0, support: uniform}
contacts: {friction: 0.3}
pusher: {width: 0.3, thickness: 0.02, friction: 0.4}
start: [0.0, 0.0, 0.0]
goal: {pose: [1.0, 0.0, 0.0]}
workspace: {x: [-0.5, 1.5], y: [-0.5, 0.5]}
obstacles:
  - {box: [0.002, 0.1], pose: [0.5, 0.17, 0.0]}
  - {circle: 0.05, center: [0.8, -0.11]}
"""


@pytest.fixture
def lane() -> Scenario:
    return scenario_from_text(TEXT, "lane.yaml")


def test_coming_nearer_than_the_clearance_is_a_collision_that_tells_the_gap(lane: Scenario) -> None:
    poses = np.array([[0.6, -0.008, 0.0], [0.7, -0.008, 0.0]])
    assert find_collision(lane, poses) is None
    found = find_collision(replace(lane, clearance=0.003), poses)
    assert found is not None
    assert (found.body, found.obstacle) == ("box", 1)
    assert found.gap == pytest.approx(0.003, abs=SPACING)
    assert "'box' is 2" in str(found)
    assert "mm from obstacles[1] with the chain frame at (0." in str(found)


def test_few_poses_find_what_many_do(lane: Scenario) -> None:
    """The motion that is proven by distances is free where a pose every half millimetre is."""
    rng = np.random.default_rng(4)
    free = blocked = 0
    for _ in range(60):
        poses = np.cumsum(rng.normal(size=(6, 3)) * [0.08, 0.05, 0.2], axis=0)
        poses[:, 0] += 0.3
        found = find_collision(lane, poses)
        dense = densify(poses, lane.chain.reach, 5e-4)
        gaps = Room.of(lane).gaps(dense, 0.1)
        near = np.flatnonzero(gaps < lane.clearance - CLEARANCE_ROOM)
        if found is None:
            assert not len(near) or gaps.min() > lane.clearance - CLEARANCE_ROOM - SPACING
            free += 1
        else:
            travel = Motion.through(dense, lane.chain.reach).travel
            at = travel[np.argmin(np.abs(dense - found.pose).sum(axis=1))]
            assert travel[near[0]] - 1e-3 <= at <= travel[near[0]] + SPACING + 1e-3
            blocked += 1
    assert min(free, blocked) > 10


@pytest.mark.parametrize("name", ["three-boxes-clutter", "asymmetric", "carts", "hook"])
@pytest.mark.parametrize("enough", [0.01, 0.3, 5.0])
def test_gaps_are_the_distances_of_every_body_from_everything_up_to_what_is_enough(
    name: str, enough: float
) -> None:
    scenario = load_scenario(name)
    walls = scenario.workspace
    assert walls is not None
    rng = np.random.default_rng(2)
    poses = rng.uniform([walls.xmin, walls.ymin, -4.0], [walls.xmax, walls.ymax, 4.0], (40, 3))
    found = Room.of(scenario).gaps(poses, enough)
    for pose, gap in zip(poses, found, strict=True):
        outlines = [se2.transform_points(pose, body.outline) for body in scenario.chain.bodies]
        corners = np.concatenate(outlines)
        away = [corners[:, 0] - walls.xmin, walls.xmax - corners[:, 0]]
        away += [corners[:, 1] - walls.ymin, walls.ymax - corners[:, 1]]
        apart = [float(np.min(away)), enough]
        for outline in outlines:
            for obstacle in scenario.obstacles:
                if isinstance(obstacle, CircleObstacle):
                    middle = shapely.Point(obstacle.center)
                    apart.append(shapely.Polygon(outline).distance(middle) - obstacle.radius)
                else:
                    apart.append(shapely.Polygon(outline).distance(shapely.Polygon(obstacle.outline)))
        assert gap == pytest.approx(max(min(apart), 0.0), abs=1e-12)
