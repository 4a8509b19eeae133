"""The controls of a planner lie in the stable set and within what the drive can do."""

from typing import Any

import numpy as np
import pytest

from pushplan.core.improve import random_family
from pushplan.errors import EmptyStableSetError
from pushplan.mechanics.chain import Drive
from pushplan.planners.controls import control_segments, steering_families
from pushplan.plans.path import cost_rate
from pushplan.sets.named import stable_set
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray

AXLE = np.array([-0.25, 0.02, 0.0])
DRIVES = [Drive(), Drive("differential", AXLE), Drive("car", AXLE, min_radius=0.8)]


@pytest.fixture(scope="module")
def stable(make_chain: Any) -> StableSet:
    return stable_set(make_chain.boxes(3, size=(0.1, 0.2)), "ecof")


def _sideways(twists: FloatArray) -> FloatArray:
    """Sideways speed (k,) of the axle's middle, per unit of its speed ahead."""
    ahead = twists[:, 0] - twists[:, 2] * AXLE[1]
    return np.asarray((twists[:, 1] + twists[:, 2] * AXLE[0]) / ahead)


def _check_drive(drive: Drive, twists: FloatArray) -> None:
    if drive.kind != "omnidirectional":
        assert np.abs(_sideways(twists)).max() < 1e-12
        assert (twists[:, 0] - twists[:, 2] * AXLE[1] > 0.0).all()
    if drive.kind == "car":
        ahead = twists[:, 0] - twists[:, 2] * AXLE[1]
        assert (np.abs(twists[:, 2]) * drive.min_radius <= ahead * (1.0 + 1e-9)).all()


@pytest.mark.parametrize("drive", DRIVES, ids=lambda drive: drive.kind)
@pytest.mark.parametrize("margin", [1e-6, 0.05])
def test_every_combination_of_a_segment_is_stable_and_drivable(
    stable: StableSet, drive: Drive, margin: float
) -> None:
    segments = control_segments(stable, drive, margin)
    rng = np.random.default_rng(0)
    for b in (0.0, 1.0, rng.uniform(0.0, 1.0, (len(segments), 1))):
        twists = (1.0 - b) * segments[:, :3] + b * segments[:, 3:]
        assert stable.margin(twists).min() > margin * (1.0 - 1e-6)
        _check_drive(drive, twists)


@pytest.mark.parametrize("drive", DRIVES, ids=lambda drive: drive.kind)
def test_drawn_families_are_stable_and_drivable(stable: StableSet, drive: Drive) -> None:
    segments = control_segments(stable, drive, 0.02)
    state = np.array([3], dtype=np.uint64)
    letters = np.zeros(3, dtype=int)
    for _ in range(500):
        drawn = random_family(segments, state)
        present = cost_rate(drawn) > 0.0
        letters += present
        if present.any():
            assert stable.margin(drawn[present]).min() > 0.02 * (1.0 - 1e-6)
            _check_drive(drive, drawn[present])
    assert (letters > 100).all()


def test_the_tightest_turn_of_a_car_is_its_own_where_the_contacts_allow_more(stable: StableSet) -> None:
    car = Drive("car", AXLE, min_radius=3.0)
    family = steering_families(control_segments(stable, car, 0.0))[0]
    for twist in family[[0, 2]]:
        ahead = twist[0] - twist[2] * AXLE[1]
        assert ahead / abs(twist[2]) == pytest.approx(3.0)


def test_a_drive_that_cannot_push_stably_is_refused_with_the_reason(stable: StableSet) -> None:
    sideways = Drive("differential", np.array([-0.25, 0.0, np.pi / 2]))
    with pytest.raises(
        EmptyStableSetError,
        match="the differential cannot push the chain: its best push keeps 'box2' on 'box1'",
    ):
        control_segments(stable, sideways, 1e-6)
