"""The closed loop where sensors and robots err: every packaged push with each error, in the world as planned.

Run `python benchmarks/sensors.py [--seeds 101 102 103] [--only NAME ...] [--filter ERROR ...] [--disturbances]
[--jobs 2]`; prints a line an error: runs that arrive with at most three replans, travel over the plan's, and how many
stop although nothing happened. Tuned on seeds 1 to 3, judged on 101 to 103. `--told` gives today's noise to the
settings. `--filter none --pairs 0 --seeds 1 2 3 4 5 6 7 8 9` are 108 runs in which nothing is wrong.

`--disturbances` (5 mm and 3 deg at 0.1 to 0.9 of the time, friction off by 20 %) tells how many of them are noticed
within a second. Where they are not, the simulator says what they left: an object that stands again where it stood on
the plate, to 2.5 mm and 0.5 deg (`position_slack`, `angle_slack`) 0.3 s later, was put back by the contact. All
others are missed.

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
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from pushplan.bench.machine import Machine
from pushplan.geometry.se2 import compose, exp, relative, wrap_angle
from pushplan.plans.load import Load
from pushplan.plans.plan import Plan
from pushplan.scenario.file import example_names, load_scenario
from pushplan.scenario.model import Scenario
from pushplan.sim.control.controller import Controller
from pushplan.sim.control.pushing import Phase
from pushplan.sim.control.replanner import Aim
from pushplan.sim.control.sensing import Sensor
from pushplan.sim.control.settings import ControlSettings
from pushplan.sim.control.simulated_push import Disturbance, SimulatedPush, simulate_push
from pushplan.sim.world import World
from pushplan.util.arrays import FloatArray
from pushplan.util.wilson import wilson

MOST_REPLANS = 3
LONGEST = 200.0
"""Simulated seconds."""
DEG = math.pi / 180.0
HEALED = 0.3
"""Time after which a contact has put back what it can, s."""


@dataclass(frozen=True)
class Errors:
    """What is wrong with the sensors; directions and signs are drawn by seed.

    Attributes:
        bias: m, along a direction that is one for all objects (odd seeds: in the world; even: in their own frames).
        turned: rad, of every measured heading.
        clock: s, by which stamps are late.
        unstamped: s, by which measurements are late that have no stamps.
        odometry: Scale of the way and share that it drifts aside, and scale in turns, that the plate goes too far.
        noise: Standard deviations, m and rad.
        start: m and rad, of the plate.
        jump: m and rad, of the localisation half-way; the plate's pose is measured then.
        unseen: Share of times that an object is not seen.
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

    def and_(self, other: Errors) -> Errors:
        """Return both errors at once."""
        nominal, mine = Errors(), vars(self)
        return Errors(**{k: v if mine[k] == getattr(nominal, k) else mine[k] for k, v in vars(other).items()})


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


@dataclass(eq=False)
class Erring:
    """A controller whose eyes and wheels err; see `course.Driver`.

    Attributes:
        controller: What is judged.
        errors: What is wrong.
        random: Draws.
        half: When the localisation jumps, s.
        seen: The last measurement.
    """

    controller: Controller
    errors: Errors
    random: np.random.Generator
    half: float
    seen: FloatArray | None = None
    shift: FloatArray = field(init=False)
    own: bool = field(init=False)
    sign: float = field(init=False)
    plate: FloatArray = field(init=False)
    leap: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        way, jump = self.random.uniform(-math.pi, math.pi, 2)
        self.own, self.sign = bool(self.random.integers(2)), float(self.random.choice([-1.0, 1.0]))
        e = self.errors
        turned = self.sign * e.turned
        self.shift = np.array([e.bias * math.cos(way), e.bias * math.sin(way), turned])
        self.leap = np.array([e.jump[0] * math.cos(jump), e.jump[0] * math.sin(jump), self.sign * e.jump[1]])
        self.plate = np.array(self.controller.scenario.plate_start)

    @property
    def load(self) -> Load | None:
        return self.controller.load

    @property
    def segment(self) -> int:
        return self.controller.segment

    @property
    def over(self) -> bool:
        return self.controller.over

    def step(
        self, now: float, object_poses: ArrayLike | None = None, measured_at: float | None = None
    ) -> FloatArray:
        e, rows = self.errors, None
        if object_poses is not None and measured_at is not None:
            poses = np.asarray(object_poses)
            poses = compose(poses, self.shift) if self.own else poses + self.shift
            rows = np.where(self.random.random(len(poses))[:, None] < e.unseen, np.nan, poses)
            measured_at = None if e.unstamped else measured_at + e.clock
            self.seen = poses
        plate = None
        if any(e.jump):
            plate = self.plate if now < self.half else compose(self.leap, self.plate)
        twist = np.asarray(self.controller.step(now, rows, measured_at, plate))
        v, crab, turn = np.array(e.odometry) * self.sign
        done = np.array(
            [
                (1 + v) * twist[0] - crab * twist[1],
                (1 + v) * twist[1] + crab * twist[0],
                (1 + turn) * twist[2],
            ]
        )
        self.plate = compose(self.plate, exp(done / self.controller.settings.rate))
        return done


