"""Closed loop against open loop in the same disturbed samples.

Run `python benchmarks/closed_loop.py [--worlds 2] [--only NAME ...]`; prints a line a scenario, and the shares that
arrive. Every packaged scenario is executed in worlds in which

- every coefficient of friction, of contacts and of the floor, is off by 20 %, up or down on its own;
- one object is displaced by 5 mm and 3 deg at a random moment, in a random direction;
- objects are measured 30 times a second, 0.1 s late, with noise of 1 mm and 0.3 deg.

Counted is whether the goal's object (every object, where the goal names none) ends within 5 mm and 1 deg of its goal,
or the goal's own tolerance where that is more.
Loads that are unknown are even in these worlds.

`--plans 40` does so with random plans of several pushes of one load, and of several objects, in place of these. The
plate is off where it believes to be by up to 5 mm and 2 deg, drawn anew, at every approach.

`--harsh` applies one large error at a time in every packaged scenario: an object is displaced by 8 mm and 5 deg; all
contacts have 0.7 of the nominal friction; an object is dragged sideways by 20 mm within a second; a second passes
without a measurement; the floor is thirty times as rough. Objects of a chain that have moved relative to one another
cannot all reach their goals in one push; runs that report this are counted separately.

`--physics 10` also simulates the first ten runs in MuJoCo (extra `physics`), at full speed and with inertia, with the
same controller and disturbances.
"""

from __future__ import annotations

import argparse
import itertools
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pushplan.bench.store import Machine
from pushplan.errors import PushplanError
from pushplan.geometry.se2 import compose, exp, log
from pushplan.planner import plan
from pushplan.plans.execution import wilson
from pushplan.plans.goals import tolerance_of, worst_at_goal
from pushplan.plans.plan import Plan
from pushplan.plans.run import Replan
from pushplan.scenario.file import example_names, load_scenario, scenario_from_document
from pushplan.scenario.model import Scenario
from pushplan.sim.control.aim import Aim
from pushplan.sim.control.controller import Controller
from pushplan.sim.control.jobs import Phase
from pushplan.sim.control.simulated_push import Disturbance, OpenLoop, Simulator, simulate_push
from pushplan.sim.physics.simulator import PhysicsSimulator
from pushplan.slip.simulator import SlipSimulator
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray

POSITION, ANGLE = 5e-3, np.radians(1.0)
DISPLACED, TURNED = 5e-3, np.radians(3.0)
OFF = 0.2


@dataclass(frozen=True)
class Row:
    """Result in one sample: whether the goal's object arrives, and the effort."""

    closed: bool
    opened: bool | None
    """Whether the plan alone does; None where that was not tried."""
    error: FloatArray
    replans: tuple[Replan, ...]
    why: str
    seconds: float
    physics: FloatArray | None = None
    """Errors at the goal where MuJoCo simulated the world as well, and whether it arrives there."""
    there: bool = False
    travel: float = 0.0
    planned: float = 0.0
    """Way of the plate, and that of the plan, m."""


def disturbed(scenario: Scenario, duration: float, random: np.random.Generator) -> tuple[World, Disturbance]:
    """Return a world with other frictions, and a disturbance."""
    world = World.from_scenario(scenario)
    for name in world.names:
        world = world.with_contact_friction(1.0 + OFF * random.choice([-1.0, 1.0]), name)
        world = world.with_floor_friction(1.0 + OFF * random.choice([-1.0, 1.0]), name)
    way = random.uniform(-np.pi, np.pi)
    turn = TURNED * random.choice([-1.0, 1.0])
    index = int(random.integers(len(world.names)))
    x, y = DISPLACED * np.cos(way), DISPLACED * np.sin(way)
    return world, Disturbance(random.uniform(0.0, duration), index, float(x), float(y), float(turn))


SIDES, ROOM = (0.12, 0.3), 3.0
"""Sides of boxes, and half of the side of the room that they are drawn in, m."""
APART = 0.65
"""Distance of boxes, goals and robot from one another, m: with room to drive between them."""
APPROACH = (5e-3, np.radians(2.0))
"""By how much the plate is off where it believes to be after it has driven to an object, at most."""


def several_pushes(only: list[str] | None) -> Iterator[tuple[Scenario, Plan]]:
    """Yield random scenarios that have a plan: a load of one or two boxes, or two or three boxes apart.

    Where some are named, as `load-16` and `boxes-3`, it is those; else there is no end of them.
    """
    for seed in (int(name.rpartition("-")[2]) for name in only) if only else itertools.count():
        random, apart = np.random.default_rng([seed, 77]), seed % 2 == 1
        with suppress(PushplanError):  # drawn so that robot and boxes meet, or nothing can be done
            scenario = scenario_from_document(_apart(random, seed) if apart else _one_load(random, seed))
            result = plan(scenario, seed=1, time_limit=10.0 if apart else 1.0, first=apart)
            if result.solved:
                yield scenario, result


