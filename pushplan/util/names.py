"""The words and numbers that several parts of the package have to agree on."""

from __future__ import annotations

from typing import Final

SCENARIO_FORMAT = "pushplan/1"
"""What `format` says in a scenario file."""

LOG_MAGIC = b"\x89MCAP0\r\n"
"""What a run log begins and ends with."""

PLANNERS = ("rrt", "est", "kpiece", "lattice", "bottlenecks", "auto")
"""Planners that `planner.name` may choose."""

DEFAULT_PLANNER = "auto"

GONE_PLANNERS: Final = {
    "rrt-dubins": ("in the benchmarks now", "auto, or the benchmarks' dubins_planners:RRTOverDubins"),
    "bitstar-dubins": ("in the benchmarks now", "auto, or the benchmarks' dubins_planners:BITStarOverDubins"),
    "sst": ("gone", "auto, which finds better paths sooner, or OMPL's rrt"),
}
"""Planners that `planner.name` could choose once: what has become of them, and what to use."""

SIMULATORS = ("slip",)
STABLE_SETS = ("ecof", "cof", "translation", "stable", "robust")
"""Stable sets that `stability.set` may choose."""

DEFAULT_STABLE_SET = "ecof"

KNOWN_LOAD_SETS = ("ecof", "cof", "translation")
"""Stable sets that need to know how every object's load rests on the floor."""

COSTS = ("travel", "time", "margin")
"""What `planner.cost` may choose to rank paths by."""

DEFAULT_COST = "time"

BESIDE_A_BAG = ".rviz"
"""Suffixes of the files that are written beside a ROS 2 bag, in place of its own."""

FARTHEST = 1e4
"""Coordinates (m) and angles (rad) beyond this are none of a robot on a floor."""

AUTO: Final = "auto"
"""Stands for a margin that planning chooses."""

TRAJECTORIES = ("exact", "blended")
"""Ways of timing a path: with a stop at every corner, or with the corners blended."""

DEFAULT_TRAJECTORY = "blended"

CONTACT_LIMITS = ("quasi-static", "dynamic")
"""What `pusher.limits.contact` may choose: inertia left out, or speed and acceleration kept low enough for it."""

DEFAULT_CONTACT_LIMITS = "dynamic"

PUSHER, ROBOT = "pusher", "robot"
"""What the plate, and the robot that carries it, are called in results, logs and messages."""

RESERVED_NAMES = ("world", "chain", PUSHER)
"""Frames of a run log; no object may be called so."""

TRANSIT, APPROACH, PUSH, CLOSE, RETREAT = SEGMENT_KINDS = ("transit", "approach", "push", "close", "retreat")
"""Parts of a plan of several pushes: the robot drives alone, comes up to a face, pushes, backs off.

A close is a straight push whose load comes to touch an object that stands: that one is pushed along afterwards, or
stays with the load where a row is made.
"""

WALLS = ("xmin", "xmax", "ymin", "ymax", "any")
"""Sides of the workspace that a row's front may be brought to."""

GATHER = ("auto", "never", "always")
"""Whether objects of a row are pushed together: where that costs less, one by one, or all of them at once."""

RANKED_BY = "travel"
"""The cost, of `COSTS`, that ranks plans of several pushes, with the weights in `pushes`."""

FACES = ("rear", "front", "left", "right")
"""Faces of an object whose outward normal is along an axis of the chain frame: -x, +x, +y and -y."""

COLLISION_CLEARANCE = 0.0005
"""Distance that pusher and objects keep from obstacles and walls where the scenario asks for no other, m."""

TRANSIT_CLEARANCE = 0.01
"""Distance that a robot keeps from the load, at least, while it drives alone, m: one that stands 2 mm and half a
degree away from its pose is not touched."""

MOST_FRICTION = 10.0
"""Largest coefficient of friction of a scenario; rubber on rubber has 1 to 2, a larger number is a slip."""

CLEARANCE_ROOM = 1e-5
"""Part of the clearance that a motion may use up whose start or goal is no farther from something, m."""
