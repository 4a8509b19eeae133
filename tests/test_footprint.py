"""The robot behind the plate keeps clear of everything, judged by shapely on the union of all bodies."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from pushplan.bench.validation import clearance
from pushplan.core.collision import sweep_is_free
from pushplan.geometry import se2
from pushplan.planners.clearance import find_collision
from pushplan.planners.planner import plan
from pushplan.planners.scene import build_scene
from pushplan.plans.path import cost_rate
from pushplan.plans.run import Execution
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.model import PolygonObstacle, Scenario
from pushplan.util.arrays import FloatArray

TEXT = """
format: pushplan/1
floor: {friction: 0.3}
objects:
  - {name: box, shape: {box: [0.1, 0.1]}, mass: 1.0, offset: 0.03}
pusher: {width: 0.2, thickness: 0.02, friction: 0.4}
robot:
  footprint:
    - polygon: [[-0.02, -0.1], [-0.1, -0.04], [-0.3, -0.15], [-0.3, 0.15], [-0.1, 0.04], [-0.02, 0.1]]
    - {box: [0.1, 0.3], pose: [-0.45, 0.1, 0.4]}
goal: {pose: [3.0, 0.0, 0.0]}
clearance: 0.001
"""
"""A waisted robot with a trailer that does not touch it."""

NOWHERE = (-np.inf, -np.inf, np.inf, np.inf)


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return scenario_from_text(TEXT, "robot.yaml")


def bare(scenario: Scenario) -> Scenario:
    """The same without the robot's body."""
    pusher = replace(scenario.chain.pusher, footprint=())
    return replace(scenario, chain=replace(scenario.chain, pusher=pusher))


def stated_bodies(scenario: Scenario) -> shapely.Geometry:
    """What moves, in the chain frame, written down again by hand."""
    waisted = [(-0.02, -0.1), (-0.1, -0.04), (-0.3, -0.15), (-0.3, 0.15), (-0.1, 0.04), (-0.02, 0.1)]
    trailer = shapely.affinity.rotate(
        shapely.box(-0.05, -0.15, 0.05, 0.15), 0.4, (0.0, 0.0), use_radians=True
    )
    trailer = shapely.affinity.translate(trailer, -0.45, 0.1)
    in_plate_frame = [shapely.box(-0.02, -0.1, 0.0, 0.1), shapely.box(0.0, -0.02, 0.1, 0.08), trailer]
    union = shapely.union_all([shapely.Polygon(waisted), *in_plate_frame])
    return shapely.affinity.translate(union, 0.0, float(scenario.chain.pusher.outline[:, 1].mean()))


def executed(scenario: Scenario, poses: FloatArray) -> Execution:
    chain, m = scenario.chain, len(poses)
    plate, box = se2.compose(poses, chain.pusher.plate_pose), se2.compose(poses, chain.objects[0].pose_chain)
    t, segment = np.arange(float(m)), np.zeros(m, int)
    return Execution(
        ("box",), "ecof", t, plate, 0.0 * plate, box[:, None], segment, np.zeros((m, 1)), None, (0.0, 0.0)
    )


def gap_along(body: shapely.Geometry, poses: FloatArray, obstacle: shapely.Geometry) -> float:
    """Smallest distance (m) of a body at poses (m, 3) from an obstacle."""
    corners = shapely.get_coordinates(obstacle)[:-1] - poses[:, None, :2]
    return float(shapely.distance(body, shapely.polygons(se2.rotate(-poses[:, 2:], corners))).min())


def test_the_sweep_and_the_checker_agree_with_shapely_about_the_robot(scenario: Scenario) -> None:
    """Triangles near random arcs: free with room to spare is free, a hit is found, the plate alone is not it."""
    rng, body = np.random.default_rng(3), stated_bodies(scenario)
    found = {"free": 0, "hit": 0, "hit by the robot only": 0}
    for _ in range(90):
        twist = np.array([1.0, rng.normal(0.0, 0.2), rng.normal(0.0, 1.5)])
        twist, length = twist / cost_rate(twist), rng.uniform(0.2, 1.0)
        poses = se2.exp(twist * np.linspace(0.0, length, 700)[:, None])
        at = se2.transform_points(poses[rng.integers(700)], rng.uniform([-0.6, -0.4], [0.2, 0.4]))
        triangle = at + rng.uniform(0.01, 0.06, (3, 1)) * np.array([[1.0, 0.0], [-0.5, 0.9], [-0.5, -0.9]])
        gap = gap_along(body, poses, shapely.Polygon(triangle))
        scene = build_scene(scenario.chain, [triangle], [], NOWHERE, scenario.clearance)
        free = bool(sweep_is_free(scene, 0.0, 0.0, 0.0, twist[0], twist[1], twist[2], length))
        one = replace(scenario, obstacles=(PolygonObstacle(triangle),))
        hit = find_collision(one, poses)
        if gap > 1.3 * scenario.clearance:
            assert free
            assert hit is None
            found["free"] += 1
            assert clearance(one, executed(one, poses)) == pytest.approx(gap, abs=0.006)
        elif gap < 0.9 * scenario.clearance:
            assert not free
            assert hit is not None
            found["hit"] += 1
            if find_collision(bare(one), poses) is None:
                assert hit.body == "robot"
                found["hit by the robot only"] += 1
    assert min(found.values()) >= 8


def test_plans_keep_the_robot_clear_where_the_plate_alone_would_cut_a_corner() -> None:
    """A post that the robot's tail sweeps over: the plan without the robot runs it into that, the other not."""
    text = TEXT.replace("goal: {pose: [3.0, 0.0, 0.0]}", "goal: {pose: [0.7, 0.4, 1.2]}")
    tail = "{box: [0.5, 0.4], pose: [-0.29, 0, 0]}"
    begin, end = text.index("    - polygon"), text.index("goal:")
    text = (
        text[:begin] + f"    - {tail}\n" + text[end:] + "obstacles: [{circle: 0.03, center: [0.18, 0.26]}]\n"
    )
    scenario = scenario_from_text(text, "tail.yaml")
    body = shapely.union_all([shapely.Polygon(each.outline) for each in scenario.chain.bodies])
    post = shapely.Point(0.18, 0.26).buffer(0.03, quad_segs=64)
    without = plan(bare(scenario), seed=1, time_limit=60.0, iterations=3000)
    with_robot = plan(scenario, seed=1, time_limit=60.0, iterations=3000)
    assert without.path is not None
    assert with_robot.path is not None
    assert with_robot.solved
    assert gap_along(body, without.path.sampled(0.002), post) == 0.0
    assert gap_along(body, with_robot.path.sampled(0.002), post) > 0.9 * scenario.clearance
