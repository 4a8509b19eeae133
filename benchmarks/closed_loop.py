"""Closed loop and open loop in the same disturbed samples.

    python benchmarks/closed_loop.py [--plans 40] [--physics 0]

Every coefficient of friction is off by 20 %, up or down on its own. One object is displaced by 5 mm and 3 deg at a
random moment. Objects are measured 30 times a second, 0.1 s late, with noise of 1 mm and 0.3 deg.

`--plans` executes random multi-push plans of one load or of several objects. At every approach the plate is off by up
to 5 mm and 2 deg.

`--physics` executes packaged scenarios in MuJoCo instead (extra `physics`), at full speed and with inertia, each in
two samples. A run arrives if the goal's objects end within 5 mm and 1 deg, or within a larger tolerance of the goal.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from script import options, share

from pushplan.errors import PushplanError
from pushplan.geometry.se2 import compose, exp, log
from pushplan.planner import plan
from pushplan.plans.goals import tolerance_of, worst_at_goal
from pushplan.plans.plan import Plan
from pushplan.scenario.file import example_names, load_scenario, scenario_from_document
from pushplan.scenario.model import Scenario
from pushplan.sim.control.controller import Controller
from pushplan.sim.control.jobs import Phase
from pushplan.sim.control.simulated_push import Disturbance, OpenLoop, SimulatedPush, simulate_push
from pushplan.sim.physics.simulator import PhysicsSimulator
from pushplan.slip.simulator import SlipSimulator
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray

WITHIN = (5e-3, np.radians(1.0))
"""Errors at the goal with which a run arrives, m and rad, if the goal has no larger tolerance."""
SIDES, ROOM = (0.12, 0.3), 3.0
"""Sides of boxes, and half of the side of the room that they are drawn in, m."""
APART = 0.65
"""Distance of boxes, goals and robot from one another, m: with room to drive between them."""
APPROACH = (5e-3, np.radians(2.0))
"""Largest error of the plate's pose after it has driven to an object, m and rad."""


def several_pushes(seeds: Iterable[int]) -> Iterator[tuple[Scenario, Plan]]:
    """Yield random multi-push scenarios that have a plan, with their plans."""
    for seed in seeds:
        with suppress(PushplanError):  # drawn so that robot and boxes meet, or nothing can be done
            scenario, apart = scenario_from_document(drawn(seed)), seed % 2 == 1
            result = plan(scenario, seed=1, time_limit=10.0 if apart else 1.0, first=apart)
            if result.solved:
                yield scenario, result


def drawn(seed: int) -> dict[str, Any]:
    """Return the document of a load of one or two boxes (even seeds), or of two or three boxes apart."""
    random = np.random.default_rng([seed, 77])
    if seed % 2:
        count = int(random.integers(2, 4))
        *spots, robot = _spots(random, 2 * count + 1)
        boxes = [_box(random, f"box-{k}") | {"pose": spots[k]} for k in range(count)]
        task: dict[str, Any] = {"goals": {box["name"]: {"pose": spots[count + k]} for k, box in enumerate(boxes)}}
    else:
        start, goal, robot = _spots(random, 3)
        boxes = [_box(random, f"box-{k}") for k in range(int(random.integers(1, 3)))]
        task = {"start": start, "goal": {"pose": goal, "of": boxes[-1]["name"]}}
    drive = [{"differential": {"axle": [-0.2, 0.0, 0.0]}}, "omnidirectional"][int(random.integers(2))]
    return {
        "format": "pushplan/1",
        "name": f"{'boxes' if seed % 2 else 'load'}-{seed}",
        "floor": {"friction": 0.3},
        "objects": boxes,
        "contacts": {"friction": 0.4},
        "pusher": {"width": 0.28, "friction": 0.5},
        "robot": {"footprint": {"box": [0.4, 0.285], "pose": [-0.2, 0.0, 0.0]}, "drive": drive, "start": robot},
        **task,
        "workspace": {"x": [-ROOM, ROOM], "y": [-ROOM, ROOM]},
    }


def _spots(random: np.random.Generator, count: int) -> list[list[float]]:
    """Return separated poses in the room."""
    spots: list[FloatArray] = []
    while len(spots) < count:
        spot = random.uniform(-0.8 * ROOM, 0.8 * ROOM, 3) * [0.6, 0.6, 1.0]
        if all(np.hypot(*(spot - other)[:2]) > APART for other in spots):
            spots.append(spot)
    return [spot.tolist() for spot in spots]


