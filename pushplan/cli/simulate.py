"""Simulate a push with disturbances, in open or closed loop."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pushplan.cli import parameters as p
from pushplan.cli.console import Console, angle_text, length_text
from pushplan.cli.main import DEFECT, DONE, MISMATCH, NO_PLAN, error_document
from pushplan.cli.trial import UNCERTAINTY
from pushplan.errors import PlanningError
from pushplan.scenario import units

if TYPE_CHECKING:
    from pushplan.closed_loop import ClosedLoopRun
    from pushplan.logging.recording import IncompleteLogError
    from pushplan.scenario.model import Scenario
    from pushplan.sim.control.sensing import Sensor
    from pushplan.sim.control.simulated_push import Disturbance

_TIME = {"s": 1.0, "ms": 1e-3}


def _sensor(found: dict[str, Any]) -> Sensor:
    from pushplan.sim.control.sensing import Sensor

    return Sensor(**found)


SENSOR = p.named({"rate": {"Hz": 1.0}, "delay": _TIME, "position": units.LENGTH, "angle": units.ANGLE}, _sensor)
DISTURBANCE = p.named(
    {"time": _TIME, "object": None, "x": units.LENGTH, "y": units.LENGTH, "turn": units.ANGLE},
    needed=("time", "object"),
)

MOST_DISPLACED = 1.0
"""Largest displacement of an object by a disturbance, m."""


@p.command
@p.scenario_argument
@click.option(
    "--closed-loop",
    is_flag=True,
    help="Measure the objects, close contacts and replan. Default: execute the plan without feedback.",
)
@click.option(
    "--disturb",
    "disturbances",
    type=DISTURBANCE,
    multiple=True,
    metavar="NAME=VALUE,...",
    help="Displace an object at a time by x, y, turn in its own frame, e.g. "
    "'time=8s,object=far,y=5mm,turn=3deg'; can be repeated.",
)
@click.option(
    "--uncertainty",
    type=UNCERTAINTY,
    metavar="NAME=VALUE,...",
    help="Simulate a random sample with model errors within these limits, as in `pushplan trial`, e.g. "
    "contact_friction=20%,floor_friction=20%. Default: no model errors.",
)
@click.option(
    "--sensor",
    type=SENSOR,
    metavar="NAME=VALUE,...",
    help="Sensor of the objects: rate, delay, and standard deviations of position and angle. Default: "
    "rate=30,delay=0.1s,position=1mm,angle=0.3deg.",
)
@click.option(
    "--seed", type=p.SEED, metavar="N", default=1, show_default=True, help="Seed of friction, loads and noise."
)
@click.option("--physics", is_flag=True, help="Simulate in MuJoCo, at full speed with inertia.")
@p.log_options("Write the log (MCAP) of the run, and its page beside it.")
@p.file_option("--html", help="Write a page that plays the run.")
@p.no_code_option
def simulate(
    console: Console,
    scenario: str,
    closed_loop: bool,
    disturbances: tuple[dict[str, Any], ...],
    uncertainty: Any,
    sensor: Any,
    seed: int,
    physics: bool,
    log: p.LogChoice,
    html: Path | None,
    no_code: bool,
) -> int:
    """Simulate a push with disturbances, in open or closed loop."""
    from pushplan.cli.render import require_executable, write_page
    from pushplan.logging.recording import IncompleteLogError
    from pushplan.scenario.file import load_scenario

    p.check_outputs([scenario], None, html, log=log.output)
    with p.code_of(scenario, console.note, no_code):
        stated = load_scenario(scenario)
        displaced = _disturbances(stated, disturbances)
        incomplete = None
        how: dict[str, Any] = {"log": log.where, "runs": log.runs, "watched": closed_loop, "seed": seed}
        if sensor is not None:
            how["sensor"] = sensor
        if physics:
            from pushplan.sim.physics.simulator import PhysicsSimulator

            require_executable(stated)
            how["simulator_of"] = PhysicsSimulator
        try:
            done = _simulated(stated, displaced, uncertainty, how, console)
        except PlanningError as error:
            console.say((stated.name, "bold"), f": {error}")
            console.emit({"scenario": stated.name, "outcome": "no plan", "reason": str(error)})
            return NO_PLAN
        except IncompleteLogError as error:
            done, incomplete = error.run, error
    page = write_page(done.recorded, html, log.paged, console)
    _report(done, page, incomplete, console)
    over = float(done.simulated.t[-1])
    for late in (one.time for one in displaced if one.time > over):
        console.note(f"note: the disturbance at {late:g} s had no effect, because the run ended at {over:.2f} s")
    if incomplete is not None:
        console.note(f"error: {incomplete}")
        return DEFECT
    return DONE if done.outcome == "arrived" else MISMATCH


def _disturbances(scenario: Scenario, words: tuple[dict[str, Any], ...]) -> list[Disturbance]:
    """Return the disturbances with the indices of their objects.

    Raises:
        UsageError: If a displacement is unreasonably large.
        ChainError: If there is no such object.
    """
    from pushplan.errors import ChainError
    from pushplan.sim.control.simulated_push import Disturbance

    names, found = list(scenario.poses), []
    for one in words:
        shift = {name: one.get(name, 0.0) for name in ("x", "y", "turn")}
        for name in ("x", "y"):
            if abs(shift[name]) > MOST_DISPLACED:
                wrong = (
                    f"{name} is {one[name]:g} m; allowed: up to {MOST_DISPLACED:g} m, and mm need a unit, as in 5mm"
                )
                raise p.UsageError(f"--disturb: {wrong}")
        if one["object"] not in names:
            raise ChainError(f"there is no object {one['object']!r}; allowed: {', '.join(names)}")
        found.append(Disturbance(one["time"], names.index(one["object"]), *shift.values()))
    return found


def _simulated(
    scenario: Scenario, disturbances: list[Disturbance], uncertainty: Any, how: dict[str, Any], console: Console
) -> ClosedLoopRun:
    with console.working("planning and pushing") as progress:
        import numpy as np

        from pushplan.closed_loop import run_closed_loop
        from pushplan.plans.settings import Observer
        from pushplan.sim.trials import sampled_world
        from pushplan.slip.world import World

        def report(now: float) -> None:
            progress.update(f"{now:.0f} s of the push")

        world, observer = World.from_scenario(scenario), Observer(message=progress.announce)
        if uncertainty is not None:
            world = sampled_world(scenario, uncertainty, np.random.default_rng([how["seed"], 0]))
        return run_closed_loop(scenario, world, disturbances, observer=observer, progress=report, **how)


def _pair(errors: tuple[float, float]) -> dict[str, float]:
    return {"position": float(errors[0]), "angle": float(errors[1])}


def _report(done: ClosedLoopRun, page: Path | None, incomplete: IncompleteLogError | None, console: Console) -> None:
    from pushplan.plans.run import collapsed

    position, angle = done.goal_errors
    console.say((done.scenario.name, "bold"), f": {done.outcome}{f': {done.reason}' if done.reason else ''}")
    of = "worst object"
    if done.scenario.task.one_load and done.scenario.goal.of is not None:
        of = done.scenario.goal.of
    rows = [(f"{event.time:.2f} s", f"{event.kind}: {event.text}") for event in collapsed(done.events)]
    rows.append(("goal error", f"{length_text(position)}, {angle_text(angle)} ({of})"))
    rows += [(name, str(file)) for name, file in (("log", done.log), ("page", page)) if file is not None]
    console.table(rows)
    console.emit(
        {
            "scenario": done.scenario.name,
            "closed_loop": done.settings is not None,
            "outcome": done.outcome,
            "reason": done.reason,
            "goal_error": _pair(done.goal_errors),
            "measured_error": None if done.measured_error is None else _pair(done.measured_error),
            "camera_error_not_excluded": None if done.camera_error is None else _pair(done.camera_error),
            "duration_s": float(done.simulated.t[-1]),
            "events": [{"time": e.time, "kind": e.kind, "text": e.text} for e in done.events],
            "replans": [{"time": r.time, "solved": r.solved, "seconds": r.seconds} for r in done.replans],
            "log": done.log,
            "page": page,
            **({} if incomplete is None else {"error": error_document(incomplete)}),
        }
    )
