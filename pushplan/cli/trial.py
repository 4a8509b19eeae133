"""Execute a plan in Monte Carlo samples of friction, loads and places."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pushplan.cli import parameters as p
from pushplan.cli.console import Console, angle_text, length_text
from pushplan.cli.main import DEFECT, DONE, NO_PLAN, error_document
from pushplan.errors import PlanningError
from pushplan.scenario import units
from pushplan.util.names import SIMULATORS

if TYPE_CHECKING:
    from pushplan.plans.execution import TrialEnd
    from pushplan.plans.plan import Plan
    from pushplan.plans.robustness import TrialUncertainty
    from pushplan.sim.trials import Trials

_UNITS = {
    **dict.fromkeys(("contact_friction", "floor_friction", "mass", "load"), units.FRACTION),
    "position": units.LENGTH,
    "angle": units.ANGLE,
}


def _uncertainty(found: dict[str, Any]) -> TrialUncertainty:
    from pushplan.plans.robustness import TrialUncertainty

    return TrialUncertainty(**{**dict.fromkeys(_UNITS, 0.0), **found})


UNCERTAINTY = p.named(_UNITS, _uncertainty)
"""Type of the model errors of trials; plain numbers are shares, m and rad."""


@p.command
@click.argument("source", type=p.SCENARIO, metavar="SCENARIO|RUN.mcap")
@click.option(
    "--samples", type=p.COUNT, metavar="N", default=200, show_default=True, help="Number of Monte Carlo samples."
)
@click.option(
    "--uncertainty",
    type=UNCERTAINTY,
    metavar="NAME=VALUE,...",
    help="Largest model errors: contact_friction, floor_friction, mass, load, position, angle; e.g. "
    "contact_friction=20%,load=10%,position=1mm,angle=0.3deg. Others stay nominal. Default: the "
    "scenario's intervals, else 20 % of friction, 10 % of load, 1 mm and 0.3 deg.",
)
@click.option("--seed", type=p.SEED, metavar="N", default=1, show_default=True, help="Seed of the samples.")
@click.option("--jobs", type=p.COUNT, metavar="N", help="Number of threads (default: one per processor).")
@click.option(
    "--simulator", type=p.SIMULATOR, default=SIMULATORS[0], show_default=True, help="Simulator of the samples."
)
@p.log_options("Write a log (MCAP) of the plan and the outcomes, and the plan's page beside it.")
@p.plot_option
@p.file_option("--worst", help="Write the log (MCAP) of the sample with the largest goal error.")
@p.no_code_option
def trial(
    console: Console,
    source: str,
    samples: int,
    uncertainty: Any,
    seed: int,
    jobs: int | None,
    simulator: str,
    log: p.LogChoice,
    plot: Path | None,
    worst: Path | None,
    no_code: bool,
) -> int:
    """Execute a plan in Monte Carlo samples of friction, loads and poses, and count how often it arrives.

    The plan comes from a log, or is computed first. Without -o, the log goes into the folder of the recorded runs. It
    grows with each sample.
    """
    p.check_outputs([source], None, log=worst)
    p.check_outputs([source], plot, worst, log=log.output)
    incomplete = None
    with p.code_of(source, console.note, no_code):
        if Path(source).suffix == ".mcap":
            from pushplan.logging.reader import load_run

            with console.working(f"reading {source}"):
                what: Any = load_run(source)
        else:
            from pushplan.scenario.file import load_scenario

            what = load_scenario(source)
        scenario: Any = getattr(what, "scenario", what)
        name: str = scenario.name
        with console.working(f"executing {samples} trials") as progress:
            from pushplan.logging.recording import IncompleteLogError
            from pushplan.plans.settings import Observer
            from pushplan.trial import trial as executed

            try:
                trials = executed(
                    what,
                    samples,
                    uncertainty=uncertainty,
                    seed=seed,
                    simulator=simulator,
                    jobs=jobs,
                    log=log.where,
                    runs=log.runs,
                    observer=Observer(message=progress.announce),
                    progress=lambda end: progress.update_share(end.sample + 1, samples),
                )
            except PlanningError as error:
                console.say(f"{name}: {error}")
                console.emit({"scenario": name, "solved": False, "reason": str(error)})
                return NO_PLAN
            except IncompleteLogError as error:
                trials, incomplete = error.run, error
    low, high = trials.interval
    rate = f"{int(trials.arrived.sum())} of {trials.samples} samples arrive"
    console.say((name, "bold"), f": {rate} ({100 * low:.1f} to {100 * high:.1f} % at 95 %)")
    from pushplan.cli.render import write_page
    from pushplan.plans.run import Run

    planned = Run(trials.scenario, trials.plan, trials.plan.execution, trials=trials.ends)
    page = write_page(planned, None, log.paged, console)
    console.table([*_rows(trials), *([] if page is None else [("page", str(page))])])
    if plot is not None:
        draw_trials(trials.plan, trials.ends, plot, console)
    if worst is not None:
        from pushplan.trial import write_trial

        write_trial(trials, trials.worst, worst)
        position, angle = trials.goal_errors[trials.worst]
        off = f"goal error {length_text(position)}, {angle_text(angle)}"
        console.say(f"{worst}: the worst sample, {trials.worst}, {off}")
    document = _document(trials, worst) | {"page": page}
    if incomplete is not None:
        console.note(f"error: {incomplete}")
        document["error"] = error_document(incomplete)
    console.emit(document)
    return DONE if incomplete is None else DEFECT


def draw_trials(plan: Plan, ends: Sequence[TrialEnd], path: Path, console: Console) -> None:
    """Write a picture of trials over the area that the plan sweeps without slip."""
    with console.working(f"drawing {path}"):
        from pushplan.drawing.trials import plot_trials
        from pushplan.sim.kinematic import execute

        rigid = execute(plan.scenario, plan.segments, plan.stable_set)
        plot_trials(replace(plan, execution=rigid), ends, path)


def _rows(trials: Trials) -> list[tuple[str, str]]:
    from pushplan.plans.robustness import TrialUncertainty
    from pushplan.sim.trials import INERTIA

    position, angle = _percentiles(trials)
    scenario = trials.scenario
    of = scenario.goal.of if scenario.task.one_load else None
    of = "worst object" if of is None else of
    failed = ", ".join(f"{name} {count}" for name, count in trials.first_failures.items())
    uncertainty = (trials.uncertainty or TrialUncertainty()).words
    if trials.uncertainty is None and scenario.has_intervals:
        uncertainty = f"the scenario's intervals, {TrialUncertainty(0.0, 0.0, 0.0, 0.0).words}"
    if slipping := sum(end.mode == INERTIA for end in trials.ends):
        failed += f"; {slipping} of them only with inertia"
    left_out = "" if trials.with_inertia else ", without inertia (limits.contact: quasi-static)"
    goal = next(goals[0] for goals in scenario.goals.values())
    words = {"position": length_text(goal.position_tolerance), "angle": angle_text(goal.angle_tolerance)}
    missed = ", ".join(f"{name} ({words[name]}) in {count} samples" for name, count in trials.missed.items())
    found = [
        ("uncertainty", uncertainty),
        ("contacts held", f"in {100.0 * trials.held:.1f} %{left_out}"),
        ("first to move", failed or "none"),
        ("tolerance missed", missed or "none"),
        (f"goal error ({of})", f"median {_off(position[0], angle[0])}, 90 % within {_off(position[1], angle[1])}"),
        ("largest error", _off(position[2], angle[2])),
    ]
    if trials.jammed.any():
        count, slipped = int(trials.jammed.sum()), int((trials.jammed & trials.lost).sum())
        why = f"{count} samples: the push stopped at an obstacle or a wall"
        if slipped:
            why += f", in {slipped} of them after a contact had moved"
        if slipped < count:
            why += f"; increase the clearance above {length_text(scenario.clearance)}"
        found.append(("jammed", why))
    return [*found, ("log", str(trials.log))] if trials.log is not None else found


def _percentiles(trials: Trials) -> list[list[float]]:
    """Return median, 90th percentile and maximum of the position error (m) and the angle error (rad)."""
    import numpy as np

    found: list[list[float]] = np.percentile(trials.goal_errors, [50, 90, 100], axis=0).T.tolist()
    return found


def _off(position: float, angle: float) -> str:
    return f"{length_text(position)} / {angle_text(angle)}"


def _document(trials: Trials, worst: Path | None) -> dict[str, object]:
    position, angle = _percentiles(trials)
    return {
        "scenario": trials.scenario.name,
        "solved": True,
        "samples": trials.samples,
        "seed": trials.seed,
        "uncertainty": None if trials.uncertainty is None else asdict(trials.uncertainty),
        "arrived": int(trials.arrived.sum()),
        "success": trials.success,
        "interval": list(trials.interval),
        "held": trials.held,
        "with_inertia": trials.with_inertia,
        "missed": trials.missed,
        "jammed": int(trials.jammed.sum()),
        "first_failures": trials.first_failures,
        "failures": [
            {"sample": end.sample, "contact": end.contact, "mode": end.mode, "time": end.time, "point": end.point}
            for end in trials.ends
            if end.contact
        ],
        "goal_error": {
            name: {"median": values[0], "p90": values[1], "max": values[2]}
            for name, values in (("position", position), ("angle", angle))
        },
        "worst": {"sample": trials.worst, "log": worst},
        "log": trials.log,
    }
