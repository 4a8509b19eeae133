"""Control planning as OMPL's documentation shows it from Python: what `planning.py` compares with.

OMPL's stock planners over SE(2) with a propagator in Python in small steps, collisions by shapely at each step, and a
goal with a tolerance. The controls are limited to the stable set here too; nothing else is ours. `python
benchmarks/plain_ompl.py SCENARIO [PLANNER [SECONDS]]` runs one of them alone.
"""

from __future__ import annotations

import argparse
import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from ompl import base as ob
from ompl import control as oc
from ompl import util as ou

from pushplan.geometry import se2
from pushplan.planners.ompl.form import bounds, state_at
from pushplan.planners.problem.controls import MARGIN_FLOOR, control_segments, margins_to_try
from pushplan.planners.problem.problem import sampling_box
from pushplan.plans.path import cost_rate
from pushplan.scenario.file import load_scenario
from pushplan.scenario.model import CircleObstacle, Scenario
from pushplan.util.arrays import FloatArray

STEP = 0.05
"""Step of the propagator, m of cost."""

LONGEST = 20
"""Steps with the same control, at most."""

TOLERANCE = 0.02
"""Distance to the goal, m; SE(2)'s distance counts half a radian as a metre, so this is 2 cm or 2.3 deg."""

PLANNERS = {"plain-rrt": oc.RRT, "plain-est": oc.EST, "plain-kpiece": oc.KPIECE1}


@dataclass(frozen=True)
class PlainResult:
    """What a plain planner did.

    Attributes:
        solved: Whether it reached the goal within the tolerance.
        seconds: Until it stopped.
        cost: Of the path, m; infinite without one.
        steps: Of the propagator.
    """

    solved: bool
    seconds: float
    cost: float
    steps: int


def solve(scenario: Scenario, name: str, seconds: float, seed: int) -> PlainResult:
    """Run a stock planner, which stops at its first path."""
    ou.setLogLevel(ou.LOG_NONE)
    ou.RNG.setSeed(seed)
    stable = scenario.stable_set()
    scenario = scenario.with_margin(margins_to_try(scenario, stable)[0])
    segments = control_segments(stable, scenario.chain.pusher.drive, scenario.required_margin + MARGIN_FLOOR)
    information, counter = _information(scenario, segments)
    definition = ob.ProblemDefinition(information)
    ends = (state_at(information, pose) for pose in (scenario.start, scenario.goal.pose_chain))
    definition.setStartAndGoalStates(*ends, TOLERANCE)
    planner = PLANNERS[name](information)
    planner.setProblemDefinition(definition)
    planner.setup()
    began = time.perf_counter()
    planner.solve(ob.timedPlannerTerminationCondition(seconds))
    spent, solved = time.perf_counter() - began, definition.hasExactSolution()
    cost = _cost(definition.getSolutionPath()) if solved else math.inf
    return PlainResult(solved, spent, cost, counter[0])


def _information(scenario: Scenario, segments: FloatArray) -> tuple[Any, list[int]]:
    """OMPL's space information, and a list whose only entry counts the propagator's steps."""
    box = sampling_box(scenario)
    space = ob.SE2StateSpace()
    space.setBounds(bounds([(box[0], box[2]), (box[1], box[3])]))
    controls = oc.RealVectorControlSpace(space, 2)
    controls.setBounds(bounds([(0.0, 1.0)] * 2))
    information, counter = oc.SpaceInformation(space, controls), [0]
    information.setStatePropagator(_propagator(segments, counter))
    information.setStateValidityChecker(_validity(scenario, box))
    information.setPropagationStepSize(STEP)
    information.setMinMaxControlDuration(1, LONGEST)
    information.setup()
    return information, counter


def _twist(segments: FloatArray, first: float, second: float) -> FloatArray:
    segment = segments[min(int(first * len(segments)), len(segments) - 1)]
    twist = (1.0 - second) * segment[:3] + second * segment[3:]
    return np.asarray(twist / cost_rate(twist[None])[0])


def _propagator(segments: FloatArray, counter: list[int]) -> Any:
    def propagate(state: Any, control: Any, duration: float, result: Any) -> None:
        counter[0] += 1
        pose = np.array([state.getX(), state.getY(), state.getYaw()])
        x, y, theta = se2.compose(pose, se2.exp(_twist(segments, control[0], control[1]) * duration))
        result.setX(float(x))
        result.setY(float(y))
        result.setYaw(float(se2.wrap_angle(theta)))

    return propagate


def _validity(scenario: Scenario, box: tuple[float, float, float, float]) -> Any:
    body = shapely.union_all([shapely.Polygon(moving.outline) for moving in scenario.chain.bodies])
    shapes = [
        shapely.Point(o.center).buffer(o.radius)
        if isinstance(o, CircleObstacle)
        else shapely.Polygon(o.outline)
        for o in scenario.obstacles
    ]
    standing, room = shapely.union_all(shapes), shapely.box(*box)
    shapely.prepare(standing)
    shapely.prepare(room)

    def valid(state: Any) -> bool:
        c, s = math.cos(state.getYaw()), math.sin(state.getYaw())
        moved = shapely.affinity.affine_transform(body, [c, -s, s, c, state.getX(), state.getY()])
        return bool(room.contains(moved)) and not standing.intersects(moved)

    return valid


def _cost(path: Any) -> float:
    """Cost of a path, m: the controls are scaled to a cost rate of 1, so it is the sum of their durations."""
    return float(sum(path.getControlDuration(i) for i in range(path.getControlCount())))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenario")
    parser.add_argument("planner", nargs="?", choices=PLANNERS, default="plain-rrt")
    parser.add_argument("seconds", nargs="?", type=float, default=10.0)
    arguments = parser.parse_args()
    print(solve(load_scenario(arguments.scenario), arguments.planner, arguments.seconds, 1))


if __name__ == "__main__":
    main()
