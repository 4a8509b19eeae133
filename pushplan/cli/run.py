"""Push in a simulated world with disturbances, along the plan or in closed loop."""

from __future__ import annotations

import argparse
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING

from pushplan.cli.steps.run_words import kick, kicks_of, sensor
from pushplan.cli.steps.trial_words import uncertainty
from pushplan.cli.terminal.console import Console
from pushplan.cli.terminal.failure import DONE, MISMATCH, NO_PLAN
from pushplan.cli.terminal.options import add_output, add_runs, add_scenario, check_outputs, seed
from pushplan.errors import PlanningError

if TYPE_CHECKING:
    from pushplan.closed_loop import ClosedLoopRun
    from pushplan.scenario.model import Scenario


def declare(parser: argparse.ArgumentParser) -> None:
    """Declare the words of the command."""
    add_scenario(parser)
    parser.add_argument(
        "--closed-loop",
        action="store_true",
        help="watch the objects, close contacts, plan again; else the plan is executed whatever happens",
    )
    parser.add_argument(
        "--kick",
        type=kick,
        action="append",
        default=[],
        metavar="WHAT=HOW,...",
        help="displace an object: time, object, and x, y, turn in its own frame, e.g. "
        "'time=8s,object=far,y=5mm,turn=3deg'; may be given again",
    )
    parser.add_argument(
        "--uncertainty",
        type=uncertainty,
        metavar="WHAT=HOW,...",
        help="draw a world whose friction, loads and places are off by up to that much, as `pushplan trial` does, "
        "e.g. contact_friction=20%%,floor_friction=20%%; default: the world is as the scenario says",
    )
    parser.add_argument(
        "--sensor",
        type=sensor,
        metavar="WHAT=HOW,...",
        help="how objects are measured: rate, delay, position and angle (standard deviations); default: "
        "rate=30,delay=0.1s,position=1mm,angle=0.3deg",
    )
    parser.add_argument(
        "--seed", type=seed, default=1, metavar="N", help="seed of world and noise (default: 1)"
    )
    add_output(parser, "-o", "--output", help="write the run's log (MCAP) here")
    parser.add_argument(
        "--no-log", action="store_true", help="write no log; else one is recorded without -o, too"
    )
    add_runs(parser)
    add_output(parser, "--html", help="write a page that plays the run")


def run(args: argparse.Namespace, console: Console) -> int:
    """Carry out the command and return the exit code."""
    from pushplan.scenario.file import load_scenario

    check_outputs([args.scenario], None, args.html, log=args.output)
    scenario = load_scenario(args.scenario)
    kicks_of(scenario, args.kick)
    try:
        done = _pushed(args, scenario, console)
    except PlanningError as error:
        console.say(f"{console.paint(scenario.name, 'bold')}: {error}")
        console.emit({"scenario": scenario.name, "outcome": "no plan", "reason": str(error)})
        return NO_PLAN
    log = _write(args, done, console)
    _tell(done, log, console)
    console.emit(_document(done, log))
    return DONE if done.outcome == "arrived" else MISMATCH


def _pushed(args: argparse.Namespace, scenario: Scenario, console: Console) -> ClosedLoopRun:
    with console.computing("planning and pushing") as progress:
        import numpy as np

        from pushplan.closed_loop import run_closed_loop, run_open_loop
        from pushplan.sim.control.course import SENSOR
        from pushplan.sim.trials.uncertain import sampled_world
        from pushplan.sim.worlds.world import World

        def told(now: float) -> None:
            progress.tell(f"{now:.0f} s of the push")

        world = World.from_scenario(scenario)
        if args.uncertainty is not None:
            world = sampled_world(scenario, args.uncertainty, np.random.default_rng([args.seed, 0]))
        kicks = kicks_of(scenario, args.kick)
        if not args.closed_loop:
            return run_open_loop(scenario, world, kicks, tell=progress.announce, progress=told)
        return run_closed_loop(
            scenario,
            world,
            kicks,
            sensor=args.sensor or SENSOR,
            seed=args.seed,
            tell=progress.announce,
            progress=told,
        )


def _write(args: argparse.Namespace, done: ClosedLoopRun, console: Console) -> Path | None:
    """Write what is asked for; return the log."""
    from pushplan.logging.runs import new_log, runs_folder

    path: Path | None = args.output
    if path is None and not args.no_log:
        path = new_log(runs_folder(args.runs), done.scenario.name, args.seed)
    if path is not None:
        done.write(path)
    if path is not None and args.output is None:
        from pushplan.logging.runs import prune

        prune(path.parent, path)
    if args.html is not None:
        from pushplan.logging.page import write_html

        with console.computing(f"writing {args.html}"):
            write_html(done.recorded, args.html)
    return path


def _tell(done: ClosedLoopRun, log: Path | None, console: Console) -> None:
    position, angle = done.goal_errors
    why = f": {done.reason}" if done.reason else ""
    console.say(f"{console.paint(done.scenario.name, 'bold')}: {done.outcome}{why}")
    of = done.scenario.goal.of or "worst object"
    rows = [(f"{event.time:.2f} s", f"{event.kind}: {event.text}") for event in done.events]
    rows.append((f"{of} off", f"{1e3 * position:.3g} mm / {degrees(angle):.3g} deg"))
    if log is not None:
        rows.append(("log", str(log)))
    console.table(rows)


def _document(done: ClosedLoopRun, log: Path | None) -> dict[str, object]:
    position, angle = done.goal_errors
    return {
        "scenario": done.scenario.name,
        "closed_loop": done.settings is not None,
        "outcome": done.outcome,
        "reason": done.reason,
        "goal_error": {"position": float(position), "angle": float(angle)},
        "duration_s": float(done.course.t[-1]),
        "events": [{"time": e.time, "kind": e.kind, "text": e.text} for e in done.events],
        "replans": [{"time": r.time, "solved": r.solved, "seconds": r.seconds} for r in done.replans],
        "log": log,
    }