@dataclass(frozen=True)
class Row:
    """One run."""

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
    """What of a disturbance is left 0.3 s later, m and rad."""


@cache
def _first(name: str, told: bool) -> tuple[Scenario, Plan]:
    scenario = load_scenario(name)
    return scenario, Controller(scenario, _settings(told)).plan


def _settings(told: bool) -> ControlSettings:
    usual = ControlSettings()
    return replace(usual, position_noise=2e-3, angle_noise=0.6 * DEG) if told else usual


def run(job: tuple[str, str, Errors, int, bool, bool]) -> Row:
    """Run one scenario with one error."""
    name, _, errors, seed, disturbances, told = job
    scenario, plan = _first(name, told)
    assert plan.trajectory is not None
    assert plan.path is not None
    random = np.random.default_rng([seed, *name.encode()])
    controller = Controller(scenario, _settings(told), plan=plan)
    driver = Erring(controller, errors, random, 0.5 * plan.trajectory.duration)
    world, disturbance = World.from_scenario(scenario), None
    if errors.start != (0.0, 0.0):
        world = _beside(world, errors.start, random)
    if disturbances:
        for obj in scenario.chain.objects:
            world = world.with_contact_friction(1.0 + 0.2 * random.choice([-1.0, 1.0]), obj.name)
            world = world.with_floor_friction(1.0 + 0.2 * random.choice([-1.0, 1.0]), obj.name)
        way, turn = random.uniform(-math.pi, math.pi), 3.0 * DEG * random.choice([-1.0, 1.0])
        at, index = (
            random.uniform(0.1, 0.9) * plan.trajectory.duration,
            int(random.integers(len(world.names))),
        )
        disturbance = Disturbance(at, index, 5e-3 * math.cos(way), 5e-3 * math.sin(way), turn)
    sensor = Sensor(delay=errors.unstamped or 0.1, position=errors.noise[0], angle=errors.noise[1])
    began = time.process_time()
    course = simulate_push(
        world,
        driver,
        controller.settings.rate,
        [disturbance] if disturbance else [],
        sensor,
        seed,
        time_limit=LONGEST,
    )
    aim = Aim.of(scenario.goal, scenario.chain, 5e-3, DEG)
    true = aim.errors(course.object_poses[-1])
    last = (
        compose(course.object_poses[-1], driver.shift)
        if driver.own
        else course.object_poses[-1] + driver.shift
    )
    there = any(
        (aim.errors(poses) <= 1.05 * aim.tolerance).all() for poses in (course.object_poses[-1], last)
    )
    arrived = controller.phase is Phase.ARRIVED and bool(there)
    replans = sum(replan.solved for replan in controller.replans)
    travel = float(np.hypot(*np.diff(course.poses[:, :2], axis=0).T).sum())
    noticed, left, until = None, (0.0, 0.0), math.inf
    if disturbance is not None:
        stops, until = ("deviation", "re-localisation", "slide", "bump"), disturbance.time
        noticed = any(e.kind in stops and 0.0 <= e.time - until <= 1.0 for e in controller.events)
        left = _left(course, until)
    false = sum(e.kind == "deviation" and e.time < until for e in controller.events)
    outcome = "jammed" if course.jammed else controller.reason or controller.phase.value
    outcome = "arrived elsewhere" if outcome == "arrived" and not there else outcome
    planned = float(np.hypot(*np.diff(plan.trajectory.poses[:, :2], axis=0).T).sum())
    error = float(true[0]), float(true[1])
    seconds = time.process_time() - began
    return Row(name, arrived, outcome, error, replans, travel, planned, noticed, seconds, false, left)


def _left(course: SimulatedPush, time: float) -> tuple[float, float]:
    """Return how far (m, rad) the worst object is, `HEALED` after a disturbance, from where it stood on the plate."""
    k = np.searchsorted(course.t, [time - 1e-9, time + HEALED]) - [1, 0]
    before, after = (
        relative(course.poses[i], course.object_poses[i]) for i in np.clip(k, 0, len(course.t) - 1)
    )
    apart = relative(before, after)
    return float(np.hypot(*apart[:, :2].T).max()), float(np.abs(wrap_angle(apart[:, 2])).max())


