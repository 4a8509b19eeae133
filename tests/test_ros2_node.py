"""The ROS 2 node of the examples drives a robot to the goal, and its messages are those of ROS 2."""

import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from ros2_stand_ins import Messages, Robot, install

import pushplan
from pushplan.geometry import se2
from pushplan.util.arrays import FloatArray

NODE = Path(__file__).parents[1] / "examples" / "ros2" / "follower_node.py"


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("node") / "run.mcap"
    pushplan.run(pushplan.load_scenario("carts"), log=file, first=True, seed=1)
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


def test_the_node_drives_to_the_goal_with_messages_of_ros_2(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = pushplan.read_run(log).plan
    assert plan is not None
    trajectory = plan.trajectory
    assert trajectory is not None
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
