"""The closed loop with errors of sensors and robots: every packaged push with each error, in the nominal world.

    python benchmarks/sensors.py [--seeds 101 102 103] [--only NAME ...] [--filter ERROR ...] [--pairs 12]
        [--disturbances | --slides | --matrix KIND [--physics]] [--jobs 2]

Prints a line for each error, and one for each run that does not arrive. Seeds 1 to 3 were used for tuning. An error
of the camera lies between world and controller. An error of odometry lies between controller and world: the plate
moves otherwise than commanded, and `plate_pose` is given only in runs in which it jumps. A run arrives if the
controller says so after at most three replans, and the goal's object is within the tolerance, by its true pose or as
measured: a camera offset that all objects share cannot be told from another goal.

`--disturbances`: 5 mm and 3 deg at 0.1 to 0.9 of the time, frictions off by 20 %. Counts the disturbances that are
noticed within a second. The contact put the others back if the object stands within 2.5 mm and 0.5 deg of its place
on the plate 0.5 s later (`position_slack`, `angle_slack`); else they are missed.

`--slides`: the objects slide along a contact by 10 mm a metre, from 0.1 to 0.7 of the path until the loop looks.
Counts slides that are noticed before 8 mm of them lie on arcs, or 15 mm anywhere.

`--matrix single` or `several`: everything goes wrong at once (`ALL`) in single pushes or multi-push plans, also in
MuJoCo. A run arrives if the controller says so and all true poses are within the tolerance and the camera's error.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from closed_loop import WITHIN, displaced, outcome_of, several_pushes, travel_of, with_other_friction
from numpy.typing import ArrayLike
from script import options, share

from pushplan.core.slip import Trace
from pushplan.geometry.se2 import compose, exp, inverse, relative, rotate, twist_of, wrap_angle
from pushplan.mechanics.contacts import carried_objects
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
from pushplan.sim.control.simulated_push import TIME_LIMIT, Disturbance, SimulatedPush, Simulator, simulate_push
from pushplan.sim.physics.simulator import PhysicsSimulator
from pushplan.slip.simulator import SlipSimulator
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray

MOST_REPLANS = 3
LONGEST = (200.0, TIME_LIMIT)
"""Largest simulated time of a run with one error, and with all, s."""
DEG = math.pi / 180.0
HEALED = 0.5
"""Time after which a contact has put back what it can, s."""
RATE, ON_ARCS, ANYWHERE = 0.01, 8e-3, 15e-3
"""Slides: m a metre, and how far (m) they may go unnoticed on arcs, and on arcs and straights together."""
BENT = 0.05
"""Curvature (1/m) from which on the plate is on an arc."""
STOPS = ("deviation", "re-localisation")
"""Events with which the loop looks where objects are."""


@dataclass(frozen=True)
class Errors:
    """Errors of the sensors; directions and signs are drawn by seed.

    Attributes:
        bias: m, along a direction that all objects share (odd draws: in the world; even: in their own frames).
        turned: rad, of every measured heading.
        clock: s, by which stamps are late.
        unstamped: s, by which measurements without stamps are late.
        odometry: Relative errors of the wheels: distance, sideways drift over distance, and turns.
        noise: Standard deviations, m and rad.
        start: m and rad, of the plate.
        jump: m and rad, of the localisation half-way; the plate's pose is measured then.
        unseen: Share of times that an object is not seen.
        wrong: m, by which one object is seen elsewhere in one frame every 2 s.
        outage: s, without any measurement, once.
        swapped: s, for which the names of the first two objects are exchanged, once.
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
        """Return both errors together; if both state a number, the first one counts."""

        def either(mine: Any, theirs: Any, nominal: Any) -> Any:
            if isinstance(mine, tuple):
                return tuple(map(either, mine, theirs, nominal))
            return theirs if mine == nominal else mine

        return Errors(*map(either, *(vars(one).values() for one in (self, other, Errors()))))


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
ODOMETRY = (0.015, 0.0, 0.0)
ALL = Errors(3e-3, 0.7 * DEG, 0.025, odometry=ODOMETRY, unseen=0.02, wrong=0.05, outage=8.0, swapped=2.0)
"""Errors of the matrix, beside a disturbance and a friction of contacts that is 20 % less."""
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


