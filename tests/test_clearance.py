"""The clearance is a hard minimum: of every pose of a path, of start and goal, and nobody comes nearer by chance."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from pushplan.core.collision import SLACK
from pushplan.errors import PlanningError
from pushplan.geometry import se2
from pushplan.planners.planner import plan
from pushplan.planners.problem import scenario_scene
from pushplan.scenario.file import load_scenario, scenario_from_text
from pushplan.scenario.model import CircleObstacle, PolygonObstacle, Scenario
from pushplan.util.names import CLEARANCE_ROOM

LANE = """
format: pushplan/1
floor: {friction: 0.3}
objects:
  - {name: box, shape: {box: [0.1, 0.1]}, mass: 1.0}
pusher: {width: 0.2, friction: 0.4}
goal: {pose: [0.6, 0.0, 0.0]}
workspace: {x: [-0.5, 1.5], y: [-0.5, 0.5]}
obstacles:
  - {box: [0.4, 0.1], pose: [0.2, 0.16, 0.0]}
"""


def smallest_gap(scenario: Scenario, poses: np.ndarray) -> float:
    """Distance to the nearest obstacle along poses (m, 3), m."""
    outlines = [body.outline for body in scenario.chain.bodies]
    gaps = []
    for outline in outlines:
        placed = shapely.polygons(poses[:, None, :2] + se2.rotate(poses[:, 2:3], outline[None]))
        for obstacle in scenario.obstacles:
            if isinstance(obstacle, PolygonObstacle):
                gaps.append(shapely.distance(placed, shapely.Polygon(obstacle.outline)).min())
            else:
                away = shapely.distance(placed, shapely.Point(obstacle.center)).min()
                gaps.append(away - obstacle.radius)
    return float(min(gaps))


@pytest.mark.parametrize(("clearance", "trajectory"), [(0.0005, "exact"), (0.006, "blended")])
def test_paths_keep_the_clearance_and_use_it_up(clearance: float, trajectory: str) -> None:
    scenario = replace(load_scenario("narrow-gap"), clearance=clearance, trajectory=trajectory)
    result = plan(scenario, time_limit=60.0, iterations=2_000)
    assert result.solved, result.reason
    assert result.path is not None
    assert result.trajectory is not None
    poses = np.concatenate([result.path.sampled(1e-4), result.trajectory.poses])
    gap = smallest_gap(scenario, poses)
    assert gap >= clearance - 1e-9
    assert gap < clearance + 0.02


def test_a_start_just_at_the_clearance_leaves_the_room_to_leave_it() -> None:
    """The plate's end passes along the obstacle: no pose on the first half of the straight push is farther away."""
    for gap in (0.01, 0.01 + 5e-5, 0.02):
        text = LANE.replace("0.16", f"{0.15 + gap}")
        scenario = replace(scenario_from_text(text, "lane.yaml"), clearance=0.01)
        scene = scenario_scene(scenario)
        assert 0.01 - CLEARANCE_ROOM - 1e-8 <= scene.kept <= 0.01
        assert scene.clearance == pytest.approx(min(gap, 0.01 + SLACK), abs=1e-8)
        result = plan(scenario, time_limit=60.0, first=True)
        assert result.solved, result.reason
        assert result.path is not None
        assert smallest_gap(scenario, result.path.sampled(1e-4)) >= 0.01 - CLEARANCE_ROOM - 1e-8


def test_a_start_too_near_is_refused_with_what_is_near_and_by_how_much() -> None:
    scenario = load_scenario("free-space")
    near = replace(scenario, clearance=0.03, obstacles=(CircleObstacle(np.array([-0.1, 0.0]), 0.05),))
    with pytest.raises(PlanningError) as caught:
        plan(near)
    assert str(caught.value) == ("at the start, 'pusher' is 20 mm from obstacles[0]; allowed: at least 30 mm")
