"""What plans, executions and simulators make of fixed problems, as plain numbers; run as a script, it freezes them.

    PYTHONPATH=tests python tests/golden/outcomes.py

Do that only where results are meant to change, and say in the commit what the change buys.
"""

import json
import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from kinds import MULTI, SWAP

import pushplan
from pushplan.scenario.model import Scenario
from pushplan.sim.slip import slip

FROZEN = Path(__file__).with_name("outcomes.json")

Numbers = dict[str, list[float]]

TWO_PLACES = "".join(line for line in SWAP.splitlines(keepends=True) if "name: bin" not in line)
"""Two objects exchange places in an empty room."""

INTERVALS = """\
format: pushplan/1
name: not-known-well
floor: {friction: [0.28, 0.32]}
contacts: {friction: 0.5}
objects:
  - {name: near, shape: {box: [0.3, 0.3]}, mass: [2.0, 2.4]}
  - {name: far, shape: {box: [0.3, 0.3]}, mass: 1.0}
pusher: {width: 0.3, friction: 0.5}
start: [0.0, 0.0, 0.0]
goal: {pose: [2.0, 0.6, 0.5]}
"""


def planned(scenario: Scenario, **options: Any) -> Numbers:
    """Return what a search of a fixed number of iterations finds, and what becomes of its plan."""
    plan = pushplan.plan(scenario, **{"seed": 1, "iterations": 300, "time_limit": 300.0} | options)
    assert plan.solved, plan.reason
    assert plan.execution is not None
    execution, robustness = plan.execution, plan.robustness
    chosen = np.linspace(0, len(execution.t) - 1, 12).astype(int)
    numbers = {
        "cost": [plan.cost or 0.0, plan.duration or 0.0],
        "bound": [plan.lower_bound or 0.0],
        "margin": [execution.min_margin or 0.0, execution.min_dynamic_margin or 0.0],
        "arcs": [*np.concatenate([np.column_stack([s.path.twists, s.path.lengths]) for s in plan.segments]).ravel()],
        "poses": [*execution.objects[chosen].ravel(), *execution.poses[chosen].ravel()],
        "margins": [*np.nan_to_num(execution.margins[chosen], nan=-1.0).ravel()],
    }
    if execution.forces is not None:
        numbers["forces"] = [*np.nan_to_num(execution.forces[chosen]).ravel()]
    if robustness is not None:
        numbers["robustness"] = [value for value in vars(robustness).values() if isinstance(value, float)]
    return {key: [float(value) for value in values] for key, values in numbers.items()}


def _packaged(name: str) -> Numbers:
    return planned(pushplan.load_scenario(name))


def slipped(name: str) -> Numbers:
    """Return what the slipping simulator makes of a plan in a world where contacts are half as rough."""
    scenario = pushplan.load_scenario(name)
    plan = pushplan.plan(scenario, seed=1, iterations=1000, time_limit=300.0)
    world = pushplan.World.from_scenario(scenario).with_contact_friction(0.5)
    report = slip(plan, world)
    chosen = np.linspace(0, len(report.t) - 1, 6).astype(int)
    return {"poses": [float(value) for value in report.objects[chosen].ravel()]}


CASES: Mapping[str, Callable[[], Numbers]] = {
    **{f"plan {name}": partial(_packaged, name) for name in pushplan.example_names()},
    "plan by time": lambda: planned(pushplan.load_scenario("narrow-gap"), cost="time"),
    "plan with lattice": lambda: planned(pushplan.load_scenario("narrow-gap"), planner="lattice", iterations=8_000),
    "plan with rrt": lambda: planned(pushplan.load_scenario("free-space"), planner="rrt"),
    "plan in the robust set": lambda: planned(pushplan.load_scenario("one-box"), stable_set="robust"),
    "plan with intervals": lambda: planned(pushplan.scenario_from_text(INTERVALS)),
    "several pushes": lambda: planned(pushplan.scenario_from_text(MULTI), first=True),
    "several objects": lambda: planned(pushplan.scenario_from_text(TWO_PLACES), first=True),
    "slip two-crates": lambda: slipped("two-crates"),
    "slip trapezoids": lambda: slipped("trapezoids"),
    "slip feet": lambda: slipped("feet"),
}


def as_text(frozen: Mapping[str, Numbers]) -> str:
    """Return the numbers as JSON with a line for each list."""
    cases = []
    for name, lists in frozen.items():
        lines = ",\n".join(f"  {json.dumps(key)}: {json.dumps(values)}" for key, values in lists.items())
        cases.append(f" {json.dumps(name)}: {{\n{lines}\n }}")
    return "{\n" + ",\n".join(cases) + "\n}\n"


def freeze() -> None:
    """Write what every case gives now; the cases' names are printed as they are done."""
    frozen = {}
    for name, case in CASES.items():
        frozen[name] = case()
        print(name, file=sys.stderr)
    FROZEN.write_text(as_text(frozen), "utf-8")


if __name__ == "__main__":
    freeze()
