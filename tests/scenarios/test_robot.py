"""The robot in a scenario file: where its parts are, what it may not meet, and its drive."""

import numpy as np
import pytest
import shapely
from scenarios.conftest import Changed

from pushplan.mechanics.body import BodyKind
from pushplan.scenario.file import scenario_from_document

ROOMY = "  - {circle: 0.1, center: [1.0, 0.2]}\n", ""
"""The change that leaves room for a robot at the goal."""


def with_robot(stated: str) -> tuple[str, str]:
    return "start: [0.0, 0.0, 0.0]", f"robot: {stated}\nstart: [0.0, 0.0, 0.0]"


def test_a_box_stands_behind_the_front_edge_of_the_plate(valid: Changed) -> None:
    chain = valid.scenario(with_robot("{footprint: {box: [0.42, 0.285], pose: [-0.21, 0, 0]}}"), ROOMY).chain
    (part,) = chain.pusher.footprint
    low, high = part.min(axis=0), part.max(axis=0)
    np.testing.assert_allclose([*low, *high], [-0.42, -0.1425, 0.0, 0.1425], atol=1e-15)
    assert [(body.name, body.kind) for body in chain.bodies] == [
        ("robot", BodyKind.ROBOT),
        ("pusher", BodyKind.PLATE),
        ("near", BodyKind.OBJECT),
        ("far", BodyKind.OBJECT),
    ]
    assert valid.scenario().chain.pusher.footprint == ()


@pytest.mark.parametrize("offset", [0.0, 0.07, -0.055])
def test_poses_are_in_the_frame_of_the_plate_wherever_that_touches(valid: Changed, offset: float) -> None:
    """Moved along the plate, the first object takes the chain frame with it; plate and robot stay together."""
    stated = (
        "{footprint: [{polygon: [[0, 0], [0.2, 0], [0, 0.1]], pose: [-0.3, 0.02, 90 deg]}], "
        "drive: {car: {axle: [-0.3, 0.01, 5 deg], min_radius: 1.0}}}"
    )
    changes = (
        ("    support: uniform\n", f"    support: uniform\n    offset: {offset}\n"),
        ("  drive: omnidirectional\n", ""),
    )
    pusher = valid.scenario(with_robot(stated), ROOMY, *changes).chain.pusher
    front = np.array([pusher.outline[:, 0].max(), pusher.outline[:, 1].mean()])
    assert abs(front[1] + offset) < 0.5 * 0.08 + 1e-12
    expected = shapely.Polygon([(-0.3, 0.02), (-0.3, 0.22), (-0.4, 0.02)])
    assert shapely.Polygon(pusher.footprint[0] - front).symmetric_difference(expected).area < 1e-15
    assert (pusher.drive.kind, pusher.drive.min_radius) == ("car", 1.0)
    assert pusher.drive.axle is not None
    np.testing.assert_allclose(
        pusher.drive.axle, [front[0] - 0.3, front[1] + 0.01, np.radians(5.0)], atol=1e-15
    )


@pytest.mark.parametrize("stated", [
    "{footprint: {box: [0.42, 0.285], pose: [-0.21, 0, 0]}}",
    "{footprint: [{polygon: [[-0.03, -0.1], [-0.3, -0.1], [-0.2, 0], [-0.3, 0.1], [-0.03, 0.1]]}, "
    "{box: [0.1, 0.1], pose: [-0.4, 0, 0.3]}], drive: {differential: {axle: [-0.3, 0, 0]}}}",
    "{drive: omnidirectional}",
    "{}",
])  # fmt: skip
def test_what_is_resolved_is_the_same_scenario(valid: Changed, stated: str) -> None:
    scenario = valid.scenario(with_robot(stated), ROOMY, ("  drive: omnidirectional\n", ""))
    again = scenario_from_document(scenario.resolved())
    assert again == scenario
    for one, other in zip(scenario.chain.bodies, again.chain.bodies, strict=True):
        np.testing.assert_allclose(one.outline, other.outline, atol=1e-12)


@pytest.mark.parametrize(("stated", "finding"), [
    (
        "{footprint: {box: [0.42, 0.285], pose: [-0.2, 0, 0]}}",
        "f.yaml:21:20: robot.footprint: 'robot' overlaps 'near' by 10 mm; move them apart",
    ),
    (
        "{footprint: [{box: [0.1, 0.1], pose: [-0.1, 0, 0]}, {polygon: [[0, 0.1], [0.15, 0.03], [0.15, 0.1]]}]}",
        "f.yaml:21:60: robot.footprint[1]: 'robot' overlaps 'far' by 20 mm; move them apart",
    ),
    (
        "{footprint: {polygon: [[-0.2, -0.1], [0, -0.1], [0, -0.04], [0.1, -0.04], [0.1, -0.15], [-0.2, -0.15]]}}",
        "f.yaml:21:20: robot.footprint: 'robot' touches 'near' beside the plate, which alone may push; move it back",
    ),
    (
        "{drive: omnidirectional}",
        "f.yaml:21:9: robot.drive: is stated in pusher.drive, too; keep one of them",
    ),
    (
        "{footprint: {box: [0.55, 0.285], pose: [-0.275, 0, 0]}}",
        "f.yaml:22:8: start: at the start, 'robot' leaves the workspace (x >= -0.5) by 50 mm",
    ),
    (
        "{footprint: {box: [0.1, 0.1], pose: [-0.15, -1.15, 0]}}",
        "f.yaml:24:9: goal.pose: at the goal, 'robot' leaves the workspace (x <= 2) by 410 mm",
    ),
])  # fmt: skip
def test_findings_name_the_place_and_what_helps(valid: Changed, stated: str, finding: str) -> None:
    assert finding in valid.findings(with_robot(stated))
