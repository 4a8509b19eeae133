"""A robot that follows base twists ends at the plan's end, also as a ROS 2 node."""

import runpy
from dataclasses import replace
from functools import cache
from math import radians
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from conftest import Patch, there
from ros2_stand_ins import Messages, Robot, install

import pushplan
from pushplan.geometry import se2
from pushplan.planner import plan
from pushplan.plans.plan import Plan
from pushplan.sim.follower import Command, Follower, FollowerState
from pushplan.util.arrays import FloatArray

SCENARIO = """\
format: pushplan/1
name: push
floor: {{friction: 0.30}}
objects:
  - {{name: near, shape: {{box: [0.40, 0.40]}}, mass: 4.0}}
  - {{name: far, shape: {{box: [0.40, 0.40]}}, mass: 4.0}}
contacts: {{friction: 0.5}}
pusher: {{width: 0.40, friction: 0.50, limits: {{speed: 0.4}}}}
robot: {{footprint: {{box: [0.5, 0.4], pose: [-0.3, 0, 0]}}, {robot}}}
start: [2.0, 2.0, 0.2]
goal: {{pose: [6.5, 3.0, 15 deg]}}
"""
DRIVES = {
    "differential": "drive: {differential: {axle: [-0.4, 0, 0]}}",
    "car, steered elsewhere": "drive: {car: {axle: [-0.4, 0, 0], min_radius: 0.5}}, base: [-0.1, 0.05, 3 deg]",
    "omnidirectional": "base: [-0.3, 0, 0]",
}


@cache
def pushed(drive: str) -> Plan:
    scenario = pushplan.scenario_from_text(SCENARIO.format(robot=DRIVES[drive]))
    found = plan(scenario, first=True, seed=1, time_limit=600.0)
    assert found.solved
    return found


@pytest.mark.parametrize("drive", DRIVES)
def test_twists_of_the_base_lead_to_the_goal_within_a_micrometre(drive: str) -> None:
    run = pushed(drive)
    trajectory, pusher = there(run.trajectory), run.scenario.chain.pusher
    np.testing.assert_array_equal(trajectory.base, pusher.base_pose)
    begins = np.arange(0.0, trajectory.duration, 1e-3)
    spans = np.diff(np.append(begins, trajectory.duration))
    twists = trajectory.base_twists_at(begins + 0.5 * spans)
    end = se2.chained(trajectory.base_poses[0], se2.exp(spans[:, None] * twists))[-1]
    goal = se2.compose(run.scenario.goal.pose_chain, pusher.base_pose)
    assert np.hypot(*(end - goal)[:2]) < 1e-6
    assert abs(se2.wrap_angle(end[2] - goal[2])) < 1e-6
    if drive == "differential":
        assert np.abs(trajectory.base_twists[:, 1]).max() < 1e-9


def followed(
    run: Plan, follower: Follower, start: FloatArray, slow: float = 1.0, noise: float = 0.0, seen: bool = True
) -> tuple[FloatArray, FloatArray, Command]:
    """Drive to the end; return poses of the base, distances from the planned path, and the last command."""
    rng, pose, poses = np.random.default_rng(3), start, [start]
    for _ in range(20_000):
        measured = pose + noise * rng.normal(size=3) * [1.0, 1.0, 3.0]
        command = follower.step(measured if seen else None)
        if command.state is not FollowerState.FOLLOWING:
            break
        pose = se2.compose(pose, se2.exp(0.02 * slow * command.twist))
        poses.append(pose)
    trajectory = there(run.trajectory)
    way = trajectory.base_poses_at(np.arange(0.0, trajectory.duration, 3e-3))[:, :2]
    off = np.array([np.hypot(*(way - p[:2]).T).min() for p in np.array(poses)])
    return np.array(poses), off, command


@pytest.mark.parametrize("drive", DRIVES)
def test_a_robot_at_50_hz_stays_within_a_millimetre_even_if_its_clock_is_slow(drive: str) -> None:
    """A clock that is 5 % slow makes every twist 5 % too long; the measured pose corrects it."""
    run = pushed(drive)
    trajectory = there(run.trajectory)
    follower = Follower(run)
    poses, off, command = followed(run, follower, trajectory.base_poses[0], slow=1.05)
    assert command.state is FollowerState.ARRIVED
    assert off.max() < 1e-3
    assert np.hypot(*(poses[-1] - trajectory.base_poses[-1])[:2]) < 1e-3


@pytest.mark.parametrize("drive", DRIVES)
def test_a_robot_that_starts_beside_the_path_comes_back_on_stable_twists(drive: str) -> None:
    run = pushed(drive)
    trajectory = there(run.trajectory)
    chain, stable = run.scenario.chain, run.scenario.stable_set()
    start = se2.compose(trajectory.base_poses[0], np.array([0.0, 0.01, radians(-0.5)]))
    follower = Follower(run, off=(0.03, radians(5.0)))
    poses, off, command = followed(run, follower, start, noise=2e-4)
    assert command.state is FollowerState.ARRIVED
    assert off[0] > 0.009
    assert np.median(off[-100:]) < 1e-3
    twists = se2.log(se2.relative(poses[:-1], poses[1:])) / 0.02
    of_chain = se2.twist_of(se2.inverse(trajectory.base), twists)
    moving = np.abs(of_chain).max(axis=1) > 1e-6
    assert stable.margin(of_chain[moving]).min() > 0.4 * (run.min_margin or 0.0) > 0.0
    assert chain.pusher.limits.both("angular_speed")[1] >= np.abs(of_chain[:, 2]).max()


