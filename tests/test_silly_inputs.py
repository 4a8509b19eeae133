"""Inputs that are not numbers, absurd, stale or of a wrong type: clear errors, and all motion stops."""

import itertools
import json
import math
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import pushplan
from pushplan.errors import PushplanError
from pushplan.geometry.se2 import compose
from pushplan.planners.search.planners import planner_named
from pushplan.plans.plan import Plan
from pushplan.plans.robustness import TrialUncertainty
from pushplan.sets.known_load_sets import EcofSet
from pushplan.sets.named import add_set
from pushplan.sim.control.controller import Controller
from pushplan.sim.control.sensing import Sensor
from pushplan.sim.control.settings import ControlSettings
from pushplan.sim.control.simulated_push import Disturbance
from pushplan.sim.follower import PATIENCE, Follower
from pushplan.slip.world import World

NUMBERS = [math.nan, -math.inf, 1e300, "word", [], object()]
PERIOD = 0.02


@cache
def plan() -> Plan:
    return Controller(pushplan.load_scenario("one-box")).plan


def silly_poses() -> Iterator[Any]:
    yield from (value for value in NUMBERS)
    for column, value in itertools.product((0, 2), NUMBERS[:4]):
        pose: list[Any] = [0.5, 0.5, 0.1]
        pose[column] = value
        yield pose
    yield from ([], [1.0], [1.0, 2.0, 3.0, 4.0], np.zeros((3, 3)), np.zeros((0, 3)), [None, None, None])


SILLY = list(silly_poses())
CONTROLLER = [
    *(("object_poses", [pose]) for pose in SILLY),
    *(("plate_pose", pose) for pose in SILLY),
    *(("odometry", pose) for pose in SILLY),
    *(("measured_at", time) for time in [*NUMBERS, 0.5, 2.2, -3.1, 1e5, -1e5, True]),
]
FOLLOWER = [
    *(("base_pose", pose) for pose in SILLY),
    *(("object_poses", [pose]) for pose in SILLY),
    *(("elapsed", time) for time in [*NUMBERS, -0.02, -1e-9, 7.0, -math.nan]),
]


def name(case: object) -> str:
    return repr(case).split(" at 0x")[0].replace("\n", "")[:40]


@pytest.mark.parametrize(("key", "value"), CONTROLLER, ids=name)
def test_a_controller_never_returns_nan_and_stops_without_measurements(key: str, value: Any) -> None:
    """Invalid measurements count as none: after the watchdog's time and the time to stop, the plate stands."""
    controller = Controller(plan())
    refused, twists = 0, []
    for k in range(80):
        now, words = 2.0 + k * PERIOD, {key: value}
        if key == "measured_at":
            words["object_poses"] = compose(plan().scenario.start, plan().scenario.chain.places)
        try:
            twists.append(controller.step(now, **words))
        except PushplanError:
            refused += 1
            twists.append(controller.step(now))
    assert np.isfinite(twists).all()
    assert (np.array(twists[-5:]) == 0.0).all()
    kinds = {event.kind for event in controller.events}
    assert refused or "dropped" in kinds or "unseen" in kinds


@pytest.mark.parametrize(
    "covariance", [*NUMBERS, -np.eye(3), np.triu(np.ones((3, 3))), np.full((3, 3), math.nan), np.eye(2)], ids=name
)
def test_an_invalid_covariance_is_reported(covariance: Any) -> None:
    controller, seen = Controller(plan()), compose(plan().scenario.start, plan().scenario.chain.places)
    told = ""
    try:
        assert np.isfinite(controller.step(2.0, seen, covariance=covariance)).all()
    except PushplanError as error:
        told = str(error)
    assert "covariance" in told + "".join(e.text for e in controller.events if e.kind == "dropped")
    with pytest.raises(PushplanError, match="frame is 'camera'; allowed: 'world' and 'plate'"):
        controller.step(2.1, seen, frame="camera")


