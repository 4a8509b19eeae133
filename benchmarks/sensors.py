"""The closed loop with errors of sensors and robots: every packaged push with each error, in the nominal world.

Run `python benchmarks/sensors.py [--seeds 101 102 103] [--only NAME ...] [--filter ERROR ...] [--disturbances]
[--jobs 2]`; prints a line an error: runs that arrive with at most three replans, travel over the plan's, and how many
stop although nothing happened. Tuned on seeds 1 to 3, judged on 101 to 103. `--filter none --pairs 0 --seeds 1 2 3`
are runs in which nothing is wrong.

`--disturbances` (5 mm and 3 deg at 0.1 to 0.9 of the time, friction off by 20 %) tells how many of them are noticed
within a second. Where they are not, the simulator says what they left: an object that stands again where it stood on
the plate, to 2.5 mm and 0.5 deg (`position_slack`, `angle_slack`) 0.5 s later, was put back by the contact. All
others are missed.

`--slides` lets what a contact pushes slide along it by 10 mm a metre, from 0.1 to 0.7 of the way on, until the loop
stops and looks, and tells how many slides are noticed before 8 mm of them were on arcs, or 15 mm anywhere. Where the
push ended before that, there was nothing to notice.

`--matrix` lets everything go wrong at once, see `ALL`, in single pushes (`--matrix single`) or plans of several
(`--matrix several`); `--physics` does so in MuJoCo. A run is good if the controller says that it arrived, and all
objects are within the tolerance and the camera's error of their goals by the world's poses.

An error of the camera is injected between world and controller, one of odometry between controller and world: the
plate moves otherwise than it was told, and no `plate_pose` says so but in runs in which that jumps. A run arrives if
the controller says so and the goal's object is within the tolerance, in truth or as it was measured: of a bias the
part along the contact, or common to all that is measured, cannot be told from a goal that is elsewhere.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from closed_loop import several_pushes, way_of
from numpy.typing import ArrayLike

from pushplan.bench.store import Machine
from pushplan.core.slip import Trace
from pushplan.geometry.se2 import compose, exp, inverse, relative, rotate, twist_of, wrap_angle
from pushplan.mechanics.contacts import carried_objects
from pushplan.plans.execution import wilson
from pushplan.plans.goals import tolerance_of, worst_at_goal
from pushplan.plans.plan import Plan
from pushplan.plans.run import collapsed
from pushplan.scenario.file import example_names, load_scenario, scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.sim.control.aim import Aim
from pushplan.sim.control.controller import Controller
from pushplan.sim.control.jobs import Phase
from pushplan.sim.control.sensing import Sensor
from pushplan.sim.control.settings import ControlSettings
from pushplan.sim.control.simulated_push import Disturbance, SimulatedPush, Simulator, simulate_push
from pushplan.sim.physics.simulator import PhysicsSimulator
from pushplan.slip.simulator import SlipSimulator
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray

MOST_REPLANS, MOST_EVENTS = 3, 20
LONGEST = 200.0
"""Simulated seconds."""
DEG = math.pi / 180.0
HEALED = 0.5
"""Time after which a contact has put back what it can, s."""
RATE, ON_ARCS, ANYWHERE = 0.01, 8e-3, 15e-3
"""Slides: m a metre, and by how much (m) they may go on unnoticed on arcs, and on arcs and straights together."""
BENT = 0.05
"""Curvature (1/m) from which on the plate is on an arc."""
STOPS = ("deviation", "re-localisation")
"""Events with which the loop looks where objects are."""


@dataclass(frozen=True)
class Errors:
    """What is wrong with the sensors; directions and signs are drawn by seed.

    Attributes:
        bias: m, along a direction that is one for all objects (odd seeds: in the world; even: in their own frames).
        turned: rad, of every measured heading.
        clock: s, by which stamps are late.
        unstamped: s, by which measurements are late that have no stamps.
        odometry: Scale of the way and share that it drifts aside, and scale in turns, that the wheels go too far.
        noise: Standard deviations, m and rad.
        start: m and rad, of the plate.
        jump: m and rad, of the localisation half-way; the plate's pose is measured then.
        unseen: Share of times that an object is not seen.
        wrong: m, by which one object is seen elsewhere in one frame every 2 s.
        outage: s, without any measurement, once.
        swapped: s, for which the first two objects are taken for one another, once.
    """

    bias: float = 0.0
    turned: float = 0.0
    clock: float = 0.0
    unstamped: float = 0.0
    odometry: tuple[float, float, float] = (0.0, 0.0, 0.0)
    noise: tuple[float, float] = (1e-3, 0.3 * DEG)
    start: tuple[float, float] = (0.0, 0.0)
    jump: tuple[float, float] = (0.0, 0.0)
    unseen: float = 0.0
    wrong: float = 0.0
    outage: float = 0.0
    swapped: float = 0.0

    def and_(self, other: Errors) -> Errors:
        """Return both errors together; of the same number, the first one."""
        nominal, mine = Errors(), vars(self)
        return Errors(**{k: _either(mine[k], v, getattr(nominal, k)) for k, v in vars(other).items()})


def _either(mine: Any, other: Any, nominal: Any) -> Any:
    if isinstance(mine, tuple):
        return tuple(map(_either, mine, other, nominal))
    return other if mine == nominal else mine


ERRORS = {
    "none": Errors(),
    "bias 2 mm": Errors(bias=2e-3),
    "bias 4 mm": Errors(bias=4e-3),
    "bias 1 deg": Errors(turned=DEG),
    "clock +20 ms": Errors(clock=0.02),
    "clock -20 ms": Errors(clock=-0.02),
    "clock +30 ms": Errors(clock=0.03),
    "clock -30 ms": Errors(clock=-0.03),
    "lag 0.15 s": Errors(unstamped=0.15),
    "odometry 1 %": Errors(odometry=(0.01, 0.0, 0.0)),
    "odometry 3 %": Errors(odometry=(0.03, 0.0, 0.0)),
    "sideways 1 %": Errors(odometry=(0.0, 0.01, 0.0)),
    "turns 1 %": Errors(odometry=(0.0, 0.0, 0.01)),
    "noise 2 mm": Errors(noise=(2e-3, 0.6 * DEG)),
    "start 3 mm": Errors(start=(3e-3, 0.5 * DEG)),
    "jump 30 mm": Errors(jump=(0.03, DEG)),
    "unseen 30 %": Errors(unseen=0.3),
}
ALL = Errors(
    bias=3e-3,
    turned=0.7 * DEG,
    clock=0.025,
    odometry=(0.015, 0.0, 0.0),
    unseen=0.02,
    wrong=0.05,
    outage=8.0,
    swapped=2.0,
)
"""What goes wrong in the matrix, beside a friction of contacts that is 20 % less and an object that is displaced."""
MATRIX = {
    "single": ("two-crates", "carts", "hook", "one-box", "feet", "trapezoids"),
    "several": ("bring-it-home", "load-2", "load-16", "boxes-3", "in-a-row"),
}
IN_A_ROW = """\
format: pushplan/1
name: in-a-row
floor: {friction: 0.30}
objects:
  - {name: left, shape: {box: [0.15, 0.20]}, mass: 1.0, pose: [1.0, 1.0, 0.0]}
  - {name: right, shape: {box: [0.20, 0.20]}, mass: 1.2, pose: [1.8, 1.2, 20 deg]}