def _spots(random: np.random.Generator, count: int) -> FloatArray:
    """Return separated poses (count, 3) in the room."""
    spots: list[FloatArray] = []
    while len(spots) < count:
        spot = random.uniform(-0.8 * ROOM, 0.8 * ROOM, 3) * [0.6, 0.6, 1.0]
        if all(np.hypot(*(spot - other)[:2]) > APART for other in spots):
            spots.append(spot)
    return np.array(spots)


def _room(random: np.random.Generator, name: str, robot: FloatArray) -> dict[str, Any]:
    drive = [{"differential": {"axle": [-0.2, 0.0, 0.0]}}, "omnidirectional"][int(random.integers(2))]
    return {
        "format": "pushplan/1",
        "name": name,
        "floor": {"friction": 0.3},
        "contacts": {"friction": 0.4},
        "pusher": {"width": 0.28, "friction": 0.5},
        "robot": {
            "footprint": {"box": [0.4, 0.285], "pose": [-0.2, 0.0, 0.0]},
            "drive": drive,
            "start": robot.tolist(),
        },
        "workspace": {"x": [-ROOM, ROOM], "y": [-ROOM, ROOM]},
    }


def _box(random: np.random.Generator, name: str) -> dict[str, Any]:
    shape = {"box": random.uniform(*SIDES, 2).round(3).tolist()}
    return {"name": name, "shape": shape, "mass": float(random.uniform(0.5, 3.0))}


def _one_load(random: np.random.Generator, seed: int) -> dict[str, Any]:
    start, goal, robot = _spots(random, 3)
    boxes = [_box(random, f"box-{k}") for k in range(int(random.integers(1, 3)))]
    return {
        **_room(random, f"load-{seed}", robot),
        "objects": boxes,
        "start": start.tolist(),
        "goal": {"pose": goal.tolist(), "of": boxes[-1]["name"]},
    }


def _apart(random: np.random.Generator, seed: int) -> dict[str, Any]:
    count = int(random.integers(2, 4))
    spots = _spots(random, 2 * count + 1)
    boxes = [_box(random, f"box-{k}") | {"pose": spots[k].tolist()} for k in range(count)]
    goals = {box["name"]: {"pose": spots[count + k].tolist()} for k, box in enumerate(boxes)}
    return {**_room(random, f"boxes-{seed}", spots[-1]), "objects": boxes, "goals": goals}


@dataclass(eq=False)
class Astray:
    """A robot whose plate is not where the controller believes it to be when an approach begins.

    Attributes:
        controller: What it drives by.
        random: Draws.
    """

    controller: Controller
    random: np.random.Generator
    _approached: object = None
    _shift: FloatArray | None = None

    def step(self, now: float, object_poses: ArrayLike | None = None, measured_at: float | None = None) -> FloatArray:
        twist = self.controller.step(now, object_poses, measured_at)
        load = self.controller.load
        approaches = self.controller.phase is Phase.DRIVING and load is not None and load.face != ""
        if approaches and load is not self._approached and twist[0] > 0.0:
            way, far = self.random.uniform(-np.pi, np.pi), APPROACH[0] * self.random.random()
            turn = self.random.uniform(-APPROACH[1], APPROACH[1])
            self._approached, rate = load, self.controller.settings.rate
            return np.asarray(log(compose(exp(twist / rate), [far * np.cos(way), far * np.sin(way), turn])) * rate)
        if not approaches and self.controller.phase is Phase.DRIVING:
            self._approached = None
        return twist


def carry_out(
    scenario: Scenario, result: Plan, seed: int, verbose: bool, simulator_of: Callable[[World], Simulator]
) -> Row:
    """Execute a multi-push plan with approach errors, a disturbance and noise."""
    assert result.trajectory is not None
    random = np.random.default_rng([seed, *scenario.name.encode()])
    world, disturbance = disturbed(scenario, result.trajectory.duration, random)
    controller = Controller(scenario, plan=result)
    robot, rate = Astray(controller, random), controller.settings.rate
    began = time.process_time()
    course = simulate_push(
        world, controller, rate, [disturbance], seed=seed, simulator_of=simulator_of, step=robot.step
    )
    seconds = time.process_time() - began
    blind = simulate_push(world, OpenLoop(result, rate), rate, [disturbance])
    errors = [np.array(worst_at_goal(scenario, run.object_poses[-1])) for run in (course, blind)]
    closed, opened = (bool((error <= tolerance_of(scenario, POSITION, ANGLE)).all()) for error in errors)
    why = "jammed" if course.jammed else controller.reason or controller.phase.value
    if verbose and not closed:
        print(disturbance.event(world.names))
        for event in controller.events:
            print(f"    {event.time:7.2f} {event.kind:8} {event.text}")
    travel, planned = way_of(course.poses), way_of(result.trajectory.poses)
    return Row(closed, opened, errors[0], tuple(controller.replans), why, seconds, travel=travel, planned=planned)