def _beside(world: World, off: tuple[float, float], random: np.random.Generator) -> World:
    """Return the world with the plate off where it is believed to be, and still in contact: objects stand aside."""
    way, sign = random.uniform(-math.pi, math.pi), random.choice([-1.0, 1.0])
    shift = np.array([off[0] * math.cos(way), off[0] * math.sin(way), sign * off[1]])
    return replace(world, start=compose(world.start, shift))


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, nargs="*", default=[101, 102, 103])
    parser.add_argument("--only", nargs="*", help="names of scenarios")
    parser.add_argument("--filter", nargs="*", help="parts of names of errors")
    parser.add_argument("--pairs", type=int, default=12, help="pairs of errors, drawn by the first seed")
    parser.add_argument("--disturbances", action="store_true")
    parser.add_argument("--told", action="store_true", help="settings know of noise of 2 mm and 0.6 deg")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--verbose", action="store_true", help="print runs that do not arrive")
    asked = parser.parse_args()
    time.perf_counter = time.process_time  # searches then count CPU time, whatever else the machine does
    print(Machine.this().words)
    errors = dict(ERRORS)
    random, names = np.random.default_rng(asked.seeds[0]), list(ERRORS)[1:]
    for _ in range(asked.pairs):
        first, second = (names[i] for i in random.choice(len(names), 2, replace=False))
        errors[f"{first}, {second}"] = ERRORS[first].and_(ERRORS[second])
    if asked.filter:
        errors = {name: e for name, e in errors.items() if any(part in name for part in asked.filter)}
    scenarios = [n for n in example_names() if load_scenario(n).kind == "push" and n in (asked.only or [n])]
    jobs = [
        (n, e, errors[e], s, asked.disturbances, asked.told)
        for e in errors
        for n in scenarios
        for s in asked.seeds
    ]
    every: list[Row] = []
    with ProcessPoolExecutor(asked.jobs) as pool:
        rows: Callable[[], Row] = iter(pool.map(run, jobs, chunksize=len(asked.seeds))).__next__
        for name in errors:
            found = [rows() for _ in range(len(scenarios) * len(asked.seeds))]
            every += found
            print(f"{name:30} {_words(found)}", flush=True)
            for row in found if asked.verbose else ():
                if row.noticed is False or row.stops:
                    left = f"{1e3 * row.left[0]:.1f} mm {row.left[1] / DEG:.2f} deg"
                    how = "" if row.noticed is not False else "put back" if _healed(row) else "missed"
                    print(f"    {row.name}: {row.stops} stops for nothing; left {left} {how}")
                if not (row.arrived and row.replans <= MOST_REPLANS):
                    off = f"{1e3 * row.error[0]:.1f} mm {row.error[1] / DEG:.2f} deg"
                    way = f"{row.replans} replans, {row.travel:.1f} of {row.planned:.1f} m"
                    print(f"    {row.name}: {way}, {off}: {row.outcome}")
    print(f"{'all':30} {_words(every)}")
    return 0


def _healed(row: Row) -> bool:
    usual = ControlSettings()
    return row.left[0] <= usual.position_slack and row.left[1] <= usual.angle_slack


def _words(rows: list[Row]) -> str:
    good = sum(row.arrived and row.replans <= MOST_REPLANS for row in rows)
    low, high = wilson(good, len(rows))
    travel = np.array([row.travel / row.planned for row in rows])
    far = sum(row.travel > 2.0 * row.planned + 1.0 for row in rows)
    disturbed = [row for row in rows if row.noticed is not None]
    unnoticed = [row for row in disturbed if not row.noticed]
    missed = [row for row in unnoticed if not _healed(row)]
    noticed = f", {sum(row.stops > 0 for row in rows)} stop for nothing"
    if disturbed:
        put = len(unnoticed) - len(missed)
        noticed += (
            f", disturbances: {len(disturbed) - len(unnoticed)} noticed, {put} put back, {len(missed)} missed"
        )
    return (
        f"{good:3} of {len(rows):3} ({100 * low:.0f} to {100 * high:.0f} %), travel {np.median(travel):.2f}, "
        f"{far} beyond 2 x + 1 m, {np.mean([row.replans for row in rows]):.1f} replans, "
        f"{np.mean([row.seconds for row in rows]):.1f} s{noticed}"
    )


if __name__ == "__main__":
    sys.exit(main())