contacts: {friction: 0.50}
pusher: {width: 0.28, friction: 0.50}
robot: {footprint: {box: [0.42, 0.285], pose: [-0.225, 0, 0]}, start: [0.5, 0.5, 0.0]}
goals: {row: {of: [left, right], pose: [2.4, 1.6, 0.0]}}
gather: always
workspace: {x: [0.0, 3.6], y: [0.0, 3.6]}
"""


@dataclass(eq=False)
class Erring:
    """A robot whose eyes and wheels err.

    Attributes:
        controller: What it drives by.
        errors: What is wrong.
        random: Draws.
        half: When the localisation jumps, s; outages begin at half of that, exchanged names at one and a half.
        seen: The last measurement.
    """

    controller: Controller
    errors: Errors
    random: np.random.Generator
    half: float
    seen: FloatArray | None = None
    due: float = 2.0
    shift: FloatArray = field(init=False)
    own: bool = field(init=False)
    sign: float = field(init=False)
    plate: FloatArray = field(init=False)
    wheels: FloatArray = field(init=False)
    leap: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        way, jump = self.random.uniform(-math.pi, math.pi, 2)
        self.own, self.sign = bool(self.random.integers(2)), float(self.random.choice([-1.0, 1.0]))
        e = self.errors
        turned = self.sign * e.turned
        self.shift = np.array([e.bias * math.cos(way), e.bias * math.sin(way), turned])
        self.leap = np.array([e.jump[0] * math.cos(jump), e.jump[0] * math.sin(jump), self.sign * e.jump[1]])
        self.plate = np.array(self.controller.scenario.plate_start)
        pusher = self.controller.scenario.pusher
        self.wheels = relative(pusher.plate_pose, pusher.wheels_pose)

    def step(self, now: float, object_poses: ArrayLike | None = None, measured_at: float | None = None) -> FloatArray:
        e, rows = self.errors, None
        if object_poses is not None and measured_at is not None:
            poses = np.asarray(object_poses)
            poses = compose(poses, self.shift) if self.own else poses + self.shift
            if e.wrong and now >= self.due:
                self.due, way = now + 2.0, self.random.uniform(-math.pi, math.pi)
                poses[self.random.integers(len(poses)), :2] += [e.wrong * math.cos(way), e.wrong * math.sin(way)]
            if 0.0 <= now - 1.5 * self.half < e.swapped:
                poses[:2] = poses[:2][::-1].copy()
            rows = np.where(self.random.random(len(poses))[:, None] < e.unseen, np.nan, poses)
            measured_at = None if e.unstamped else measured_at + e.clock
            self.seen = poses
            if 0.0 <= now - 0.5 * self.half < e.outage:
                rows = measured_at = None
        plate = None
        if any(e.jump):
            plate = self.plate if now < self.half else compose(self.leap, self.plate)
        twist = np.asarray(self.controller.step(now, rows, measured_at, plate))
        v, crab, turn = np.array(e.odometry) * self.sign
        rolled = twist_of(self.wheels, twist)
        done = [
            (1 + v) * rolled[0] - crab * rolled[1],
            (1 + v) * rolled[1] + crab * rolled[0],
            (1 + turn) * rolled[2],
        ]
        done = twist_of(inverse(self.wheels), done)
        self.plate = compose(self.plate, exp(done / self.controller.settings.rate))
        return done


@dataclass(frozen=True)
class Row:
    """Result of one run."""

    name: str
    arrived: bool
    outcome: str
    error: tuple[float, float]
    replans: int
    travel: float
    planned: float
    noticed: bool | None
    seconds: float
    stops: int
    """For an object off its place, before anything had happened."""
    left: tuple[float, float]
    """What of a disturbance is left 0.5 s later, m and rad."""
    slid: tuple[float, float]
    """How far a slide had gone on arcs, and at all, when it was noticed or all was over, m."""
    events: int = 0
    longer: float = 1.0
    """How many lines of events are printed, and the time of the run over that of the plan."""

    @property
    def good(self) -> bool:
        """Whether it arrived correctly."""
        return self.arrived and self.replans <= MOST_REPLANS

    @property
    def missed(self) -> bool:
        """Whether a lasting deviation went unnoticed for too long."""
        usual = ControlSettings()
        put_back = self.left[0] <= usual.position_slack and self.left[1] <= usual.angle_slack
        late = self.slid[0] > ON_ARCS or self.slid[1] > ANYWHERE
        return late or (self.noticed is False and not put_back)


class Sliding(SlipSimulator):
    """A world in which what a contact pushes slides along it, from a way on and until the loop looks.

    Attributes:
        slid: How far on arcs, and at all, m.
        since: When it began, s; infinite before.
    """

    def __init__(self, world: World, controller: Controller, begin: float, contact: int, side: float) -> None:
        super().__init__(world)
        self._controller, self._begin, self._side, self._way = controller, begin, side, 0.0
        self._moved = carried_objects(world.chain)[contact]
        self._tangent, self._told = world.chain.contacts[contact].tangent, 0
        self.slid, self.since, self._time = (0.0, 0.0), math.inf, 0.0

    def move(self, twist: ArrayLike, duration: float) -> Trace:
        """Move like any world, and let the objects slide."""
        trace = super().move(twist, duration)
        x, y, turn = np.asarray(twist) * duration
        step, events = float(math.hypot(x, y)), self._controller.events
        self._way, self._time = self._way + step, self._time + duration
        if self.since == math.inf and self._way > self._begin and self._controller.phase is Phase.PUSHING:
            self.since, self._told = self._time, len(events)
        noticed = any(event.kind in STOPS for event in events[self._told :])
        if self.since < math.inf and not noticed and not self.jammed and self.slid[1] <= 2.0 * ANYWHERE:
            poses = self.object_poses
            shift = rotate(float(self.plate_pose[2]), self._side * RATE * step * self._tangent)
            poses[self._moved, :2] += shift
            self.place(poses, self.plate_pose)
            bent = float(abs(turn) > BENT * step)
            self.slid = self.slid[0] + bent * RATE * step, self.slid[1] + RATE * step
        return trace


@dataclass(frozen=True)
class Job:
    """A run to be made: names of scenario and error, the errors, the seed, and what happens."""

    name: str
    error: str
    errors: Errors
    seed: int
    what: str


@cache
def _first(name: str) -> tuple[Scenario, Plan]:
    scenario = load_scenario(name)
    return scenario, Controller(scenario).plan


def run(job: Job) -> Row:
    """Run one scenario with one error."""
    scenario, plan = _first(job.name)
    assert plan.trajectory is not None
    random = np.random.default_rng([job.seed, *job.name.encode()])
    controller = Controller(scenario, plan=plan)
    robot = Erring(controller, job.errors, random, 0.5 * plan.trajectory.duration)
    world, disturbance = World.from_scenario(scenario), None
    if job.errors.start != (0.0, 0.0):
        world = _beside(world, job.errors.start, random)
    random = np.random.default_rng([job.seed, *f"{job.name} {job.error}".encode()])  # every error has others
    if job.what == "disturbances":
        world, disturbance = _disturbed(world, plan.trajectory.duration, random)
    simulator: Simulator = SlipSimulator(world)
    planned = way_of(plan.trajectory.poses)
    if job.what == "slides":
        begin, contact = random.uniform(0.1, 0.7) * planned, int(random.integers(len(world.names)))
        simulator = Sliding(world, controller, begin, contact, random.choice([-1.0, 1.0]))
    sensor = Sensor(delay=job.errors.unstamped or 0.1, position=job.errors.noise[0], angle=job.errors.noise[1])
    began = time.process_time()
    course = simulate_push(
        world,
        controller,
        controller.settings.rate,
        [disturbance] if disturbance else [],
        sensor,
        job.seed,
        time_limit=LONGEST,
        simulator_of=lambda _: simulator,
        step=robot.step,
    )
    seconds = time.process_time() - began
    aim = Aim.of(scenario.goal, scenario.chain, 5e-3, DEG)
    end = course.object_poses[-1]
    last = compose(end, robot.shift) if robot.own else end + robot.shift
    there = any(bool((aim.errors(poses) <= 1.05 * aim.tolerance).all()) for poses in (end, last))
    outcome = "jammed" if course.jammed else controller.reason or controller.phase.value
    noticed, left, since, slid = None, (0.0, 0.0), math.inf, (0.0, 0.0)
    if disturbance is not None:
        since, left = disturbance.time, _left(course, disturbance.time)
        noticed = any(e.kind in STOPS and 0.0 <= e.time - since <= 1.0 for e in controller.events)
    elif isinstance(simulator, Sliding):
        since, slid = simulator.since, simulator.slid
        noticed = any(e.kind == "deviation" and e.time >= since for e in controller.events)
    error = aim.errors(end)
    return Row(
        job.name,
        controller.phase is Phase.ARRIVED and there,
        "arrived elsewhere" if outcome == "arrived" and not there else outcome,
        (float(error[0]), float(error[1])),
        sum(replan.solved for replan in controller.replans),
        way_of(course.poses),
        planned,
        noticed,
        seconds,
        sum(e.kind == "deviation" and e.time < since for e in controller.events),
        left,
        slid,
    )


@cache
def _problem(name: str) -> tuple[Scenario, Plan]:
    """Return a scenario of the matrix and its first plan."""
    if name in MATRIX["single"]:
        return _first(name)
    if "-" in name and name.rpartition("-")[2].isdigit():
        scenario, _ = next(several_pushes([name]))
        return scenario, Controller(scenario).plan
    file = Path(__file__).parents[1] / "examples" / f"{name.replace('-', '_')}.yaml"
    scenario = scenario_from_text(IN_A_ROW) if name == "in-a-row" else load_scenario(file)
    return scenario, Controller(scenario).plan


def endure(job: Job) -> Row:
    """Run a problem of the matrix."""
    scenario, plan = _problem(job.name)
    assert plan.trajectory is not None
    random = np.random.default_rng([job.seed, *job.name.encode()])
    controller = Controller(scenario, plan=plan)
    robot = Erring(controller, job.errors, random, 0.5 * plan.trajectory.duration)
    world = World.from_scenario(scenario).with_contact_friction(0.8)
    hit = _kick(plan.trajectory.duration, len(world.names), random)
    began, made = time.process_time(), PhysicsSimulator if job.what == "physics" else SlipSimulator
    course = simulate_push(
        world, controller, controller.settings.rate, [hit], seed=job.seed, simulator_of=made, step=robot.step
    )
    allowed = np.add(tolerance_of(controller.scenario, 5e-3, DEG), [ALL.bias, ALL.turned])
    error = worst_at_goal(controller.scenario, course.object_poses[-1])
    says = controller.phase is Phase.ARRIVED
    there = says and bool((np.array(error) <= allowed).all())
    outcome = "jammed" if course.jammed else controller.reason or controller.phase.value
    return Row(
        job.name,
        there,
        "arrived elsewhere" if says and not there else outcome,
        error,
        sum(replan.solved for replan in controller.replans),
        way_of(course.poses),
        way_of(plan.trajectory.poses),
        None,
        time.process_time() - began,
        0,
        (0.0, 0.0),
        (0.0, 0.0),
        len(collapsed(controller.events)),
        float(course.t[-1] / plan.trajectory.duration),
    )


def matrix(kind: str, only: Sequence[str], seeds: Sequence[int], what: str, jobs: int, verbose: bool) -> None:
    """Run the problems of a kind, and print a line for each bad run, each problem, and all together."""
    every, names = list[Row](), [name for name in MATRIX[kind] if name in (only or [name])]
    with ProcessPoolExecutor(jobs) as pool:
        asked = [Job(name, "all", ALL, seed, what) for name in names for seed in seeds]
        for row, job in zip(pool.map(endure, asked), asked, strict=True):
            every.append(row)
            if verbose or not row.arrived or row.events > MOST_EVENTS:
                off = f"{1e3 * row.error[0]:.1f} mm {row.error[1] / DEG:.2f} deg"
                way = f"{row.travel:.1f} of {row.planned:.1f} m in {row.longer:.1f} of the time"
                print(f"{row.name:14} {job.seed:4} {way}, {row.events} lines, {off}: {row.outcome}", flush=True)
    good, told = sum(row.arrived for row in every), [row.events for row in every]
    print(
        f"{kind}{', MuJoCo' * (what == 'physics')}: {good} of {len(every)} good, "
        f"{sum(row.outcome == 'arrived elsewhere' for row in every)} arrived elsewhere; travel "
        f"{np.median([row.travel / row.planned for row in every]):.2f} of the plan's, {np.median(told):.0f} lines, "
        f"at most {max(told)}; {sum(row.seconds for row in every):.0f} s of CPU"
    )


def _disturbed(world: World, duration: float, random: np.random.Generator) -> tuple[World, Disturbance]:
    """Return a world with other frictions, and a disturbance."""
    for name in world.names:
        world = world.with_contact_friction(1.0 + 0.2 * random.choice([-1.0, 1.0]), name)
        world = world.with_floor_friction(1.0 + 0.2 * random.choice([-1.0, 1.0]), name)
    return world, _kick(duration, len(world.names), random)


def _kick(duration: float, count: int, random: np.random.Generator) -> Disturbance:
    way, turn = random.uniform(-math.pi, math.pi), 3.0 * DEG * random.choice([-1.0, 1.0])
    at, index = random.uniform(0.1, 0.9) * duration, int(random.integers(count))
    return Disturbance(at, index, 5e-3 * math.cos(way), 5e-3 * math.sin(way), turn)


def _left(course: SimulatedPush, time: float) -> tuple[float, float]:
    """Return the largest displacement (m, rad) of an object on the plate, `HEALED` after a disturbance."""
    k = np.searchsorted(course.t, [time - 1e-9, time + HEALED]) - [1, 0]
    before, after = (relative(course.poses[i], course.object_poses[i]) for i in np.clip(k, 0, len(course.t) - 1))
    apart = relative(before, after)
    return float(np.hypot(*apart[:, :2].T).max()), float(np.abs(wrap_angle(apart[:, 2])).max())


def _beside(world: World, off: tuple[float, float], random: np.random.Generator) -> World:
    """Return the world with a pose error of the plate that keeps its contact; the objects have a lateral offset."""
    way, sign = random.uniform(-math.pi, math.pi), random.choice([-1.0, 1.0])
    shift = np.array([off[0] * math.cos(way), off[0] * math.sin(way), sign * off[1]])
    return replace(world, start=compose(world.start, shift))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="*", default=[101, 102, 103])
    parser.add_argument("--only", nargs="*", help="names of scenarios")
    parser.add_argument("--filter", nargs="*", help="parts of names of errors")
    parser.add_argument("--pairs", type=int, default=12, help="pairs of errors, drawn by the first seed")
    happens = parser.add_mutually_exclusive_group()
    for what in ("disturbances", "slides"):
        happens.add_argument(f"--{what}", dest="what", action="store_const", const=what, default="")
    parser.add_argument("--matrix", choices=list(MATRIX), help="everything goes wrong at once, instead")
    parser.add_argument("--physics", action="store_true", help="in MuJoCo (extra `physics`)")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--verbose", action="store_true", help="print runs that do not arrive")
    asked = parser.parse_args()
    time.perf_counter = time.process_time  # searches then count CPU time, whatever else the machine does
    print(Machine.this().words)
    if asked.matrix:
        what = "physics" if asked.physics else ""
        matrix(asked.matrix, asked.only, asked.seeds, what, asked.jobs, asked.verbose)
        return 0
    errors = dict(ERRORS)
    random, names = np.random.default_rng(asked.seeds[0]), list(ERRORS)[1:]
    for _ in range(asked.pairs):
        first, second = (names[i] for i in random.choice(len(names), 2, replace=False))
        errors[f"{first}, {second}"] = ERRORS[first].and_(ERRORS[second])
    if asked.filter:
        errors = {name: e for name, e in errors.items() if any(part in name for part in asked.filter)}
    scenarios = [n for n in example_names() if load_scenario(n).kind == "push" and n in (asked.only or [n])]
    jobs = [Job(n, e, errors[e], s, asked.what) for e in errors for n in scenarios for s in asked.seeds]
    every: list[Row] = []
    with ProcessPoolExecutor(asked.jobs) as pool:
        rows: Callable[[], Row] = iter(pool.map(run, jobs, chunksize=len(asked.seeds))).__next__
        for name in errors:
            found = [rows() for _ in range(len(scenarios) * len(asked.seeds))]
            every += found
            print(f"{name:30} {_words(found)}", flush=True)
            for row in found if asked.verbose else ():
                if not row.good or row.missed or row.stops:
                    print(f"    {row.name}: {_told(row)}")
    print(f"{'all':30} {_words(every)}")
    return 0


def _told(row: Row) -> str:
    left, slid = row.left, row.slid
    off = f"{1e3 * row.error[0]:.1f} mm {row.error[1] / DEG:.2f} deg"
    way = f"{row.replans} replans, {row.travel:.1f} of {row.planned:.1f} m, {off}: {row.outcome}"
    way += f"; {row.stops} stops for nothing" if row.stops else ""
    if row.missed:
        way += f"; missed: left {1e3 * left[0]:.1f} mm {left[1] / DEG:.2f} deg"
        way += f", slid {1e3 * slid[0]:.1f} mm on arcs of {1e3 * slid[1]:.1f} mm"
    return way


def _words(rows: list[Row]) -> str:
    good = sum(row.good for row in rows)
    low, high = wilson(good, len(rows))
    travel = np.array([row.travel / row.planned for row in rows])
    far = sum(row.travel > 2.0 * row.planned + 1.0 for row in rows)
    noticed = f", {sum(row.stops > 0 for row in rows)} stop for nothing"
    if any(row.noticed is not None for row in rows):
        seen, missed = (sum(bool(row.noticed) and not row.missed for row in rows), sum(row.missed for row in rows))
        rest = "ended before" if any(row.slid[1] for row in rows) else "put back"
        noticed += f"; {seen} noticed, {len(rows) - seen - missed} {rest}, {missed} missed"
    return (
        f"{good:3} of {len(rows):3} ({100 * low:.0f} to {100 * high:.0f} %), travel {np.median(travel):.2f}, "
        f"{far} beyond 2 x + 1 m, {np.mean([row.replans for row in rows]):.1f} replans, "
        f"{np.mean([row.seconds for row in rows]):.1f} s{noticed}"
    )


if __name__ == "__main__":
    sys.exit(main())