HARSH = ("displaced", "slippery", "dragged", "unseen", "rough floor")


@dataclass(eq=False)
class Blinded:
    """A robot without measurements for a time, s."""

    controller: Controller
    begin: float
    end: float

    def step(self, now: float, object_poses: ArrayLike | None = None, measured_at: float | None = None) -> FloatArray:
        if self.begin <= now < self.end:
            object_poses = measured_at = None
        return self.controller.step(now, object_poses, measured_at)


def harsh(scenario: Scenario, what: str, seed: int, verbose: bool) -> Row:
    """Apply one large error."""
    random = np.random.default_rng([seed, *what.encode(), *scenario.name.encode()])
    world, controller = World.from_scenario(scenario), Controller(scenario)
    assert controller.plan.trajectory is not None
    began, way = random.uniform(0.1, 0.8) * controller.plan.duration, random.uniform(-np.pi, np.pi)
    index, aside = int(random.integers(len(world.names))), np.array([np.cos(way), np.sin(way)])
    hits, robot = list[Disturbance](), Blinded(controller, began, began + float(what == "unseen"))
    if what == "displaced":
        hits = [Disturbance(began, index, *(8e-3 * aside), np.radians(5.0) * random.choice([-1.0, 1.0]))]
    elif what == "dragged":
        hits = [Disturbance(began + 0.05 * k, index, *(1e-3 * aside), 0.0) for k in range(20)]
    elif what == "slippery":
        world = world.with_contact_friction(0.7)
    elif what == "rough floor":
        world = world.with_floor_friction(30.0)
    start = time.process_time()
    course = simulate_push(world, controller, controller.settings.rate, hits, seed=seed, step=robot.step)
    seconds = time.process_time() - start
    error = judge(scenario, course.object_poses[-1])
    arrived = bool((error <= [POSITION, ANGLE]).all())
    why = "jammed" if course.jammed else controller.reason or controller.phase.value
    if verbose and not arrived:
        for event in controller.events:
            print(f"    {event.time:7.2f} {event.kind:8} {event.text}")
    travel, planned = way_of(course.poses), way_of(controller.plan.trajectory.poses)
    return Row(arrived, None, error, tuple(controller.replans), why, seconds, travel=travel, planned=planned)


def way_of(poses: FloatArray) -> float:
    """Return the distance of the plate along poses (m, 3), m."""
    return float(np.hypot(*np.diff(poses[:, :2], axis=0).T).sum())


def judge(scenario: Scenario, object_poses: FloatArray) -> FloatArray:
    """Return the largest distance (m) and angle (rad) of the goal's objects from the goal."""
    return Aim.of(scenario.goal, scenario.chain, POSITION, ANGLE).errors(object_poses)


def one(scenario: Scenario, result: Plan, seed: int, verbose: bool, physics: bool) -> Row:
    """Run both loops in one sample."""
    assert result.trajectory is not None
    random = np.random.default_rng([seed, len(scenario.name)])
    world, disturbance = disturbed(scenario, result.trajectory.duration, random)
    controller = Controller(scenario)
    began = time.process_time()
    course = simulate_push(world, controller, controller.settings.rate, [disturbance], seed=seed)
    seconds = time.process_time() - began
    blind = simulate_push(world, OpenLoop(result, 50.0), 50.0, [disturbance])
    errors = [judge(scenario, run.object_poses[-1]) for run in (course, blind)]
    closed, opened = (bool((error <= [POSITION, ANGLE]).all()) for error in errors)
    why = "jammed" if course.jammed else controller.reason
    if verbose:
        print(disturbance, [c.friction for c in world.chain.contacts])
        for event in controller.events:
            print(f"    {event.time:7.2f} {event.kind:8} {event.text}")
    found = None
    if physics:
        again = simulate_push(
            world,
            Controller(scenario, plan=controller.plan),
            controller.settings.rate,
            [disturbance],
            seed=seed,
            simulator_of=PhysicsSimulator,
        )
        found = judge(scenario, again.object_poses[-1])
    there = found is not None and bool((found <= [POSITION, ANGLE]).all())
    return Row(closed, opened, errors[0], tuple(controller.replans), why, seconds, found, there)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, default=2, help="worlds a scenario")
    parser.add_argument("--only", nargs="*", help="names of scenarios")
    parser.add_argument("--harsh", action="store_true", help="one large disturbance at a time, instead")
    parser.add_argument("--physics", type=int, default=0, help="runs that MuJoCo judges, too")
    parser.add_argument("--plans", type=int, default=0, help="plans of several pushes, instead of single ones")
    parser.add_argument("--verbose", action="store_true", help="print every event of runs that miss")
    arguments = parser.parse_args()
    time.perf_counter = time.process_time  # searches then count CPU time, whatever else the machine does
    print(Machine.this().words)
    if arguments.plans:
        plans = itertools.islice(several_pushes(arguments.only), arguments.plans)
        report([*carried_out(plans, arguments.verbose, arguments.physics)])
        return
    if arguments.harsh:
        rows = [*endured(arguments.only, arguments.worlds, arguments.verbose)]
        apart = [not row.closed and row.why.startswith("objects have slid against one another") for row in rows]
        print(
            f"{sum(apart)} of {len(rows)} runs say that objects have slid too far for one push to bring all to goals"
        )
        report([row for row, gone in zip(rows, apart, strict=True) if not gone])
        return
    rows: list[Row] = []
    problems = (
        (scenario, plan(scenario, seed=1, time_limit=1.0)) for scenario in map(load_scenario, example_names())
    )
    for scenario, result in problems:
        if arguments.only and scenario.name not in arguments.only:
            continue
        found: list[Row] = []
        for seed in range(arguments.worlds):
            judged = sum(row.physics is not None for row in rows + found)
            found.append(one(scenario, result, seed, arguments.verbose, judged < arguments.physics))
        rows += found
        closed, opened = sum(row.closed for row in found), sum(row.opened for row in found)
        share = f"of {len(found)} arrive {closed} in closed, {opened} in open loop"
        print(f"{scenario.name:22} {share}, {np.mean([len(r.replans) for r in found]):.1f} replans", flush=True)
        for row in found:
            if not row.closed:
                print(f"    {1e3 * row.error[0]:.1f} mm {np.degrees(row.error[1]):.2f} deg: {row.why}")
    report(rows)


