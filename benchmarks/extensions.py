"""Extensions per second of the planners on the cluttered example, kernels warm.

Run `python benchmarks/extensions.py [--seconds 2]`. An extension is one arc, propagated and swept for collisions,
with an exact connection to the goal tried from its end. `plain Python` is control planning as OMPL's documentation
shows it: a Python propagator in small steps and shapely for the collisions.
"""

from __future__ import annotations

import argparse
import math
import platform
import time

import numpy as np
import shapely
from ompl import base as ob
from ompl import control as oc
from ompl import util as ou

from pushplan.geometry import se2
from pushplan.kernels import warm_up
from pushplan.planners.problem import body_reach, build_problem, sampling_box
from pushplan.planners.registry import MODULES, planner_named
from pushplan.planners.scene import chain_outlines
from pushplan.planners.session import Budget, Session
from pushplan.reading.scenario_file import load_scenario
from pushplan.scenario import PolygonObstacle, Scenario
from pushplan.stable_sets.named import stable_set

STEP = 0.05
"""Step of the plain Python propagator, m of cost."""


def ours(scenario: Scenario, name: str, seconds: float) -> tuple[float, float]:
    warm_up(name)
    problem = build_problem(scenario, stable_set(scenario.chain))
    session = Session(problem, scenario.start, Budget(seconds, stall=10**9), seed=1)
    planner_named(name)(session, sampling_box(scenario), body_reach(scenario))
    return session.extensions / session.elapsed, session.best_cost


def plain(scenario: Scenario, seconds: float) -> float:
    """OMPL's RRT with a Python propagator and shapely, as its documentation shows control planning."""
    ou.setLogLevel(ou.LOG_NONE)
    segments = build_problem(scenario, stable_set(scenario.chain)).segments
    body = shapely.union_all([shapely.Polygon(outline) for outline in chain_outlines(scenario.chain)])
    walls = sampling_box(scenario)
    standing = shapely.union_all(
        [shapely.Polygon(o.outline) for o in scenario.obstacles if isinstance(o, PolygonObstacle)]
    )
    shapely.prepare(standing)
    room = shapely.box(*walls)
    count = 0

    def valid(state: ob.State) -> bool:
        c, s = math.cos(state.getYaw()), math.sin(state.getYaw())
        moved = shapely.affinity.affine_transform(body, [c, -s, s, c, state.getX(), state.getY()])
        return bool(room.contains(moved)) and not standing.intersects(moved)

    def propagate(state: ob.State, control: oc.Control, duration: float, result: ob.State) -> None:
        nonlocal count
        count += 1
        segment = segments[min(int(control[0] * len(segments)), len(segments) - 1)]
        twist = (1.0 - control[1]) * segment[:3] + control[1] * segment[3:]
        pose = np.array([state.getX(), state.getY(), state.getYaw()])
        x, y, theta = se2.compose(pose, se2.exp(twist * duration))
        result.setX(float(x))
        result.setY(float(y))
        result.setYaw(float(se2.wrap_angle(theta)))

    space = ob.SE2StateSpace()
    bounds = ob.RealVectorBounds(2)
    for i in range(2):
        bounds.setLow(i, walls[i])
        bounds.setHigh(i, walls[i + 2])
    space.setBounds(bounds)
    controls = oc.RealVectorControlSpace(space, 2)
    unit = ob.RealVectorBounds(2)
    unit.setLow(0.0)
    unit.setHigh(1.0)
    controls.setBounds(unit)
    information = oc.SpaceInformation(space, controls)
    information.setStatePropagator(propagate)
    information.setStateValidityChecker(valid)
    information.setPropagationStepSize(STEP)
    information.setMinMaxControlDuration(1, 20)
    information.setup()
    definition = ob.ProblemDefinition(information)
    start, goal = space.allocState(), space.allocState()
    for state, pose in ((start, scenario.start), (goal, scenario.goal.pose_chain)):
        state.setX(float(pose[0]))
        state.setY(float(pose[1]))
        state.setYaw(float(se2.wrap_angle(pose[2])))
    definition.setStartAndGoalStates(start, goal, 0.01)
    planner = oc.RRT(information)
    planner.setProblemDefinition(definition)
    planner.setup()
    began = time.perf_counter()
    planner.solve(ob.timedPlannerTerminationCondition(seconds))
    return count / (time.perf_counter() - began)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=2.0)
    parser.add_argument("--scenario", default="three-boxes-clutter")
    arguments = parser.parse_args()
    scenario = load_scenario(arguments.scenario)
    print(f"{arguments.scenario}, {platform.machine()}, Python {platform.python_version()}")
    slow = plain(scenario, arguments.seconds)
    print(f"{'plain Python':14} {slow:10.0f} steps of {STEP} m per second")
    for name in sorted(MODULES):
        rate, cost = ours(scenario, name, arguments.seconds)
        print(f"{name:14} {rate:10.0f} extensions per second, cost {cost:.3f} m")


if __name__ == "__main__":
    main()
