"""Plans, executes and records in one call."""

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
        scenario: See `plan`.
        log: File of the run log (MCAP); None for a file in the folder `runs`, False for no log. A run without a plan
            or with an invalid problem is recorded as well.
        runs: Folder of recorded runs; None for $PUSHPLAN_RUNS, else `pushplan/runs` in $XDG_STATE_HOME or in
            ~/.local/state. If this folder cannot be written, there is a warning and `Run.log` is None.
        **options: See `PlanSettings`. The observer also gets warnings about the recording. A cancelled run has the
            outcome `interrupted` in its log.

    Raises:
        PushplanError: See `plan`.
        OutputError: If the file `log` cannot be written. After planning this is an `IncompleteLogError`, which holds
            the run.
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
    """Record an existing plan; see `run` for the arguments and errors."""
    message = None if observer is None else observer.message
    with Recording(found.scenario, fields_of_plan(found), log, runs, message) as recording:
        for improvement in found.improvements:
            recording.improved(improvement)
        recording.end(found)
    return recording.finished(found)


def fields_of(scenario: Scenario, settings: PlanSettings) -> dict[str, object]:
    """Return the settings for the log's metadata, completed from the scenario."""
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
    """Return the settings of an existing plan for the log's metadata."""
    scenario = plan.scenario
    return {
        "planner": plan.planner,
        "set": plan.stable_set,
        "seed": plan.seed,
        "cost": scenario.planner.cost,
        "margin": scenario.stability.margin,
    }
