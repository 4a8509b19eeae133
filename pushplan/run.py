"""Plan, time, execute and record a push: the whole pipeline in one call."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Unpack

from pushplan.plan import PlanOptions, plan
from pushplan.planners.ompl.factories import planner_named
from pushplan.plans.result import PlanResult, ProgressPoint, Run
from pushplan.recording import Recording, Where
from pushplan.scenario.model import Scenario
from pushplan.sets.named import add_set
from pushplan.util.names import OUT_OF_THE_WAY, TO_ITS_GOAL
from pushplan.util.stopwatch import Stopwatch

if TYPE_CHECKING:
    from pushplan.rearrangement.plan import Leg


def run(
    scenario: Scenario,
    *,
    log: Where = None,
    runs: Path | str | None = None,
    **options: Unpack[PlanOptions],
) -> Run:
    """Plan a push, execute it in the kinematic simulator, and record both.

    Args:
        scenario: The problem.
        log: File to write the run log to (MCAP), or False for none; None records the run in the folder `runs`. A
            run that finds no plan, or is refused, is recorded as well.
        runs: Folder of recorded runs; None for $PUSHPLAN_RUNS, else `pushplan/runs` in $XDG_STATE_HOME or in
            ~/.local/state. One that cannot be written is a warning, and `Run.log` is None then.
        **options: Keywords of `plan`, but for `watch`. `tell` takes warnings about the recording, too; the outcome in
            the log of a run that was told to `stop` is `interrupted`.

    Raises:
        PushplanError: As `plan`.
        OutputError: When the file named by `log` cannot be written: before planning, or, as an `IncompleteLogError`
            that has the run, after it.
    """
    watch = Stopwatch()
    progress, stop = options.get("progress"), options.get("stop")
    with Recording(scenario, _told(scenario, options), log, runs, options.get("tell"), watch) as recording:

        def improved(point: ProgressPoint) -> None:
            recording.improved(point)
            if progress is not None:
                progress(point)

        options["progress"] = improved
        result = plan(scenario, **options, watch=watch)
        recording.end(result, interrupted=stop is not None and stop())
    return recording.finished(result)


def record(
    scenario: Scenario,
    result: PlanResult,
    *,
    log: Where = None,
    runs: Path | str | None = None,
    tell: Callable[[str], None] | None = None,
) -> Run:
    """Record a plan that is there already; arguments and errors as for `run`."""
    watch = Stopwatch()
    with Recording(scenario, _told(scenario, {"seed": result.seed}), log, runs, tell, watch) as recording:
        for point in result.progress:
            recording.improved(point)
        recording.end(result, interrupted=False)
    return recording.finished(result)


def record_errands(
    errands: Sequence[Leg],
    *,
    log: Where = None,
    runs: Path | str | None = None,
    tell: Callable[[str], None] | None = None,
) -> Path | None:
    """Record the errands that bring several objects to their goals, one after the other in one log.

    Args:
        errands: Of a `Rearrangement`, at least one.
        log: As for `run`, like the others.
        runs: Folder of recorded runs.
        tell: Takes warnings.

    Returns:
        The log; None where there is none.
    """
    first, watch = errands[0], Stopwatch()
    with Recording(first.scenario, _told_errand(first), log, runs, tell, watch) as recording:
        for errand, after in pairwise(errands):
            recording.follow(errand.plan, after.scenario, _told_errand(after))
        recording.end(errands[-1].plan, interrupted=False)
    return recording.finished(errands[-1].plan).log


def _told_errand(errand: Leg) -> dict[str, object]:
    aim = TO_ITS_GOAL if errand.delivers else OUT_OF_THE_WAY
    return {**_told(errand.scenario, {"seed": errand.plan.seed}), "errand": errand.name, "aim": aim}


def _told(scenario: Scenario, options: PlanOptions) -> dict[str, object]:
    """Return what the log says of the settings: the options, and the scenario's where they leave it open."""

    def chosen(name: Literal["seed", "time_limit", "cost", "margin", "gap"], otherwise: object) -> object:
        value = options.get(name)
        return otherwise if value is None else value

    own = scenario.planner
    return {
        "planner": planner_named(options.get("planner") or own.name)[0],
        "set": add_set(options.get("stable_set") or scenario.stability.set),
        "seed": chosen("seed", own.seed),
        "time_limit": chosen("time_limit", own.time_limit),
        "cost": chosen("cost", own.cost),
        "margin": chosen("margin", scenario.stability.margin),
        "gap": chosen("gap", own.gap),
    }
