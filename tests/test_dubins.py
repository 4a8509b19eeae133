"""The chain as Dubins' car: its motion, its words against OMPL's distances, and where there is no such car."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from ompl import base as ob
from plain import load_plain

from pushplan.errors import PlanningError
from pushplan.geometry import se2
from pushplan.mechanics.chain import Drive
from pushplan.planners.ompl.dubins import Car
from pushplan.planners.planner import plan
from pushplan.planners.problem.controls import control_segments, steering_families
from pushplan.planners.problem.steering import MAX_WORDS, find_words
from pushplan.sets.named import stable_set
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray

AXLE = np.array([-0.25, 0.02, 0.0])
DRIVES = [Drive(), Drive("differential", AXLE), Drive("car", AXLE, 0.8)]


@pytest.fixture(scope="module")
def stable(make_chain: Any) -> StableSet:
    return stable_set(make_chain.boxes(3, size=(0.1, 0.2)), "ecof")


def _car(stable: StableSet, drive: Drive) -> Car:
    return Car.from_families(steering_families(control_segments(stable, drive, 0.01)))


def _of_car(car: Car, twist: FloatArray) -> tuple[FloatArray, float]:
    """Velocity (2,) of m in the car's frame and turning rate of a twist."""
    velocity = twist[:2] + twist[2] * np.array([-car.middle[1], car.middle[0]])
    return se2.rotate(-car.middle[2], velocity), float(twist[2])


@pytest.mark.parametrize("drive", DRIVES, ids=lambda drive: drive.kind)
def test_turns_and_their_combinations_drive_a_car(stable: StableSet, drive: Drive) -> None:
    car = _car(stable, drive)
    left, straight, right = car.family
    rng = np.random.default_rng(0)
    for a, b in rng.uniform(0.0, 1.0, (50, 2)):
        velocity, omega = _of_car(car, a * left / left[2] - b * right / right[2])
        assert velocity[0] > 0.0
        assert abs(velocity[1]) < 1e-12 * velocity[0]
        assert abs(omega) / velocity[0] <= 1.0 / car.radius * (1.0 + 1e-9)
    for turn, sign in ((left, 1.0), (right, -1.0)):
        velocity, omega = _of_car(car, turn)
        assert omega / velocity[0] == pytest.approx(sign / car.radius)
    np.testing.assert_allclose(_of_car(car, straight)[0], [1.0, 0.0], atol=1e-9)
    assert stable.margin(car.family).min() > 0.01 * (1.0 - 1e-6)


def test_poses_of_car_and_chain_are_each_other_turned_back(stable: StableSet) -> None:
    car = _car(stable, DRIVES[0])
    state = ob.DubinsStateSpace(car.radius).allocState()
    for pose in np.random.default_rng(1).uniform(-3.0, 3.0, (50, 3)):
        x, y, yaw = car.of_chain(pose)
        state.setX(x)
        state.setY(y)
        state.setYaw(float(se2.wrap_angle(yaw)))
        back = car.chain_at(state)
        np.testing.assert_allclose(back[:2], pose[:2], atol=1e-12)
        assert abs(float(se2.wrap_angle(back[2] - pose[2]))) < 1e-12


@pytest.mark.parametrize("drive", DRIVES, ids=lambda drive: drive.kind)
def test_the_shortest_of_our_words_is_as_long_as_ompl_says(stable: StableSet, drive: Drive) -> None:
    car = _car(stable, drive)
    space = ob.DubinsStateSpace(car.radius)
    states = space.allocState(), space.allocState()
    words = np.zeros((MAX_WORDS, 7))
    speeds = np.array([np.linalg.norm(_of_car(car, twist)[0]) for twist in car.family])
    rng = np.random.default_rng(2)
    for _ in range(300):
        poses = rng.uniform(-3.0, 3.0, (2, 3)) * [car.radius, car.radius, 1.0]
        for state, pose in zip(states, poses, strict=True):
            x, y, yaw = car.of_chain(pose)
            state.setX(x)
            state.setY(y)
            state.setYaw(float(se2.wrap_angle(yaw)))
        n = find_words(car.family, poses[0], poses[1], words)
        lengths = (words[:n, 4:] * speeds[words[:n, 1:4].astype(int)]).sum(axis=1)
        assert lengths.min() == pytest.approx(space.distance(*states), abs=1e-6)


@pytest.mark.parametrize("planner", ["rrt-dubins", "bitstar-dubins"])
def test_only_the_turns_and_the_push_of_the_car_are_used_before_polishing(
    planner: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "pushplan.planners.improve.session.cut_short", lambda _problem, _start, arcs, _per_arc: arcs
    )
    scenario = load_plain("two-crates")
    result = plan(scenario, planner=planner, time_limit=60.0, first=True)
    assert result.path is not None
    stable = stable_set(scenario.chain)
    car = Car.from_families(steering_families(control_segments(stable, scenario.chain.pusher.drive, 1e-6)))
    apart = np.abs(result.path.twists[:, None] - car.family[None]).max(axis=2)
    letters = car.family[apart.argmin(axis=1)]
    np.testing.assert_allclose(
        result.path.twists[:, 2], letters[:, 2], atol=0.2 * np.abs(letters[:, 2]).max()
    )
    assert apart.min(axis=1).max() < 1e-9


def test_no_turn_to_one_side_is_refused(stable: StableSet) -> None:
    families = steering_families(control_segments(stable, Drive(), 0.01))
    one_sided = families.copy()
    one_sided[:, 2] = 0.0
    with pytest.raises(PlanningError, match="cannot turn to both sides and go straight; choose"):
        Car.from_families(one_sided)


def test_turns_whose_straight_push_is_not_stable_are_refused(stable: StableSet) -> None:
    families = steering_families(control_segments(stable, Drive(), 0.01)).copy()
    families[:, 1] = [0.0, 1.0, 0.0]
    with pytest.raises(PlanningError, match=r"the nearest stable one is \d+\.\d deg away; choose"):
        Car.from_families(families)


def test_the_same_seed_gives_the_same_path_and_another_one_another() -> None:
    scenario = load_plain("narrow-gap")
    results = [plan(scenario, planner="rrt-dubins", seed=s, time_limit=60.0, first=True) for s in (1, 1, 2)]
    paths = [result.path for result in results]
    assert paths[0] is not None
    assert paths[1] is not None
    assert paths[2] is not None
    np.testing.assert_array_equal(paths[0].lengths, paths[1].lengths)
    assert paths[0].cost != paths[2].cost
