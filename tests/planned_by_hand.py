"""Plans made by hand, with executions: what pictures and windows show is known without a search."""

from dataclasses import replace
from functools import cache

import numpy as np

import pushplan
from pushplan.geometry import se2
from pushplan.mechanics.faces import pushed_at
from pushplan.plans.events import Event, Feedback, Measured
from pushplan.plans.execution import Execution
from pushplan.plans.load import Load
from pushplan.plans.path import PushPath, cost_rate
from pushplan.plans.plan import Diagnosis, Nearest, Plan
from pushplan.plans.run import Run
from pushplan.plans.segment import Segment
from pushplan.scenario.file import load_scenario, scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray

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
KINDS = ("push", "multi-push", "rearrangement", "gathering", "closed loop", "unsolved", "not executed")
EVENTS = (
    Event(0.0, "plan", "1.300 m in 6.5 s"),
    Event(2.0, "disturbance", "far was displaced by 5.0 mm and 3 deg"),
    Event(2.2, "deviation", "far is 5.1 mm and 2.9 deg away from its pose in the plan"),
    Event(4.5, "replan", "0.700 m in 3.5 s"),
)

Arcs = tuple[tuple[tuple[float, float, float], float], ...]
"""Twists, and how long each is kept, m of path cost."""

SPEED = 0.2
"""Path cost in each second, m/s."""


@cache
def made(kind: str) -> Run:
    """Return a run of one of the kinds."""
    arcs = (((1.0, 0.0, 0.0), 0.4), ((1.0, -0.05, 1.0), 0.6), ((1.0, 0.0, 0.0), 0.3))
    if kind == "multi-push":
        plan = pushes(scenario_from_text(MULTI), (("box", "rear", 0.5), ("box", "right", 0.4)))
    elif kind == "rearrangement":
        turns = (("red-box", "rear", 0.8), ("other", "rear", 0.3), ("red-box", "left", 0.4))
        plan = pushes(scenario_from_text(SWAP), turns)
    elif kind == "gathering":
        plan = pushplan.plan(scenario_from_text(ROW), first=True, time_limit=60.0)
    elif kind == "unsolved":
        plan = unsolved()
    else:
        plan = one_push(load_scenario("two-crates"), arcs)
    if kind == "not executed":
        plan = replace(plan, execution=None)
    names = len(plan.scenario.poses)
    feedback = Feedback(Measured(np.zeros(0), np.zeros((0, names, 3))), EVENTS, ())
    return Run(plan.scenario, plan, plan.execution, feedback=feedback if kind == "closed loop" else None)


def unsolved() -> Plan:
    """Return a plan that is none, with all that a search leaves."""
    plan = one_push(scenario_from_text(WALL), (((1.0, 0.0, 0.0), 0.4),))
    reason = "obstacles and walls separate the start from the goal: no passage joins them"
    return replace(
        plan,
        segments=(),
        execution=None,
        reason=reason,
        tree=np.random.default_rng(0).uniform(0.0, 0.7, (50, 2, 3)),
        diagnosis=(Diagnosis("gap", reason, True, blocking=(0,)),),
        nearest=Nearest(plan.segments, (1.2, 0.1)),
    )


def path_of(start: FloatArray, arcs: Arcs) -> PushPath:
    """Return the path of arcs from a pose (3,)."""
    twists = np.array([twist for twist, _ in arcs])
    return PushPath(start, twists / cost_rate(twists)[:, None], np.array([length for _, length in arcs]))


def one_push(scenario: Scenario, arcs: Arcs) -> Plan:
    """Return a plan that pushes the chain of a scenario along arcs."""
    path = path_of(scenario.start, arcs)
    return _plan(scenario, (Segment.push(Load.of(scenario), path, scenario.poses, 0.05),))


def pushes(scenario: Scenario, turns: tuple[tuple[str, str, float], ...]) -> Plan:
    """Return a plan that drives to objects by name and pushes each at a face straight on, m."""
    now, plate = dict(scenario.poses), scenario.plate_start
    segments: list[Segment] = []
    for name, face, length in turns:
        problem = scenario.alone(name) if scenario.bodies else scenario
        load = Load.of(replace(problem, chain=pushed_at(problem.chain, face)))
        begin = se2.compose(now[name], se2.inverse(load.places_plate[0]))
        segments.append(Segment("transit", _drive(plate, begin), now, now))
        path = path_of(se2.compose(begin, load.frame_plate), (((1.0, 0.0, 0.0), length),))
        push = Segment.push(load, path, now, 0.05)
        back = Segment(
            "retreat", path_of(push.path.end, (((-1.0, 0.0, 0.0), 0.1),)), push.after, push.after, load
        )
        segments += [push, back]
        now, plate = dict(push.after), back.path.end
    return _plan(scenario, tuple(segments))


def _plan(scenario: Scenario, segments: tuple[Segment, ...]) -> Plan:
    cost = sum(segment.cost for segment in segments)
    plan = Plan(scenario, segments, "", "auto", "ecof", 1, cost=cost, margin=0.05, margin_asked=0.05)
    return replace(plan, execution=executed(scenario, segments))


def executed(scenario: Scenario, segments: tuple[Segment, ...]) -> Execution:
    """Return an execution at an even speed whose margins fall from 0.3 to 0.01 along each push."""
    now, clock = dict(scenario.poses), 0.0
    names = tuple(now)
    parts: list[tuple[FloatArray, ...]] = []
    for k, segment in enumerate(segments):
        s = np.linspace(0.0, segment.path.cost, max(2, int(segment.path.cost / 0.004)))
        poses = segment.path.poses_at(s)
        objects = np.stack([np.broadcast_to(now[name], (len(s), 3)) for name in names], axis=1)
        margins = np.full((len(s), len(names)), np.nan)
        for name in segment.load.names if segment.pushes and segment.load is not None else ():
            j = names.index(name)
            objects[:, j] = se2.compose(poses, se2.relative(poses[0], now[name]))
            margins[:, j], now[name] = np.linspace(0.3, 0.01, len(s)), objects[-1, j]
        parts.append((clock + s / SPEED, poses, objects, np.full(len(s), k), margins))
        clock += segment.path.cost / SPEED
    t, poses, objects, owner, margins = (np.concatenate(column) for column in zip(*parts, strict=True))
    twists = np.zeros_like(poses)
    return Execution(names, "ecof", t, poses, twists, objects, owner.astype(int), margins, None, (0.0, 0.0))


def _drive(start: FloatArray, end: FloatArray) -> PushPath:
    """Return a turn on the spot and a straight drive from one pose (3,) of the plate to another."""
    turn = float(se2.wrap_angle(end[2] - start[2]))
    turned = np.array([start[0], start[1], start[2] + turn])
    x, y = se2.rotate(-turned[2], end[:2] - start[:2])
    spot: Arcs = (((0.0, 0.0, 1.0 if turn > 0.0 else -1.0), 0.1 * abs(turn)),)
    return path_of(start, (*spot, ((float(x), float(y), 0.0), float(np.hypot(x, y)))))