class Erring:
    """A robot with errors of its camera and its wheels.

    Args:
        controller: Controller that drives it.
        errors: Its errors.
        random: Draws.
        half: Time (s) at which the localisation jumps; an outage begins at half of it, exchanged names at 1.5 of it.
    """

    def __init__(self, controller: Controller, errors: Errors, random: np.random.Generator, half: float) -> None:
        self.controller, self.errors, self.random, self.half, self.due = controller, errors, random, half, 2.0
        way, jump = random.uniform(-math.pi, math.pi, 2)
        self.own, self.sign = bool(random.integers(2)), float(random.choice([-1.0, 1.0]))
        e, scenario = errors, controller.scenario
        self.shift = np.array([e.bias * math.cos(way), e.bias * math.sin(way), self.sign * e.turned])
        self.leap = np.array([e.jump[0] * math.cos(jump), e.jump[0] * math.sin(jump), self.sign * e.jump[1]])
        self.plate = np.array(scenario.plate_start)
        self.wheels = relative(scenario.pusher.plate_pose, scenario.pusher.wheels_pose)

    def shifted(self, poses: FloatArray) -> FloatArray:
        """Return poses with the camera's offset."""
        return compose(poses, self.shift) if self.own else poses + self.shift

    def step(self, now: float, object_poses: ArrayLike | None = None, measured_at: float | None = None) -> FloatArray:
        """Return the actual twist of the plate."""
        e, rows, plate = self.errors, None, None
        if object_poses is not None and measured_at is not None:
            rows = self._seen(now, self.shifted(np.asarray(object_poses)))
            measured_at = None if e.unstamped else measured_at + e.clock
            if 0.0 <= now - 0.5 * self.half < e.outage:
                rows = measured_at = None
        if any(e.jump):
            plate = self.plate if now < self.half else compose(self.leap, self.plate)
        twist = np.asarray(self.controller.step(now, rows, measured_at, plate))
        v, crab, turn = np.array(e.odometry) * self.sign
        rolled = twist_of(self.wheels, twist)
        rolled = np.array([[1.0 + v, -crab, 0.0], [crab, 1.0 + v, 0.0], [0.0, 0.0, 1.0 + turn]]) @ rolled
        done = twist_of(inverse(self.wheels), rolled)
        self.plate = compose(self.plate, exp(done / self.controller.settings.rate))
        return done

    def _seen(self, now: float, poses: FloatArray) -> FloatArray:
        """Return poses with a wrong one, exchanged names, and NaN for what is not seen."""
        e = self.errors
        if e.wrong and now >= self.due:
            self.due, way = now + 2.0, self.random.uniform(-math.pi, math.pi)
            poses[self.random.integers(len(poses)), :2] += [e.wrong * math.cos(way), e.wrong * math.sin(way)]
        if 0.0 <= now - 1.5 * self.half < e.swapped:
            poses[:2] = poses[:2][::-1].copy()
        return np.where(self.random.random(len(poses))[:, None] < e.unseen, np.nan, poses)


