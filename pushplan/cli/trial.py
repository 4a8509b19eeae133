"""Execute a plan in sampled worlds, and tell in what share of them it arrives."""

from __future__ import annotations

import argparse
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING

from pushplan.cli.steps.trial_words import document, rows, uncertainty
from pushplan.cli.terminal.console import Console
from pushplan.cli.terminal.failure import DONE, NO_PLAN
from pushplan.cli.terminal.options import add_output, add_plot, check_outputs, count, seed

if TYPE_CHECKING:
    from pushplan.plans.result import PlanResult
    from pushplan.scenario.model import Scenario
    from pushplan.sim.trials.result import Trials


def declare(parser: argparse.ArgumentParser) -> None:
    """Declare the words of the command."""
    parser.add_argument(
        "scenario",
        metavar="SCENARIO|RUN.mcap",
        help="what to plan first, or the log of a run that has a plan",
    )
    parser.add_argument(
        "--samples", type=count, default=200, metavar="N", help="number of worlds (default: 200)"
    )
    parser.add_argument(
        "--uncertainty",
        type=uncertainty,
        metavar="WHAT=HOW,...",
        help="by how much worlds differ: contact_friction, floor_friction, mass, load, position, angle; e.g. "
        "contact_friction=20%%,load=10%%,position=1mm,angle=0.3deg; what is not named stays as stated. Default: the "
        "scenario's intervals, else 20 %% of friction, 10 %% of load, 1 mm and 0.3 deg",
    )
    parser.add_argument("--seed", type=seed, default=1, metavar="N", help="seed of the worlds (default: 1)")
    parser.add_argument("--jobs", type=count, metavar="N", help="threads (default: one a processor)")
    add_plot(parser, "draw where the objects end, and where contacts failed")
    add_output(parser, "--worst", help="write the log (MCAP) of the sample that ends farthest off")


def run(args: argparse.Namespace, console: Console) -> int:
    """Carry out the command and return the exit code."""
    check_outputs([args.scenario], args.plot, log=args.worst)
    scenario, plan = _planned(args.scenario, console)
    if plan is None or plan.trajectory is None:
        why = "the log ends before a plan" if plan is None else plan.reason
        console.say(f"{scenario.name}: there is no plan to try: {why}")
        console.emit({"scenario": scenario.name, "solved": False, "reason": why})
        return NO_PLAN
    trials = _tried(args, scenario, plan, console)
    low, high = trials.interval
    rate = f"arrives in {100 * trials.success:.1f} % of {trials.samples} worlds"
    console.say(
        f"{console.paint(scenario.name, 'bold')}: {rate} ({100 * low:.1f} to {100 * high:.1f} % at 95 %)"
    )
    console.table(rows(trials))
    _write_outputs(args, trials, plan, console)
    console.emit(document(trials, args.worst))
    return DONE


def _planned(what: str, console: Console) -> tuple[Scenario, PlanResult | None]:
    """Return scenario and plan of a log, or the plan that is made now."""
    if Path(what).suffix == ".mcap":
        with console.working(f"reading {what}"):
            from pushplan.logging.reader import read_run

            recorded = read_run(what)
        return recorded.scenario, recorded.plan
    from pushplan.scenario.file import load_scenario

    scenario = load_scenario(what)
    with console.computing(f"planning, up to {scenario.planner.time_limit:g} s"):
        from pushplan.plan import plan

        return scenario, plan(scenario)


def _tried(args: argparse.Namespace, scenario: Scenario, plan: PlanResult, console: Console) -> Trials:
    assert plan.trajectory is not None
    with console.computing(f"executing {args.samples} trials") as progress:
        from pushplan.sim.trials.execute import execute_trials

        return execute_trials(
            scenario,
            plan.trajectory,
            args.samples,
            args.uncertainty,
            args.seed,
            jobs=args.jobs,
            progress=lambda done: progress.tell_share(done, args.samples),
        )


def _write_outputs(args: argparse.Namespace, trials: Trials, plan: PlanResult, console: Console) -> None:
    if args.plot is not None:
        with console.computing(f"drawing {args.plot}"):
            from pushplan.drawing.trials import plot_trials

            plot_trials(trials, plan.as_plan(trials.scenario), args.plot)
    if args.worst is not None:
        from pushplan.logging.trial_log import write_trial

        write_trial(trials, trials.worst, plan, args.worst)
        position, angle = trials.goal_errors[trials.worst]
        off = f"sample {trials.worst}, {1e3 * position:.3g} mm and {degrees(angle):.3g} deg off"
        console.say(f"{args.worst}: the worst, {off}")