def test_leaving_the_path_or_losing_an_object_aborts_with_a_reason() -> None:
    run = pushed("differential")
    trajectory, chain = there(run.trajectory), run.scenario.chain
    start = trajectory.base_poses[0]
    beside = se2.compose(start, np.array([0.0, 0.004, 0.0]))
    command = Follower(run, samples=1).step(beside)
    assert command.state is FollowerState.ABORTED
    assert (command.twist == 0.0).all()
    assert "the base is 4 mm and 0 deg off the path after 0.00 s; allowed: 2 mm and 0.2 deg" in command.reason
    follower = Follower(run)
    assert [follower.step(beside, elapsed=0.0).state.value for _ in range(3)] == ["following"] * 2 + ["aborted"]
    follower = Follower(run)
    objects = np.array([se2.compose(trajectory.poses[0], obj.pose_chain) for obj in chain.objects])
    assert follower.step(start, objects).state is FollowerState.FOLLOWING
    objects[1, 1] += 0.02
    for _ in range(3):
        command = follower.step(start, objects, elapsed=0.0)
    assert "'far' is 20 mm and 0 deg away from its pose in the chain" in command.reason
    assert "in 3 successive measurements; allowed: 5 mm and 2 deg" in command.reason
    assert follower.step(start).state is FollowerState.ABORTED
    follower = Follower(run)
    follower.abort("operator")
    assert follower.step().reason == "operator"
    with pytest.raises(pushplan.PushplanError, match="samples is 0; allowed: a whole number from 1"):
        Follower(run, samples=0)


@pytest.mark.parametrize("drive", DRIVES)
def test_wrong_measurements_neither_abort_a_plan_nor_divert_the_robot(drive: str) -> None:
    """Every half second two poses of the base are 5 cm off in a random direction."""
    run, rng = pushed(drive), np.random.default_rng(5)
    follower, trajectory = Follower(run), there(run.trajectory)
    pose, right = trajectory.base_poses[0], [trajectory.base_poses[0]]
    for k in range(20_000):
        way = rng.uniform(-np.pi, np.pi)
        wrong = np.array([0.05 * np.cos(way), 0.05 * np.sin(way), 0.0]) * (k % 25 in (7, 8))
        command = follower.step(pose + wrong)
        if command.state is not FollowerState.FOLLOWING:
            break
        pose = se2.compose(pose, se2.exp(0.02 * command.twist))
        right.append(pose)
    assert command.state is FollowerState.ARRIVED, command.reason
    way_points = trajectory.base_poses_at(np.arange(0.0, trajectory.duration, 3e-3))[:, :2]
    assert max(np.hypot(*(way_points - p[:2]).T).min() for p in right) < 1e-3


NODE = Path(__file__).parents[1] / "examples" / "ros2" / "follower_node.py"


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("node") / "run.mcap"
    pushplan.run(pushplan.load_scenario("carts"), log=file, first=True, seed=1, time_limit=600.0)
    return file


def driven(robot: Robot, messages: Messages, told: SimpleNamespace) -> list[FloatArray]:
    poses = []
    for _ in range(10_000):
        told.step()
        if not told.running:
            break
        (twist,) = [message.twist for message in messages.published["cmd_vel"][-1:]]
        step = np.array([twist.linear.x, twist.linear.y, twist.angular.z]) * told.period
        robot.pose = se2.compose(robot.pose, se2.exp(step))
        poses.append(robot.pose)
    return poses


def test_the_node_drives_to_the_goal_with_messages_of_ros_2(log: Path, monkeypatch: Patch) -> None:
    plan = there(pushplan.load_run(log).plan)
    trajectory = there(plan.trajectory)
    messages, robot = Messages(), Robot(trajectory.base_poses[0])
    told = install(monkeypatch, messages, robot)
    node = runpy.run_path(str(NODE))["PushFollower"](str(log))
    driven(robot, messages, told)
    assert told.lines == ["arrived "]
    assert np.hypot(*(robot.pose - trajectory.base_poses[-1])[:2]) < 1e-3
    twists = messages.sent("cmd_vel")
    assert {message.header.frame_id for message in twists} == {"base_link"}
    assert max(abs(message.twist.linear.y) for message in twists) < 1e-12  # the truck has two driven wheels
    assert (twists[-1].twist.linear.x, twists[-1].twist.angular.z) == (0.0, 0.0)
    (way,) = messages.sent("push_path")
    assert (way.header.frame_id, way.poses[0].header.stamp.sec) == ("map", 7)
    end = way.poses[-1].pose.position
    np.testing.assert_allclose([end.x, end.y], trajectory.base_poses[-1, :2])
    (footprint,) = messages.sent("footprint")
    corners = np.array([[p.x, p.y] for p in footprint.polygon.points])
    np.testing.assert_allclose(corners, node.follower.footprint, atol=1e-6)  # 32 bits


def test_a_run_without_a_timed_plan_cannot_be_followed() -> None:
    scenario = pushed("omnidirectional").scenario
    runs: list[Any] = [replace(pushed("omnidirectional"), segments=()), SimpleNamespace(plan=None, scenario=scenario)]
    for run in runs:
        with pytest.raises(pushplan.PushplanError, match="push: there is no plan to follow"):
            Follower(run)
