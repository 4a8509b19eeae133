"""Names and numbers that several parts of the package share."""

from __future__ import annotations

from typing import Final

SCENARIO_FORMAT = "pushplan/1"
"""Value of `format` in a scenario file."""

LOG_MAGIC = b"\x89MCAP0\r\n"
"""First and last bytes of a run log."""

PLANNERS = ("rrt", "est", "kpiece", "lattice", "bottlenecks", "auto")
"""Allowed values of `planner.name`."""

DEFAULT_PLANNER = "auto"

GONE_PLANNERS: Final = {
    "rrt-dubins": ("now in the benchmarks", "auto, or the benchmarks' dubins_planners:RRTOverDubins"),
    "bitstar-dubins": ("now in the benchmarks", "auto, or the benchmarks' dubins_planners:BITStarOverDubins"),
    "sst": ("removed", "auto, which finds better paths sooner, or OMPL's rrt"),
}
"""Former values of `planner.name`: what happened to each planner, and its replacement."""

SIMULATORS = ("slip",)
STABLE_SETS = ("ecof", "cof", "translation", "stable", "robust")
"""Allowed values of `stability.set`."""

DEFAULT_STABLE_SET = "ecof"

KNOWN_LOAD_SETS = ("ecof", "cof", "translation")
"""Stable sets that need the load distribution of every object."""

COSTS = ("travel", "time", "margin")
"""Allowed values of `planner.cost`, the objective that ranks paths."""

DEFAULT_COST = "time"

BESIDE_A_BAG = ".rviz"
"""Suffix of the file beside a ROS 2 bag; it replaces the suffix of the bag."""

FARTHEST = 1e4
"""Largest plausible coordinate (m) and angle (rad) of a robot on a floor."""

AUTO: Final = "auto"
"""Value of a margin that the planner chooses."""

TRAJECTORIES = ("exact", "blended")
"""Kinds of timing of a path: with a stop at every corner, or with blended corners."""

DEFAULT_TRAJECTORY = "blended"

CONTACT_LIMITS = ("quasi-static", "dynamic")
"""Allowed values of `pusher.limits.contact`: without inertia, or with speed and acceleration limited by it."""

DEFAULT_CONTACT_LIMITS = "dynamic"

PUSHER, ROBOT = "pusher", "robot"
"""Names of the plate and of the robot in results, logs and messages."""

RESERVED_NAMES = ("world", "chain", PUSHER)
"""Frames of a run log, which are not allowed as names of objects."""

TRANSIT, APPROACH, PUSH, CLOSE, RETREAT = SEGMENT_KINDS = ("transit", "approach", "push", "close", "retreat")
"""Kinds of segments of a multi-push plan: the robot drives alone, approaches a face, pushes and retreats.

A close is a straight push until the load touches another object. This object is then pushed along, or both stand in
a row.
"""

WALLS = ("xmin", "xmax", "ymin", "ymax", "any")
"""Allowed values of a row's `wall`: sides of the workspace for the row's front."""

GATHER = ("auto", "never", "always")
"""Whether objects of a row are pushed together: if it costs less, never (one by one), or always all at once."""

RANKED_BY = "travel"
"""Cost, from `COSTS`, that ranks multi-push plans, with the weights in `pushes`."""

FACES = ("rear", "front", "left", "right")
"""Faces of an object with an outward normal along an axis of the chain frame: -x, +x, +y and -y."""

COLLISION_CLEARANCE = 0.0005
"""Default distance of robot and objects from obstacles and walls, m."""

TRANSIT_CLEARANCE = 0.01
"""Smallest distance of a robot in transit from the load, m. It covers pose errors of the load of 2 mm and 0.5 deg."""

MOST_FRICTION = 10.0
"""Largest allowed friction coefficient; rubber on rubber has 1 to 2, so larger numbers are typing errors."""

CLEARANCE_ROOM = 1e-5
"""Part of the clearance that a motion can use if its start or goal is exactly at the clearance, m."""
