"""The robot behind the plate keeps clear of everything, and pushes from any face."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pushplan.core.collision import sweep_is_free
from pushplan.errors import ChainError
from pushplan.geometry import se2
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.faces import places, pushed_at, pushed_from
from pushplan.planners.clearance import find_collision
from pushplan.planners.scene import build_scene
from pushplan.scenario.file import scenario_from_document, scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import CircleObstacle

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


@pytest.mark.parametrize(("aside", "free"), [(0.262, False), (0.275, True)])
def test_sweep_and_checker_find_what_the_robot_alone_hits(scenario: Scenario, aside: float, free: bool) -> None:
    """Only the trailer extends so far to the left: 0.1 + 0.05 sin 0.4 + 0.15 cos 0.4 = 0.2576 m."""
    disc = np.array([0.2, aside + scenario.chain.pusher.plate_pose[1], 0.01])
    scene = build_scene(scenario.chain, [], disc[None], NOWHERE, scenario.clearance)
    assert sweep_is_free(scene, np.zeros(3), np.array([1.0, 0.0, 0.0]), 1.0) == free
    standing = (CircleObstacle(disc[:2], disc[2]),)
    met = find_collision(replace(scenario, obstacles=standing), np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))
    assert (None if met is None else met.body) == (None if free else "robot")


LENGTHS = (0.10, 0.20, 0.14)
CAR = {"car": {"axle": [-0.3, 0.01, 0.1], "min_radius": 1.0}}


def _document(order: tuple[int, ...], turned: bool = False, offset: float = 0.0) -> dict[str, Any]:
    """Return a row of boxes in an order, each turned by half a turn if the row is pushed from its far end."""
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
    """Return all numbers of a chain in one order, without names and indices."""
    pusher = chain.pusher
    contacts = [(*c.left, *c.right, c.friction) for c in chain.contacts]
    return [chain.places, pusher.outline, pusher.plate_pose, pusher.drive.axle, *pusher.footprint, *contacts]


@pytest.mark.parametrize("offset", [0.0, 0.015])
def test_pushing_a_row_from_its_far_end_equals_the_reversed_row(offset: float) -> None:
    chain = scenario_from_document(_document((0, 1, 2))).chain
    document = _document((2, 1, 0), turned=True)
    # The frame is at the middle of the contact, which is the plate's middle, so the row moves sideways instead.
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


def test_at_every_contact_the_objects_keep_their_poses_and_the_plate_touches() -> None:
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
def test_an_invalid_face_is_refused(face: str, offset: float, message: str) -> None:
    with pytest.raises(ChainError, match=message):
        pushed_at(scenario_from_document(_document((0, 1, 2))).chain, face, offset)
