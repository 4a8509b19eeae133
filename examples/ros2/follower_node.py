"""A ROS 2 node that drives a recorded push: `python examples/ros2/follower_node.py run.mcap`.

It takes the pose of `base_link` in `map` from tf and publishes `cmd_vel` at 50 Hz, the way of the base as
`push_path`, and the outline of robot and load as `footprint`, which Nav2's costmaps take where
`subscribe_to_stamped_footprint` is set.
The robot's odometry, or what localises it, has to tell tf where it is.

It was never tried on a live graph: the tests run it against stand-ins for rclpy, and hold its messages against the
definitions of ROS 2 Humble.
"""

from __future__ import annotations

import math
import sys

import rclpy
from geometry_msgs.msg import Point32, PolygonStamped, PoseStamped, TwistStamped
from nav_msgs.msg import Path
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.time import Time
from tf2_ros import Buffer, TransformException, TransformListener

import pushplan
from pushplan.sim.follower import FollowerState

PERIOD = 0.02
"""Of the loop, s."""


class PushFollower(Node):
    """Drives the plan of a run."""

    def __init__(self, log: str) -> None:
        super().__init__("push_follower")
        self.follower = pushplan.Follower(pushplan.load_run(log), period=PERIOD)
        self.tf = Buffer()
        self.listener = TransformListener(self.tf, self)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.cmd_vel = self.create_publisher(TwistStamped, "cmd_vel", 10)
        self.footprint = self.create_publisher(PolygonStamped, "footprint", latched)
        self.path = self.create_publisher(Path, "push_path", latched)
        self.path.publish(self.way())
        self.footprint.publish(self.outline())
        self.timer = self.create_timer(PERIOD, self.step)

    def step(self) -> None:
        """Send the twist of the next period; without a pose from tf the robot stands still."""
        try:
            found = self.tf.lookup_transform("map", "base_link", Time()).transform
        except TransformException as error:
            self.cmd_vel.publish(self.stamped(TwistStamped(), "base_link"))
            self.get_logger().warning(f"where the robot is, is not known: {error}", throttle_duration_sec=1.0)
            return
        heading = 2.0 * math.atan2(found.rotation.z, found.rotation.w)
        command = self.follower.step([found.translation.x, found.translation.y, heading])
        message = self.stamped(TwistStamped(), "base_link")
        message.twist.linear.x, message.twist.linear.y, message.twist.angular.z = map(float, command.twist)
        self.cmd_vel.publish(message)
        if command.state is not FollowerState.FOLLOWING:
            self.get_logger().info(f"{command.state.value} {command.reason}")
            self.timer.cancel()

    def way(self) -> Path:
        """Return the way of the robot's base, every 0.1 s."""
        path = self.stamped(Path(), "map")
        for x, y, theta in self.follower.trajectory.sample(10.0).base_poses.tolist():
            pose = self.stamped(PoseStamped(), "map")
            pose.pose.position.x, pose.pose.position.y = x, y
            pose.pose.orientation.z, pose.pose.orientation.w = math.sin(0.5 * theta), math.cos(0.5 * theta)
            path.poses.append(pose)
        return path

    def outline(self) -> PolygonStamped:
        """Return robot and load as one polygon in the robot's frame."""
        message = self.stamped(PolygonStamped(), "base_link")
        message.polygon.points = [Point32(x=x, y=y) for x, y in self.follower.footprint.tolist()]
        return message

    def stamped(self, message, frame):  # type: ignore[no-untyped-def]
        """Return a message with the time of now and its frame."""
        message.header.stamp = self.get_clock().now().to_msg()
        message.header.frame_id = frame
        return message


def main() -> None:
    """Drive the run that the command line names until the program is stopped."""
    rclpy.init()
    rclpy.spin(PushFollower(sys.argv[1]))


if __name__ == "__main__":
    main()
