"""Plan, execute and record: the whole pipeline in one call."""

from __future__ import annotations

from pathlib import Path
from typing import Unpack

from pushplan.logging.recording import Recording, Where
from pushplan.planner import plan
from pushplan.planners.search.planners import planner_named
from pushplan.plans.plan import Plan
from pushplan.plans.run import Run
from pushplan.plans.settings import Observer, PlanOptions, PlanSettings, named
from pushplan.scenario.file import scenario_of
from pushplan.scenario.model import Scenario
from pushplan.sets.named import add_set
from pushplan.util.stopwatch import Stopwatch


@named
def run(
    scenario: Scenario | str | Path,
    *,
    log: Where = None,
    runs: Path | str | None = None,
    **options: Unpack[PlanOptions],
) -> Run:
    """Plan, execute in the kinematic simulator, and record both.

    Args:
        scenario: As for `plan`.
        log: File to write the run log to (MCAP), or False for none; None records the run in the folder `runs`. A
            run that finds no plan, or is refused, is recorded as well.
        runs: Folder of recorded runs; None for $PUSHPLAN_RUNS, else `pushplan/runs` in $XDG_STATE_HOME or in
            ~/.local/state. One that cannot be written is a warning, and `Run.log` is None then.
        **options: See `PlanSettings`. The observer takes warnings about the recording, too; the outcome in the log of
            a run that was cancelled is `interrupted`.

    Raises:
        PushplanError: As `plan`.
        OutputError: When the file named by `log` cannot be written: before planning, or, as an `IncompleteLogError`
            that has the run, after it.
    """
    scenario, watch, settings = scenario_of(scenario), Stopwatch(), PlanSettings(**options)
    observer = settings.observer
    with Recording(scenario, fields_of(scenario, settings), log, runs, observer.message, watch) as recording:
        options["observer"] = recording.listening(observer)
        found = plan(scenario, watch=watch, **options)
        recording.end(found, interrupted=observer.cancelled())
    return recording.finished(found)


def record(
    found: Plan, *, log: Where = None, runs: Path | str | None = None, observer: Observer | None = None
) -> Run:
    """Record a plan that is there already; arguments and errors as for `run`."""
    message = None if observer is None else observer.message
    with Recording(found.scenario, fields_of_plan(found), log, runs, message) as recording:
        for improvement in found.improvements:
            recording.improved(improvement)
        recording.end(found)
    return recording.finished(found)


def fields_of(scenario: Scenario, settings: PlanSettings) -> dict[str, object]:
    """Return what the log says of the settings: those asked for, and the scenario's where they are left open."""
    whole = settings.completed(scenario)
    return {
        "planner": planner_named(whole.planner or scenario.planner.name)[0],
        "set": add_set(whole.stable_set or scenario.stability.set),
        "seed": whole.seed,
        "time_limit": whole.time_limit,
        "cost": whole.cost,
        "margin": whole.margin,
        "gap": whole.gap,
    }


def fields_of_plan(plan: Plan) -> dict[str, object]:
    """Return what the log says of the settings with which a plan was made that is there already."""
    asked = plan.scenario
    return {
        "planner": plan.planner,
        "set": plan.stable_set,
        "seed": plan.seed,
        "cost": asked.planner.cost,
        "margin": asked.stability.margin,
    }