@pytest.mark.parametrize("now", [*NUMBERS, -5.0, 1.9, 17.2], ids=name)
def test_a_controller_stops_while_the_time_is_invalid(now: Any) -> None:
    controller = Controller(plan())
    seen = compose(plan().scenario.start, plan().scenario.chain.places)
    for k in range(25):
        assert np.isfinite(controller.step(2.0 + k * PERIOD, seen)).all()
    for _ in range(60):
        try:
            assert (controller.step(1.9 if now == 1.9 else now, seen) == 0.0).all()
        except PushplanError:
            continue
    if not isinstance(now, float):
        return
    assert controller.over
    assert controller.reason == "the times of the steps are invalid"


@pytest.mark.parametrize(("key", "value"), FOLLOWER, ids=name)
def test_a_follower_never_returns_nan_and_stops_on_invalid_inputs(key: str, value: Any) -> None:
    follower, seen, twists = Follower(plan()), np.zeros(3), []
    refused = 0
    for _ in range(int(PATIENCE / PERIOD) + 5):
        try:
            command = follower.step(**{key: value})
            seen = command.twist
        except PushplanError:
            refused, seen = refused + 1, np.zeros(3)
        twists.append(seen)
    assert np.isfinite(twists).all()
    if key != "object_poses":  # a follower goes by time alone, too
        assert (twists[-1] == 0.0).all()
    assert refused or follower.events or value == [[None, None, None]]


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, "word", None, 1e300], ids=name)
@pytest.mark.parametrize("made", [
    *(lambda v, f=f: Sensor(**{f: v}) for f in ("rate", "delay", "position", "angle")),
    *(
        lambda v, f=f: ControlSettings(**{f: v})
        for f in ("rate", "looks", "position_noise", "patience", "detour", "worth")
    ),
    *(lambda v, k=k: Disturbance(*[v if j == k else 1 for j in range(5)]) for k in (0, 1, 4)),
    lambda v: Follower(plan(), off=(v, v)), lambda v: Follower(plan(), slipped=(0.1, v)),
    lambda v: Follower(plan(), period=v), lambda v: Follower(plan(), speed=v),
    lambda v: World.from_scenario(plan().scenario).with_contact_friction(v),
    lambda v: replace(World.from_scenario(plan().scenario), other_friction=v),
    lambda v: pushplan.SlipSimulator(World.from_scenario(plan().scenario)).move([v, 0, 0], 1.0),
    lambda v: pushplan.SlipSimulator(World.from_scenario(plan().scenario)).move([1, 0, 0], v),
])  # fmt: skip
def test_invalid_simulations_and_settings_are_refused(made: Any, value: Any) -> None:
    with pytest.raises((PushplanError, TypeError, ValueError)):
        made(value)


api: Any = pushplan


def world(plan: Plan) -> Any:
    return World.from_scenario(plan.scenario)