class Sliding(SlipSimulator):
    """A world in which the objects slide along a contact, from a distance of the plate on until the loop looks.

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
        """Move the plate, and let the objects slide."""
        trace = super().move(twist, duration)
        x, y, turn = np.asarray(twist) * duration
        step, events = float(math.hypot(x, y)), self._controller.events
        self._way, self._time = self._way + step, self._time + duration
        if self.since == math.inf and self._way > self._begin and self._controller.phase is Phase.PUSHING:
            self.since, self._told = self._time, len(events)
        noticed = any(event.kind in STOPS for event in events[self._told :])
        if self.since < math.inf and not noticed and not self.jammed and self.slid[1] <= 2.0 * ANYWHERE:
            poses = self.object_poses
            poses[self._moved, :2] += rotate(float(self.plate_pose[2]), self._side * RATE * step * self._tangent)
            self.place(poses, self.plate_pose)
            bent = float(abs(turn) > BENT * step)
            self.slid = self.slid[0] + bent * RATE * step, self.slid[1] + RATE * step
        return trace


@dataclass(frozen=True)
class Job:
    """A run to be made; `what` is `disturbances`, `slides`, `physics` or empty."""

    name: str
    error: str
    errors: Errors
    seed: int
    what: str


@cache
def problem(name: str) -> tuple[Scenario, Plan]:
    """Return a scenario and its first plan."""
    file = Path(__file__).parents[1] / "examples" / f"{name.replace('-', '_')}.yaml"
    if name == "in-a-row":
        scenario = scenario_from_text(IN_A_ROW)
    elif name in MATRIX["several"] and not file.exists():
        scenario, _ = next(several_pushes([int(name.rpartition("-")[2])]))
    else:
        scenario = load_scenario(file if name in MATRIX["several"] else name)
    return scenario, Controller(scenario).plan


def run(job: Job) -> dict[str, Any]:
    """Run one scenario with one error, or with all of them.

    Returns:
        error: Name of the error.
        arrived, elsewhere: Whether it arrived, and whether the controller said so wrongly.
        words: Text about the run.
        replans, lines, stops: Numbers of solved replans, of printed events, of stops before anything happened.
        travel, planned, seconds: Travel of the plate and of the plan, m, and CPU time, s.
        noticed, missed: Whether the disturbance or the slide was noticed in time (None without one), or missed.
    """
    (scenario, plan), whole = problem(job.name), job.error == "all"
    assert plan.trajectory is not None
    planned, random = travel_of(plan.trajectory.poses), np.random.default_rng([job.seed, *job.name.encode()])
    controller = Controller(scenario, plan=plan)
    robot = Erring(controller, job.errors, random, 0.5 * plan.trajectory.duration)
    simulator, hits = (_whole if whole else _single)(job, controller, random)
    delay, (position, angle) = job.errors.unstamped or 0.1, job.errors.noise
    sensor, began, longest = Sensor(delay=delay, position=position, angle=angle), time.process_time(), LONGEST[whole]
    rate, made = controller.settings.rate, lambda _: simulator
    course = simulate_push(simulator.world, controller, rate, hits, sensor, job.seed, longest, None, made, robot.step)
    seconds, travel, events = time.process_time() - began, travel_of(course.poses), controller.events
    error, there = (_ends_everywhere if whole else _ends)(controller, robot, course.object_poses[-1])
    replans, says = sum(replan.solved for replan in controller.replans), controller.phase is Phase.ARRIVED
    since, noticed, missed = (0.0, None, False) if whole else _noticed(controller, course, hits, simulator)
    return {
        "error": job.error,
        "arrived": says and there and (whole or replans <= MOST_REPLANS),
        "elsewhere": says and not there,
        "words": f"{job.name:14} {job.seed:4} {replans} replans, {travel:.1f} of {planned:.1f} m, "
        f"{1e3 * error[0]:.1f} mm {error[1] / DEG:.2f} deg: {outcome_of(course, controller)}",
        "replans": replans,
        "lines": len(collapsed(events)),
        "stops": sum(event.kind == "deviation" and event.time < since for event in events),
        "travel": travel,
        "planned": planned,
        "seconds": seconds,
        "noticed": noticed,
        "missed": missed,
    }


def _whole(job: Job, controller: Controller, random: np.random.Generator) -> tuple[Simulator, list[Disturbance]]:
    """Return the simulator and the disturbance of a run in which everything goes wrong."""
    world = World.from_scenario(controller.scenario).with_contact_friction(0.8)
    assert controller.plan.trajectory is not None
    hit = _kick(controller.plan.trajectory.duration, len(world.names), random)
    return (PhysicsSimulator if job.what == "physics" else SlipSimulator)(world), [hit]


def _single(job: Job, controller: Controller, random: np.random.Generator) -> tuple[Simulator, list[Disturbance]]:
    """Return the simulator and the disturbances of a run with one error or two."""
    world, trajectory = World.from_scenario(controller.scenario), controller.plan.trajectory
    assert trajectory is not None
    if job.errors.start != (0.0, 0.0):
        world = _beside(world, job.errors.start, random)
    random = np.random.default_rng([job.seed, *f"{job.name} {job.error}".encode()])  # every error has others
    if job.what == "disturbances":
        world = with_other_friction(world, random)
        return SlipSimulator(world), [_kick(trajectory.duration, len(world.names), random)]
    if job.what == "slides":
        begin = random.uniform(0.1, 0.7) * travel_of(trajectory.poses)
        contact = int(random.integers(len(world.names)))
        return Sliding(world, controller, begin, contact, random.choice([-1.0, 1.0])), []
    return SlipSimulator(world), []


def _ends(controller: Controller, robot: Erring, end: FloatArray) -> tuple[Sequence[float], bool]:
    """Return the errors (m, rad) at the goal, and whether they are small for the true or the measured poses."""
    aim = Aim.of(controller.scenario.goal, controller.scenario.chain, *WITHIN)
    there = any(bool((aim.errors(poses) <= 1.05 * aim.tolerance).all()) for poses in (end, robot.shifted(end)))
    return aim.errors(end).tolist(), there


def _ends_everywhere(controller: Controller, robot: Erring, end: FloatArray) -> tuple[Sequence[float], bool]:
    """Return the largest errors (m, rad) of all goals, and whether they are small but for the camera's error."""
    error = worst_at_goal(controller.scenario, end)
    allowed = np.add(tolerance_of(controller.scenario, *WITHIN), [robot.errors.bias, robot.errors.turned])
    return error, bool((error <= allowed).all())


