"""Invalid numbers and objects as arguments of the Python interface.

Each call must raise an error of pushplan or, for values that are not a number or path at all, Python's TypeError.
"""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
from attacking.measured import Attacks, Row, measured, wrong

import pushplan
from pushplan.closed_loop import run_closed_loop
from pushplan.drawing.sets import plot_stable_sets
from pushplan.errors import PushplanError
from pushplan.planner import Planner
from pushplan.plans.plan import Plan
from pushplan.plans.robustness import TrialUncertainty
from pushplan.plans.settings import PlanSettings
from pushplan.scenario.file import scenario_from_document
from pushplan.scenario.model import Scenario
from pushplan.sim.control.controller import Controller
from pushplan.sim.control.sensing import Sensor
from pushplan.sim.control.settings import ControlSettings
from pushplan.sim.control.simulated_push import Disturbance
from pushplan.sim.follower import Follower
from pushplan.slip.simulator import SlipSimulator
from pushplan.slip.world import World

nan, inf = math.nan, math.inf
NUMBERS: tuple[Any, ...] = (nan, inf, -inf, -1, -1e-9, 1e308, 1e-308, 2**40, 0.5, "1", True, [1.0], 10**400)
POSES: tuple[Any, ...] = (
    [nan, 0.0, 0.0], [0.0, inf, 0.0], [1e308, 1e308, 1e308], [], [1.0], [[0.0, 0.0]], "pose", {"x": 1},
    [1 + 2j, 0, 0],
    np.zeros((0, 3)), np.zeros((2, 3, 3)), np.full((2, 3), nan), np.array([["a", "b", "c"]]),
)  # fmt: skip
OTHERS: tuple[Any, ...] = ("", "no-such", "no/such", "os:system", 7, b"x", object(), [], {}, ("ecof",))


@cache
def scenario() -> Scenario:
    return pushplan.load_scenario("two-crates")


@cache
def plan() -> Plan:
    return pushplan.plan(scenario(), seed=1, first=True, time_limit=60.0)


@cache
def stable() -> Any:
    return pushplan.stable_set(scenario().chain, "ecof")


@cache
def planner() -> Planner:
    return Planner(scenario(), time_limit=0.5)


def world() -> World:
    return World.from_scenario(scenario())


def _settings(name: str, value: Any) -> object:
    return pushplan.plan(scenario(), **{"time_limit": 0.2, "first": True, name: value})


def _trial(name: str, value: Any) -> object:
    if name == "samples" and value in (2**40, 1e308, 10**400):
        return None  # that many samples are meant
    return pushplan.trial(plan(), **{"samples": 2, "jobs": 1, name: value})


def _loop(name: str, value: Any) -> object:
    return run_closed_loop(scenario(), plan=plan(), **{name: value})


def _controlled(value: Any, **more: Any) -> object:
    return Controller(plan()).step(0.0, value, **more)


def _made(kind: Callable[..., object], name: str, value: Any) -> object:
    return kind(**{name: value})


