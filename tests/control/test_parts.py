"""What the controller is made of."""

from dataclasses import replace

import numpy as np
import pytest

import pushplan
from pushplan.errors import ChainError
from pushplan.geometry.se2 import compose, exp, relative
from pushplan.mechanics.perturb import slid
from pushplan.planners.clearance import excess
from pushplan.planners.planner import Planner
from pushplan.planners.planner import plan as plan_in
from pushplan.plans.path import cost_rate
from pushplan.plans.settings import Observer
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.parts import Goal
from pushplan.sim.control.closing import GAP, ClosingPush, Spread, closing_push, contacts_at
from pushplan.sim.control.course import Kick, kicked
from pushplan.sim.control.replanner import SHARE, Aim
from pushplan.sim.control.sensing import Measurements, Sensor, Sightings
from pushplan.sim.control.settings import ControlSettings
from pushplan.sim.follower import Drive

SPREAD = Spread(0.2, 2.5e-4, 1e-3)


@pytest.fixture(scope="module")
def crates() -> pushplan.Scenario:
    return pushplan.load_scenario("two-crates")


@pytest.fixture(scope="module")
def queries(crates: pushplan.Scenario) -> Planner:
    return Planner(crates)


def test_a_stop_keeps_to_the_path_and_the_limits_wherever_it_begins(crates: pushplan.Scenario) -> None:
    plan = plan_in(crates, seed=1, first=True)
    assert plan.trajectory is not None
    limits, dt = crates.chain.pusher.limits, 0.01
    for begin in np.linspace(0.05, 0.95, 7) * plan.trajectory.duration:
        driving = Drive(plan.trajectory, limits)
        driving.at = float(begin)
        driving.stop()
        poses, times = [plan.trajectory.poses_at([begin])[0]], [float(begin)]
        while not driving.over:
            poses.append(driving.advance(dt))
            times.append(driving.at)
        np.testing.assert_allclose(plan.trajectory.poses_at(times), poses, atol=1e-12)
        speeds = np.hypot(*np.diff(np.array(poses)[:, :2], axis=0).T) / dt
        speeds = np.append(speeds, 0.0)
        assert np.abs(np.diff(speeds)).max() / dt < 1.1 * limits.both("acceleration")[0]


def test_sliding_objects_moves_contacts_along_and_what_they_carry_too(crates: pushplan.Scenario) -> None:
    chain = slid(crates.chain, [4e-3, -2e-3])
    found = contacts_at(crates.chain, chain.places)
    np.testing.assert_allclose(found.slide, [4e-3, -2e-3], atol=1e-12)
    np.testing.assert_allclose(found.opening, 0.0, atol=1e-12)
    assert found.flush(1e-9, 1e-9)
    shift = chain.places - crates.chain.places
    np.testing.assert_allclose(shift[:, 1], [4e-3, 2e-3], atol=1e-12)
    for before, after in zip(crates.chain.contacts, chain.contacts, strict=True):
        assert after.normal == pytest.approx(before.normal)
    with pytest.raises(ChainError, match="has slid off what pushes it"):
        slid(crates.chain, [0.0, 0.5])


def test_goals_within_the_tolerances_are_within_them(crates: pushplan.Scenario) -> None:
    for goal in (
        crates.goal,
        Goal(crates.goal.pose_chain, None, crates.goal.pose_chain, 2e-3, 0.01),
    ):
        aim = Aim.of(goal, crates.chain, 5e-3, 0.02)
        assert aim.best(crates.chain) == pytest.approx([0.0, 0.0], abs=1e-12)
        poses = aim.candidates(crates.chain)
        errors = aim.errors(compose(poses[:, None], crates.chain.places))
        assert len(poses) > 10
        assert (errors <= SHARE * aim.tolerance + 1e-9).all()


def test_what_cannot_be_nearer_lies_in_the_middle(crates: pushplan.Scenario) -> None:
    everything = Goal(crates.goal.pose_chain, None, crates.goal.pose_chain, 2e-3, 0.01)
    aim = Aim.of(everything, crates.chain, 5e-3, 0.02)
    assert aim.best(slid(crates.chain, [0.0, 8e-3])) == pytest.approx([4e-3, 0.0], abs=1e-9)


def test_measurements_are_compared_with_the_plate_where_it_was_then() -> None:
    sightings, twist = Sightings(), np.array([0.2, 0.0, 0.5])
    place = np.array([[0.1, 0.02, 0.3]])
    for k in range(11):
        sightings.plate_at(0.02 * k, exp(twist * 0.02 * k))
    for time in (0.013, 0.05, 0.1):
        sightings.see(time, compose(exp(twist * time), place))
    seen = sightings.places(place, 3)
    assert seen is not None
    np.testing.assert_allclose(seen, place, atol=1e-12)
    assert sightings.places(place, 4) is None
    assert sightings.places(place, 2, since=0.06) is None
    sightings.see(0.22, compose(exp(twist * 0.22), place))  # waits for the plate
    assert sightings.places(place, 4) is None
    sightings.plate_at(0.22, exp(twist * 0.22))
    seen = sightings.places(place, 4)
    assert seen is not None
    np.testing.assert_allclose(seen, place, atol=1e-12)