def _noticed(
    controller: Controller, course: SimulatedPush, hits: list[Disturbance], simulator: Simulator
) -> tuple[float, bool | None, bool]:
    """Return when the disturbance or the slide began (s), and whether it was noticed in time and missed."""
    if hits:
        since, usual = hits[0].time, ControlSettings()
        noticed = any(e.kind in STOPS and 0.0 <= e.time - since <= 1.0 for e in controller.events)
        left = _left(course, since)
        put_back = left[0] <= usual.position_slack and left[1] <= usual.angle_slack
        return since, noticed, not noticed and not put_back
    if isinstance(simulator, Sliding):
        late = simulator.slid[0] > ON_ARCS or simulator.slid[1] > ANYWHERE
        noticed = any(e.kind == "deviation" and e.time >= simulator.since for e in controller.events)
        return simulator.since, noticed, late
    return math.inf, None, False


def _kick(duration: float, count: int, random: np.random.Generator) -> Disturbance:
    way, turn = random.uniform(-math.pi, math.pi), 3.0 * DEG * random.choice([-1.0, 1.0])
    at, index = random.uniform(0.1, 0.9) * duration, int(random.integers(count))
    return displaced(way, turn, index, at)


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


def jobs_of(asked: Any) -> Iterator[Job]:
    """Yield the runs, those of one error after another."""
    if asked.matrix:
        names = [name for name in MATRIX[asked.matrix] if name in (asked.only or [name])]
        yield from (Job(n, "all", ALL, s, "physics" if asked.physics else "") for n in names for s in asked.seeds)
        return
    errors = dict(ERRORS)
    random, names = np.random.default_rng(asked.seeds[0]), list(ERRORS)[1:]
    for _ in range(asked.pairs):
        first, second = (names[i] for i in random.choice(len(names), 2, replace=False))
        errors[f"{first}, {second}"] = ERRORS[first].and_(ERRORS[second])
    pushes = [n for n in example_names() if load_scenario(n).kind == "push" and n in (asked.only or [n])]
    what = "disturbances" if asked.disturbances else "slides" if asked.slides else ""
    for error, stated in errors.items():
        if any(part in error for part in asked.filter or [error]):
            yield from (Job(name, error, stated, seed, what) for name in pushes for seed in asked.seeds)


def summary(rows: pd.DataFrame) -> str:
    """Return the figures of some runs."""
    told = f"; {(rows.noticed.eq(True) & ~rows.missed).sum()} noticed, {rows.missed.sum()} missed"
    return (
        f"{share(rows.arrived.sum(), len(rows))} arrive, {rows.elsewhere.sum()} elsewhere; "
        f"travel {(rows.travel / rows.planned).median():.2f} of the plan's, "
        f"{(rows.travel > 2.0 * rows.planned + 1.0).sum()} beyond 2 x + 1 m; {rows.replans.mean():.1f} replans, "
        f"at most {rows.lines.max()} lines, {rows.seconds.sum():.0f} s of CPU; {(rows.stops > 0).sum()} stop for "
        f"nothing{told if rows.noticed.notna().any() else ''}"
    )


def main() -> None:
    modes = {"disturbances": False, "slides": False, "matrix": str, "physics": False}
    asked = options(__doc__, seeds=(101, 102, 103), only=(str,), filter=(str,), pairs=12, **modes, jobs=1)
    every: list[dict[str, Any]] = []
    with ProcessPoolExecutor(asked.jobs) as pool:
        made = pool.map(run, jobs_of(asked), chunksize=len(asked.seeds))
        for error, rows in groupby(made, key=lambda row: row["error"]):
            found = [*rows]
            every += found
            bad = (row["words"] for row in found if not row["arrived"])
            print(f"{error:30} {summary(pd.DataFrame(found))}", *bad, sep="\n    ", flush=True)
    print(f"{'together':30} {summary(pd.DataFrame(every))}")


if __name__ == "__main__":
    main()
