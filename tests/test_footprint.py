"""The robot behind the plate keeps clear of everything, and pushes from any face."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shapely

from pushplan.core.collision import sweep_is_free
from pushplan.errors import ChainError
from pushplan.geometry import se2
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.faces import places, pushed_at, pushed_from
from pushplan.planners.clearance import find_collision
from pushplan.planners.scene import build_scene
from pushplan.plans.path import cost_rate
from pushplan.scenario.file import scenario_from_document, scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import PolygonObstacle
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
    trailer = shapely.affinity.rotate(shapely.box(-0.05, -0.15, 0.05, 0.15), 0.4, (0.0, 0.0), use_radians=True)
    trailer = shapely.affinity.translate(trailer, -0.45, 0.1)
    in_plate_frame = [shapely.box(-0.02, -0.1, 0.0, 0.1), shapely.box(0.0, -0.02, 0.1, 0.08), trailer]
    union = shapely.union_all([shapely.Polygon(waisted), *in_plate_frame])
    return shapely.affinity.translate(union, 0.0, float(scenario.chain.pusher.outline[:, 1].mean()))


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
        scene = build_scene(scenario.chain, [triangle], np.zeros((0, 3)), NOWHERE, scenario.clearance)
        free = bool(sweep_is_free(scene, 0.0, 0.0, 0.0, twist[0], twist[1], twist[2], length))
        one = replace(scenario, obstacles=(PolygonObstacle(triangle),))
        hit = find_collision(one, poses)
        if gap > 1.3 * scenario.clearance:
            assert free
            assert hit is None
            found["free"] += 1
        elif gap < 0.9 * scenario.clearance:
            assert not free
            assert hit is not None
            found["hit"] += 1
            if find_collision(bare(one), poses) is None:
                assert hit.body == "robot"
                found["hit by the robot only"] += 1
    assert min(found.values()) >= 8


LENGTHS = (0.10, 0.20, 0.14)
CAR = {"car": {"axle": [-0.3, 0.01, 0.1], "min_radius": 1.0}}


def _document(order: tuple[int, ...], turned: bool = False, offset: float = 0.0) -> dict[str, Any]:
    """Return a row of boxes in an order, each one turned by half a turn where the row is pushed from its far end."""
    boxes = [{"name": f"b{k}", "shape": {"box": [LENGTHS[k], 0.15]}, "mass": 1.0 + k} for k in range(3)]
    ends = np.cumsum([LENGTHS[k] for k in order])
    objects = [
        boxes[k] | {"pose": [float(end - LENGTHS[k] / 2), 0.0, np.pi if turned else 0.0]}
        for k, end in zip(order, ends, strict=True)
    ]
    objects[0]["offset"] = -offset
    pairs = [("b0", "b1", 0.2), ("b1", "b2", 0.3)]
    return {
        "format": "pushplan/1",
        "name": "row",
        "floor": {"friction": 0.3},
        "objects": objects,
        "contacts": {"between": [{"objects": [a, b], "friction": mu} for a, b, mu in pairs]},
        "pusher": {"width": 0.1, "friction": 0.5},
        "robot": {"footprint": {"box": [0.4, 0.2], "pose": [-0.25, 0.0, 0.0]}, "drive": CAR},
        "start": [0.0, 0.0, 0.0],
        "goal": {"pose": [1.0, 0.0, 0.0]},
    }


def _numbers(chain: Chain) -> list[Any]:
    """Return all numbers of a chain in one order; names and indices are compared beside it."""
    pusher = chain.pusher
    contacts = [(*c.left, *c.right, c.friction) for c in chain.contacts]
    return [chain.places, pusher.outline, pusher.plate_pose, pusher.drive.axle, *pusher.footprint, *contacts]


@pytest.mark.parametrize("offset", [0.0, 0.015])
def test_the_far_end_of_a_row_is_the_row_stated_from_there(offset: float) -> None:
    chain = scenario_from_document(_document((0, 1, 2))).chain
    document = _document((2, 1, 0), turned=True)
    # The frame is the middle of the contact, which is the plate's own middle: the row moves aside instead.
    for obj in document["objects"]:
        obj["pose"][1] -= offset
    document["objects"][0]["offset"] = -offset
    stated = scenario_from_document(document).chain
    found = pushed_at(chain, "b2 front", offset)
    assert [obj.name for obj in found.objects] == ["b2", "b1", "b0"]
    assert [(c.pushed, c.pusher) for c in found.contacts] == [(c.pushed, c.pusher) for c in stated.contacts]
    for mine, theirs in zip(_numbers(found), _numbers(stated), strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=0.0, atol=1e-12)
    assert found.pusher.limits == chain.pusher.limits


def test_at_every_place_the_objects_keep_their_poses_and_the_plate_touches() -> None:
    document = _document((0, 1, 2))
    del document["robot"]
    chain = scenario_from_document(document).chain
    found = list(places(chain, None, (0.0, 0.02)))
    assert len(found) > 4
    for place in found:
        pushed = pushed_from(chain, place)
        for obj in pushed.objects:
            stood = chain.objects[chain.index_of(obj.name)].pose_chain
            np.testing.assert_allclose(se2.compose(place.contact, obj.pose_chain), stood, atol=1e-12)
        plate = se2.compose(place.contact, pushed.pusher.plate_pose)
        np.testing.assert_allclose(plate, place.plate, atol=1e-12)
        middle = 0.5 * (pushed.contacts[0].left + pushed.contacts[0].right)
        np.testing.assert_allclose(middle, 0.0, atol=1e-12)


@pytest.mark.parametrize(("face", "offset", "message"), [
    ("b7 rear", 0.0, "no face"), ("left", 0.0, "2 faces"), ("b0 rear", 0.5, "no face"),
])  # fmt: skip
def test_what_is_no_face_is_refused(face: str, offset: float, message: str) -> None:
    with pytest.raises(ChainError, match=message):
        pushed_at(scenario_from_document(_document((0, 1, 2))).chain, face, offset)