def test_a_sensor_has_its_rate_delay_and_noise() -> None:
    seen = Measurements(Sensor(), seed=1)
    came = []
    for k in range(1000):
        seen.take(0.01 * k, np.zeros((2, 3)))
        found = seen.arrived(0.01 * k)
        if found is not None:
            came.append(0.01 * k - found[1])
    assert len(seen.t) == pytest.approx(300, abs=2)
    assert min(came) >= 0.1 - 1e-9
    spread = np.std(np.array(seen.poses), axis=(0, 1))
    np.testing.assert_allclose(spread, [1e-3, 1e-3, np.radians(0.3)], rtol=0.15)


def test_a_kick_leaves_no_overlap_and_moves_what_is_carried_ahead(crates: pushplan.Scenario) -> None:
    import shapely

    from pushplan.geometry.se2 import transform_points

    world = pushplan.World.from_scenario(crates)
    random = np.random.default_rng(2)
    for _ in range(20):
        way, index = random.uniform(-np.pi, np.pi), int(random.integers(2))
        kick = Kick(0.0, index, 5e-3 * np.cos(way), 5e-3 * np.sin(way), 0.05)
        poses = kicked(pushplan.SlipSimulator(world), world.start, kick)
        outlines = [transform_points(p, o.outline) for p, o in zip(poses, crates.chain.objects, strict=True)]
        outlines.append(transform_points(world.start, crates.chain.pusher.outline))
        shapes = [shapely.Polygon(outline) for outline in outlines]
        assert max(shapes[a].intersection(shapes[b]).area for a, b in ((0, 1), (0, 2), (1, 2))) < 1e-9


def test_a_push_that_closes_contacts_does_so_in_other_worlds_too(
    crates: pushplan.Scenario, queries: Planner
) -> None:
    world = pushplan.World.from_scenario(crates)
    kick = Kick(0.0, 0, 4e-3, 2e-3, 0.03)
    poses = kicked(pushplan.SlipSimulator(world), world.start, kick)
    assert contacts_at(crates.chain, relative(world.start, poses)).opening.max() > 1e-3
    push = closing_push(world, world.start, poses, queries.twists, SPREAD)
    assert isinstance(push, ClosingPush)
    assert push.length < 0.05
    for factor in (0.75, 1.0, 1.25):
        simulator = pushplan.SlipSimulator(world.with_contact_friction(factor))
        simulator.place(poses, world.start)
        simulator.move(push.twist, push.length)
        after = relative(simulator.plate_pose, simulator.object_poses)
        assert contacts_at(crates.chain, after).flush(2.0 * GAP, 2e-3)


def test_contacts_that_no_push_closes_are_said_to_be_so(crates: pushplan.Scenario, queries: Planner) -> None:
    world = pushplan.World.from_scenario(crates)
    poses = world.object_poses + np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.4]])
    why = closing_push(world, world.start, poses, queries.twists, SPREAD)
    assert why == "no push of up to 50 mm closes the contacts"


def test_the_rest_of_an_earlier_plan_is_kept_from_a_little_aside(
    crates: pushplan.Scenario, queries: Planner
) -> None:
    before = queries.plan(crates.start, crates.goal.pose_chain, timed=False).path
    assert before is not None
    start = compose(before.poses_at([0.3 * before.cost])[0], [0.0, 3e-3, 0.02])
    goal = crates.goal.pose_chain + np.array([2e-3, 1e-3, 0.0])
    after = queries.plan(start, goal, timed=False, previous=before).path
    assert after is not None
    np.testing.assert_allclose(after.end, goal, atol=1e-9)
    assert after.cost < 1.5 * 0.7 * before.cost + 0.3
    np.testing.assert_allclose(after.twists[-1], before.twists[-1], atol=1e-12)
    assert cost_rate(after.twists) == pytest.approx(1.0)


def test_trajectories_of_replans_keep_the_limits(crates: pushplan.Scenario) -> None:
    from pushplan.sim.control.replanner import Replanner

    # The way that a time limit leaves may pass obstacles closely; beside it, a chain would stand in them.
    replanner = Replanner(replace(crates, obstacles=()), ControlSettings(), Observer())
    first = replanner.first()
    assert first.path is not None
    start = compose(first.path.poses_at([0.2 * first.path.cost])[0], [0.0, 4e-3, 0.03])
    found = replanner.replan(0.0, start, first.path, np.array([6e-3, -8e-3]))
    assert found.solved
    assert found.result is not None
    assert isinstance(found.result.trajectory, Trajectory)
    assert not excess(found.result.trajectory, crates.chain.pusher.limits)
    ends = compose(found.result.segments[0].contact_trajectory.poses[-1], replanner.chain.places)
    assert replanner.aim.reached(ends)