Call = Callable[[Any], object]
SETTINGS = "time_limit", "seed", "iterations", "margin", "gap"
WITH_NUMBERS: dict[str, Call] = {
    **{f"plan({name})": partial(_settings, name) for name in SETTINGS},
    **{f"PlanSettings({name})": partial(_made, PlanSettings, name) for name in SETTINGS},
    "trial(samples)": partial(_trial, "samples"),
    "trial(seed)": partial(_trial, "seed"),
    **{
        f"TrialUncertainty({name})": partial(_made, TrialUncertainty, name)
        for name in ("contact_friction", "load", "position", "angle")
    },
    "closed loop(seed)": partial(_loop, "seed"),
    "Disturbance(time)": lambda value: Disturbance(value, 0, 0.0, 0.0, 0.0),
    "Disturbance(x)": lambda value: Disturbance(1.0, 0, value, 0.0, 0.0),
    "closed loop(index)": lambda value: _loop("disturbances", [Disturbance(1.0, value, 0.0, 0.001, 0.0)]),
    **{f"Sensor({name})": partial(_made, Sensor, name) for name in ("rate", "delay", "position", "angle")},
    **{
        f"ControlSettings({name})": partial(_made, ControlSettings, name)
        for name in ("rate", "looks", "friction", "patience", "replans")
    },
    "path.poses_at": lambda value: plan().path.poses_at([value]),  # type: ignore[union-attr]
    "trajectory.poses_at": lambda value: plan().trajectory.poses_at([value]),  # type: ignore[union-attr]
    "Controller.step(now)": lambda value: Controller(plan()).step(value),
    "Controller.step(measured_at)": lambda value: _controlled(np.zeros((2, 3)), measured_at=value),
    "World.with_contact_friction": lambda value: world().with_contact_friction(value),
    "World.with_mass": lambda value: world().with_mass(value),
    "World.with_floor_friction": lambda value: world().with_floor_friction(value, "far"),
}
WITH_POSES: dict[str, Call] = {
    "plan(start)": lambda value: planner().plan(start=value, first=True),
    "plan(goal)": lambda value: planner().plan(goal=value, first=True),
    "reach(starts)": lambda value: planner().reach(value, [[1.0, 0.5, 0.0]]),
    "with_obstacles": lambda value: planner().with_obstacles(value),
    "margin": lambda value: stable().margin(value),
    "contains": lambda value: stable().contains(value),
    "cor_region": lambda value: stable().cor_region(+1, value),
    "friction_wrench": lambda value: pushplan.friction_wrench(scenario().chain.objects[0], value),
    "ecof": lambda value: pushplan.ecof(scenario().chain.objects[0], value),
    "Controller.step(poses)": _controlled,
    "Controller.step(plate)": lambda value: _controlled(None, plate_pose=value),
    "SlipSimulator.move": lambda value: SlipSimulator(world()).move(value, 0.01),
    "with_object_poses": lambda value: world().with_object_poses(value),
}
WITH_OTHERS: dict[str, Call] = {
    "load_scenario": pushplan.load_scenario,
    "load_run": pushplan.load_run,
    "verify_log": pushplan.verify_log,
    "scenario_from_document": scenario_from_document,
    "stable_set": lambda value: pushplan.stable_set(scenario().chain, value),
    **{f"plan({name})": partial(_settings, name) for name in ("planner", "stable_set", "cost")},
    "run(log)": lambda value: pushplan.run(scenario(), log=value, time_limit=0.2, first=True),
    "trial(simulator)": partial(_trial, "simulator"),
    "plot_plan": lambda value: pushplan.plot_plan(plan(), value),
    "plot_stable_sets": lambda value: plot_stable_sets(scenario().chain, [stable()], value),
    "identify": lambda value: pushplan.identify([value]),
    "Follower": lambda value: Follower(value),
    "with_load_shifted": lambda value: world().with_mass(1.1, value),
}
PICKLED: dict[str, Callable[[], object]] = {
    "Scenario": scenario, "Plan": plan, "StableSet": stable, "Planner": planner,
    "Controller": lambda: Controller(plan()), "Follower": lambda: Follower(plan()),
    "World": world, "Trials": lambda: _trial("seed", 1), "PlanSettings": lambda: PlanSettings(seed=3),
}  # fmt: skip


def every() -> list[tuple[str, Callable[[], object]]]:
    """Return name and call of every attack."""
    tables = (WITH_NUMBERS, NUMBERS), (WITH_POSES, POSES), (WITH_OTHERS, OTHERS)
    return [
        (f"{name} {value!r:.40}", partial(call, value))
        for calls, values in tables
        for name, call in calls.items()
        for value in values
    ]


def attacks(folder: Path, count: int, seed: int) -> Attacks:
    """Yield `count` of the calls, and all pickles."""
    stable(), plan(), planner()
    for name, make in PICKLED.items():
        yield f"{seed}-pickle-{name}", partial(measured, partial(_pickled, make), group="pickle")
    known = every()
    Random(seed).shuffle(known)
    for k, (name, call) in enumerate(known[: count - len(PICKLED)]):
        group = name.partition("(")[0].partition(" ")[0].partition(".")[0]
        yield f"{seed}-call-{k}-{name}", partial(measured, partial(_called, call), 0.5, group=group)


def _pickled(make: Callable[[], object], folder: Path) -> Row:
    made = make()
    same = type(pickle.loads(pickle.dumps(made))) is type(made)
    return {"verdict": "pickles"} if same else wrong("another type")


def _called(call: Callable[[], object], folder: Path) -> Row:
    try:
        call()
    except PushplanError as error:
        return {"verdict": "an error of pushplan" if str(error).strip() else "WRONG", "said": str(error)[:200]}
    except TypeError as error:  # what is no number, no path, no set at all
        return {"verdict": "a TypeError", "said": str(error)[:200]}
    return {"verdict": "an answer"}