CALLS: dict[str, tuple[Callable[[Any], Any], str]] = {
    "path": (lambda p: p.path.poses_at([math.nan]), "costs hold NaN"),
    "trajectory": (lambda p: p.trajectory.poses_at([math.nan]), "times hold NaN"),
    "huge": (lambda p: p.trajectory.poses_at([10**400]), "times cannot be read"),
    "margin": (lambda p: p.scenario.stable_set().margin("ab"), "twists cannot be read as numbers"),
    "window": (lambda p: p.scenario.stable_set().cor_region(1, (1.0, 2.0)), "window is"),
    "start": (lambda p: api.Planner(p.scenario).plan(start="ab"), "start cannot be read"),
    "far": (lambda p: api.Planner(p.scenario).plan(goal=[1e300, 0, 0]), r"goal: a pose with 1e\+300; allowed:"),
    "lean": (lambda p: world(p).with_load_shifted([0, 0], 0.5), "direction of a leaning load is zero"),
    "obstacle": (lambda p: api.Planner(p.scenario).with_obstacles([1.0]), r"obstacle 0 is 1\.0; allowed: Polygon"),
    "cost": (lambda p: api.plan(p.scenario, cost="fuel"), "'fuel' is not a cost; allowed: travel,"),
    "margin asked": (lambda p: api.plan(p.scenario, margin=1.0), "allowed: 'auto' or a number from 0"),
    "margin of words": (lambda p: api.plan(p.scenario, margin="much"), "allowed: 'auto' or a number from 0"),
    "no scenario": (lambda p: api.run(3), "3 is a int; allowed: a scenario, its file, or the name"),
    "no observer": (lambda p: api.plan(p.scenario, observer=print), "allowed: a pushplan.Observer"),
    "no margin": (lambda p: api.plan(p.scenario, margin=0.9), "no push has a margin above 0.9"),
    "no room": (lambda p: api.plan(p.scenario, margin=0.0), "the margin is 0, but contacts need some margin"),
    "no room stated": (lambda p: api.plan(p.scenario.with_margin(0.0)), "the margin is 0, but contacts need some"),
    "no trials": (lambda p: api.trial(p, 0), "must be a whole number from 1"),
    "period": (lambda p: api.Follower(p, period=0.0), "period is 0"),
    "no logs": (lambda p: api.identify([]), "no log is given"),
    "samples": (lambda p: api.trial(p, 0.5), "the number of samples is 0.5"),
    "seed": (lambda p: api.trial(p, 2, seed=-1), "the seed is -1"),
    "iterations": (lambda p: api.plan(p.scenario, iterations=10**400), "allowed: a whole number from 1"),
    "simulator": (lambda p: api.trial(p, 2, simulator=7), "7 is not a simulator"),
    "follower": (lambda p: api.Follower(7), "there is no plan in 7"),
    "no planner": (lambda p: planner_named("nobody"), "there is no planner 'nobody'; allowed: auto, rrt, est"),
    "no module": (lambda p: planner_named("no_such_module:Planner"), "cannot load 'no_such_module:Planner'"),
    "no attribute": (lambda p: planner_named("math:nothing"), "module 'math' has no attribute 'nothing'"),
    "a number": (lambda p: planner_named("math:pi"), "the planner 'math:pi' is a float"),
    "no set": (lambda p: add_set("math:pi"), "'math:pi' is not a stable set; allowed: a subclass of"),
    "misspelt": (lambda p: add_set("stabel"), "no stable set is called 'stabel'; allowed: ecof, cof"),
    "a name taken": (lambda p: add_set(type("False_", (EcofSet,), {"name": "cof"})), "has the name 'cof'; allowed"),
    "move": (lambda p: api.SlipSimulator(world(p)).move({}, 1.0), "twist cannot be read"),
    "poses": (lambda p: world(p).with_object_poses([["a"] * 3]), "cannot be read as numbers"),
}  # fmt: skip


@pytest.mark.parametrize("name", CALLS)
def test_a_silly_call_gives_a_clear_error(name: str) -> None:
    call, said = CALLS[name]
    with pytest.raises(PushplanError, match=said):
        call(plan())


def test_numpy_numbers_are_accepted_in_all_settings() -> None:
    whole: Any = np.int32(50)
    real: Any = np.float32(0.25)
    small: Any = np.uint8(2)
    stops: Any = np.bool_(True)
    scenario = pushplan.load_scenario("two-crates")
    for planner in ("auto", "rrt"):
        asked = pushplan.plan(scenario, planner=planner, iterations=whole, seed=small, gap=real, first=stops)
        same = pushplan.plan(scenario, planner=planner, iterations=50, seed=2, gap=0.25, first=True)
        assert asked.to_dict()["path_cost"] == same.to_dict()["path_cost"]
        pushplan.plan(scenario, planner=planner, time_limit=np.float64(0.05))
        observer = pushplan.Observer(cancelled=lambda: stops)
        pushplan.plan(scenario, planner=planner, time_limit=60.0, observer=observer)
    uncertainty = TrialUncertainty(contact_friction=real)
    settings = (uncertainty, Sensor(rate=whole), Disturbance(real, small, real, real, real))
    assert json.dumps([asdict(one) for one in (*settings, ControlSettings(looks=whole))])