def endured(only: list[str] | None, worlds: int, verbose: bool) -> Iterator[Row]:
    """Run packaged scenarios, all or the named ones, with every large disturbance; print a line for each."""
    for what, name, seed in itertools.product(HARSH, only or example_names(), range(worlds)):
        row = harsh(load_scenario(name), what, seed, verbose)
        print(f"{what:12} {name:22} {_told(row)}", flush=True)
        yield row


def carried_out(problems: Iterator[tuple[Scenario, Plan]], verbose: bool, physics: int) -> Iterator[Row]:
    """Execute multi-push plans, the first ones in MuJoCo, too; print a line for each."""
    for k, (scenario, result) in enumerate(problems):
        row = carry_out(scenario, result, 1, verbose, SlipSimulator)
        print(f"{scenario.name:12} {_told(row)}", flush=True)
        if k < physics:
            second = carry_out(scenario, result, 1, verbose, PhysicsSimulator)
            print(f"{scenario.name:12} in MuJoCo {_told(second)}", flush=True)
            row = replace(row, physics=second.error, there=second.closed)
        yield row


def _told(row: Row) -> str:
    rests = sum(replan.rest and replan.solved for replan in row.replans)
    arrived = "arrives" if row.closed else "MISSES "
    off = f"{1e3 * row.error[0]:.1f} mm {np.degrees(row.error[1]):.2f} deg"
    way = f"{row.travel:.1f} m, {row.planned:.1f} planned"
    return f"{arrived} {way}: {off}, {rests} plans for the rest, {row.seconds:.0f} s: {row.why}"


def report(rows: list[Row]) -> None:
    """Print the figures of all runs."""
    for who, ends in (("closed", [row.closed for row in rows]), ("open", [row.opened for row in rows])):
        if None not in ends:
            count = sum(map(bool, ends))
            low, high = wilson(count, len(rows))
            print(f"{who:7} loop: {count} of {len(rows)} arrive ({100 * low:.1f} to {100 * high:.1f} %)")
    every = [replan for row in rows for replan in row.replans if not replan.rest]
    if solved := [1e3 * replan.seconds for replan in every if replan.solved]:
        most = 1e3 * max(replan.seconds for replan in every)
        print(
            f"{len(solved)} replans, {np.median(solved):.3g} ms of CPU in the median, and {len(every) - len(solved)} "
            f"attempts that found none, at most {most:.3g} ms"
        )
    print(f"{np.mean([row.seconds for row in rows]):.2f} s a run")
    second = [row for row in rows if row.physics is not None]
    ways = np.array([row.travel / row.planned for row in rows if row.planned > 0.0])
    if len(ways):
        far = sum(row.travel > 2.0 * row.planned + 1.0 for row in rows if row.planned > 0.0)
        print(f"travel over the plan's: {np.median(ways):.2f} in the median, {far} beyond 2 x + 1 m")
    if second:
        print(f"MuJoCo as the world: {sum(row.there for row in rows)} of {len(second)} arrive")


if __name__ == "__main__":
    main()