def _box(random: np.random.Generator, name: str) -> dict[str, Any]:
    shape = {"box": random.uniform(*SIDES, 2).round(3).tolist()}
    return {"name": name, "shape": shape, "mass": float(random.uniform(0.5, 3.0))}


@dataclass(eq=False)
class Astray:
    """A robot with an error of the plate's pose at the beginning of each approach, which the controller ignores."""

    controller: Controller
    random: np.random.Generator
    _approached: object = None

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


def with_other_friction(world: World, random: np.random.Generator) -> World:
    """Return a world in which each friction is 20 % larger or smaller."""
    for name in world.names:
        world = world.with_contact_friction(1.0 + 0.2 * random.choice([-1.0, 1.0]), name)
        world = world.with_floor_friction(1.0 + 0.2 * random.choice([-1.0, 1.0]), name)
    return world


def displaced(way: float, turn: float, index: int, time: float) -> Disturbance:
    """Return a disturbance of 5 mm."""
    return Disturbance(time, index, 5e-3 * float(np.cos(way)), 5e-3 * float(np.sin(way)), turn)


def travel_of(poses: FloatArray) -> float:
    """Return the distance of the plate along poses (m, 3), m."""
    return float(np.hypot(*np.diff(poses[:, :2], axis=0).T).sum())


def outcome_of(course: SimulatedPush, controller: Controller) -> str:
    """Return how a run of the closed loop ended."""
    return "jammed" if course.jammed else controller.reason or controller.phase.value


@dataclass(frozen=True)
class Row:
    """Whether both loops arrive in one sample, and the travel of the plate over that of the plan."""

    closed: bool
    opened: bool
    travel: float
    far: bool
    """Whether the travel exceeds twice the planned one plus 1 m."""


def run(scenario: Scenario, result: Plan, seed: int, physics: bool) -> Row:
    """Execute a plan in closed and in open loop in the same sample; print a line."""
    assert result.trajectory is not None
    random = np.random.default_rng([seed, len(scenario.name)] if physics else [seed, *scenario.name.encode()])
    world = with_other_friction(World.from_scenario(scenario), random)
    way, turn = random.uniform(-np.pi, np.pi), np.radians(3.0) * random.choice([-1.0, 1.0])
    index = int(random.integers(len(world.names)))
    hit = displaced(way, turn, index, random.uniform(0.0, result.trajectory.duration))
    made = PhysicsSimulator if physics else SlipSimulator
    controller = Controller(scenario, plan=None if physics else result)  # without one it plans with more margin
    robot, rate, began = Astray(controller, random), controller.settings.rate, time.process_time()
    course = simulate_push(world, controller, rate, [hit], seed=seed, simulator_of=made, step=robot.step)
    seconds = time.process_time() - began
    blind = simulate_push(world, OpenLoop(result, rate), rate, [hit])
    errors = [np.array(worst_at_goal(scenario, one.object_poses[-1])) for one in (course, blind)]
    allowed = tolerance_of(scenario, *WITHIN)
    closed, opened = (bool((error <= allowed).all()) for error in errors)
    travel, planned = travel_of(course.poses), travel_of(result.trajectory.poses)
    print(
        f"{scenario.name:22} {'arrives' if closed else 'MISSES '} {travel:.1f} m, {planned:.1f} planned: "
        f"{1e3 * errors[0][0]:.1f} mm {np.degrees(errors[0][1]):.2f} deg, "
        f"{sum(one.rest and one.solved for one in controller.replans)} plans for the rest, {seconds:.0f} s: "
        f"{outcome_of(course, controller)}",
        flush=True,
    )
    return Row(closed, opened, travel / planned, travel > 2.0 * planned + 1.0)


def main() -> None:
    asked = options(__doc__, plans=40, physics=0)
    if asked.physics:
        packaged = [(one, plan(one, seed=1, time_limit=1.0)) for one in map(load_scenario, example_names())]
        samples = [(*one, seed) for one in packaged for seed in (0, 1)][: asked.physics]
        rows = [run(*sample, physics=True) for sample in samples]
    else:
        found = itertools.islice(several_pushes(itertools.count()), asked.plans)
        rows = [run(*one, seed=1, physics=False) for one in found]
    print(f"closed loop: {share(sum(row.closed for row in rows), len(rows))} arrive")
    print(f"open loop:   {share(sum(row.opened for row in rows), len(rows))} arrive")
    travel = np.median([row.travel for row in rows])
    print(f"travel over the plan's: {travel:.2f} in the median, {sum(row.far for row in rows)} beyond 2 x + 1 m")


if __name__ == "__main__":
    main()
