"""Scenarios of every kind, and their runs, for pictures and windows."""

import re
from dataclasses import replace
from functools import cache

import numpy as np

import pushplan
from pushplan.plans.plan import Nearest
from pushplan.plans.run import Event, Feedback, Measured, Run
from pushplan.scenario.file import example_text, load_scenario, scenario_from_text

SWAP = """\
format: pushplan/1
name: change-places
floor: {friction: 0.30}
objects:
  - {name: red-box, shape: {box: [0.30, 0.20]}, mass: 4.0, pose: [1.2, 1.0, 0.0]}
  - {name: other, shape: {box: [0.20, 0.20]}, mass: 3.0, pose: [1.2, 2.2, 90 deg]}
  - {name: bin, shape: {box: [0.15, 0.15]}, mass: 1.0, pose: [3.0, 3.0, 0.0]}
pusher: {width: 0.28, friction: 0.50}
robot: {footprint: {box: [0.42, 0.285], pose: [-0.225, 0, 0]}, start: [2.4, 1.6, 0.0]}
goals: {red-box: {pose: [2.2, 2.2, 0.0], symmetry: 2}, other: [2.2, 1.0, 90 deg]}
workspace: {x: [0.0, 3.6], y: [0.0, 3.6]}
"""
ROW = """\
format: pushplan/1
name: in-a-row
floor: {friction: 0.30}
objects:
  - {name: red-box, shape: {box: [0.15, 0.20]}, mass: 1.0, pose: [1.0, 1.0, 0.0]}
  - {name: other, shape: {box: [0.20, 0.20]}, mass: 1.2, pose: [1.8, 1.2, 20 deg]}
contacts: {friction: 0.50}
pusher: {width: 0.28, friction: 0.50}
robot: {footprint: {box: [0.42, 0.285], pose: [-0.225, 0, 0]}, start: [0.5, 0.5, 0.0]}
goals: {row: {of: [red-box, other], pose: [2.4, 1.6, 0.0]}}
gather: always
workspace: {x: [0.0, 3.6], y: [0.0, 3.6]}
"""

MULTI = """\
format: pushplan/1
name: box
floor: {friction: 0.3}
objects: [{name: box, shape: {box: [0.2, 0.2]}, mass: 1.0}]
pusher: {width: 0.2, friction: 0.5}
robot: {start: [-0.5, 0.0, 0.0]}
start: [0.0, 0.0, 0.0]
goal: {pose: [0.6, 0.4, 0.0], of: box}
workspace: {x: [-3.0, 6.0], y: [-3.0, 3.0]}
"""

WALL = """\
format: pushplan/1
name: walled-in
floor: {friction: 0.3}
objects: [{name: blue-box, shape: {box: [0.2, 0.2]}, mass: 1.0}]
pusher: {width: 0.2, friction: 0.5}
start: [0.0, 0.0, 0.0]
goal: {pose: [1.6, 0.4, 0.0], of: blue-box}
workspace: {x: [-0.5, 2.0], y: [-1.0, 1.0]}
obstacles:
  - {polygon: [[0.8, -1.0], [0.9, -1.0], [0.9, 1.0], [0.8, 1.0]]}
  - {circle: 0.1, center: [0.3, 0.6]}
"""
GAP = WALL.replace("0.9, 1.0], [0.8, 1.0]", "0.9, -0.11], [0.8, -0.11]").replace(
    "  - {circle: 0.1, center: [0.3, 0.6]}", "  - {polygon: [[0.8, 0.11], [0.9, 0.11], [0.9, 1.0], [0.8, 1.0]]}"
)
"""A wall with a gap that leaves the plate 10 mm on either side."""

_FAST = r"\1, limits: {speed: 0.5, acceleration: 1.5, jerk: 30, angular_speed: 2}}"
FAST = {
    kind: re.sub(r"(pusher: {.*)}", _FAST, text)
    for kind, text in (("multi-push", MULTI), ("rearrangement", SWAP), ("gathering", ROW))
}
_STUCK = "{name: stuck, shape: {box: [0.2, 0.2]}, mass: 2.0, pose: [0.115, 3.485, 0.0]}"
FAST["partial"] = (
    FAST["rearrangement"]
    .replace("change-places", "one-is-stuck")
    .replace("pose: [3.0, 3.0, 0.0]}\n", f"pose: [3.0, 3.0, 0.0]}}\n  - {_STUCK}\n")
    .replace("other: [2.2, 1.0, 90 deg]", "other: [2.2, 1.0, 90 deg], stuck: [2.9, 0.6, 0.0]")
)
FAST["block"] = re.sub(
    r"(pusher: {.*)}",
    _FAST,
    """\
format: pushplan/1
name: block
floor: {friction: 0.3}
objects:
  - {name: near-right, shape: {box: [0.12, 0.15]}, mass: 1.4, pose: [0.06, 0.0, 0.0], offset: -0.075}
  - {name: far-right, shape: {box: [0.16, 0.15]}, mass: 0.8, pose: [0.20, 0.0, 0.0]}
  - {name: near-left, shape: {box: [0.20, 0.15]}, mass: 1.0, pose: [0.10, 0.15, 0.0]}
contacts: {friction: 0.5}
pusher: {width: 0.36, friction: 0.5}
start: [0.0, 0.0, 0.0]
goal: {pose: [1.0, 0.3, 0.3], of: near-left}
workspace: {x: [-1.0, 2.0], y: [-1.0, 1.5]}
obstacles: [{circle: 0.1, center: [0.8, -0.5]}]
""",
)
"""Two columns of boxes side by side, of unequal lengths."""
FAST["push"] = example_text("two-crates").replace("speed: 0.2,", "speed: 0.5,")
"""Scenarios with a faster robot, which shortens simulation and logs."""

KINDS = ("push", "multi-push", "rearrangement", "gathering", "closed loop", "unsolved", "not executed")
EVENTS = (
    Event(0.0, "plan", "1.300 m in 6.5 s"),
    Event(2.0, "disturbance", "far was displaced by 5.0 mm and 3 deg"),
    Event(2.2, "deviation", "far is 5.1 mm and 2.9 deg away from its pose in the plan"),
    Event(4.5, "replan", "0.700 m in 3.5 s"),
)


@cache
def made(kind: str) -> Run:
    """Return a run of one of the kinds, with the first plan."""
    text = {"multi-push": MULTI, "rearrangement": SWAP, "gathering": ROW, "unsolved": WALL}.get(kind)
    scenario = load_scenario("two-crates") if text is None else scenario_from_text(text)
    plan = pushplan.plan(scenario, first=True, seed=1, time_limit=60.0)
    assert plan.solved == (kind != "unsolved"), plan.reason
    if kind == "unsolved":  # with all results of a search
        free = replace(scenario, obstacles=scenario.obstacles[1:])
        nearest = Nearest(pushplan.plan(free, first=True, seed=1, time_limit=60.0).segments, (1.2, 0.1))
        plan = replace(plan, nearest=nearest, tree=np.random.default_rng(0).uniform(0.0, 0.7, (50, 2, 3)))
    if kind == "not executed":
        plan = replace(plan, execution=None)
    feedback = Feedback(Measured(np.zeros(0), np.zeros((0, len(scenario.poses), 3))), EVENTS, ())
    return Run(scenario, plan, plan.execution, feedback=feedback if kind == "closed loop" else None)
