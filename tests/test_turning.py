"""Turning radii that the drive can make: against a dense scan of its own family of twists, and in what users read."""

from dataclasses import replace

import numpy as np
import pytest

from pushplan.geometry import se2
from pushplan.mechanics.chain import Drive
from pushplan.planners.controls import MARGIN_FLOOR, control_segments
from pushplan.planners.infeasible.turning import drive_radii, turning_faults
from pushplan.scenario.file import load_scenario
from pushplan.scenario.model import Scenario, StabilitySettings
from pushplan.sets.named import stable_set

DRIVES = (
    Drive("differential", np.array([-0.45, 0.0, 0.0])),
    Drive("differential", np.array([-0.3, 0.1, 0.1])),
    Drive("differential", np.array([0.9, 0.0, 0.0])),
    Drive("car", np.array([-0.45, 0.0, 0.0]), 5.0),
)


@pytest.fixture(scope="module")
def carts() -> Scenario:
    return replace(load_scenario("carts"), stability=StabilitySettings("ecof", 0.02))


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("margin", [0.0, 0.03])
def test_no_stable_motion_of_the_axle_turns_tighter(carts: Scenario, drive: Drive, margin: float) -> None:
    """An axle that rolls ahead has its centre of rotation beside it, at a signed distance 1 / turn."""
    stable = stable_set(carts.chain)
    radii = drive_radii(stable, drive, margin)
    assert drive.axle is not None
    beside = np.concatenate([np.geomspace(1e-2, 1e3, 40_000), -np.geomspace(1e-2, 1e3, 40_000)])
    beside = beside[np.abs(beside) >= drive.min_radius]
    centers = se2.transform_points(drive.axle, np.column_stack([np.zeros_like(beside), beside]))
    turn = np.sign(beside)
    twists = turn[:, None] * np.column_stack([centers[:, 1], -centers[:, 0], np.ones_like(beside)])
    allowed = stable.margin(twists) > margin
    reach = np.hypot(*centers.T)
    for radius, side in ((radii.left, turn > 0.0), (radii.right, turn < 0.0)):
        assert radius == pytest.approx(np.min(reach[allowed & side], initial=np.inf), rel=2e-3)
    of_set = stable.turning_radii(margin)
    assert radii.left >= of_set.left * (1.0 - 1e-9)
    assert radii.right >= of_set.right * (1.0 - 1e-9)


def test_reasons_of_a_failure_name_both_radii(carts: Scenario) -> None:
    stable, drive = stable_set(carts.chain), carts.chain.pusher.drive
    assert carts.workspace is not None
    narrow = replace(carts, workspace=replace(carts.workspace, ymin=-1.0, ymax=7.0))
    segments = control_segments(stable, drive, carts.required_margin + MARGIN_FLOOR)
    (found,) = turning_faults(narrow, stable, segments)
    assert found.text == (
        "perhaps the turns are too wide: the tightest one that the differential drive can make, of radius 4.14 m "
        "(without the drive: 1.27 m), makes a circle that does not fit into the workspace, 8 m across"
    )
    assert found.numbers["left_of_set"] == pytest.approx(stable.turning_radii(0.02).left, rel=0.01)
    (found,) = turning_faults(carts, stable, segments[:, [0, 1, 2, 0, 1, 2]][segments[:, 2] < 0.0])
    assert found.text == (
        "perhaps the one-sided turning is the reason: every stable turn that the differential drive can make goes to "
        "the right, with a radius of 4.14 m or more (without the drive: 1.27 m to the left and 1.27 m to the right), "
        "and the goal asks for a way to the left"
    )
