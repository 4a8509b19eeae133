"""Plan, time, execute and record a push: the whole pipeline in one call."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal

from pushplan.plan import plan
from pushplan.planners.ompl.factories import planner_named
from pushplan.planners.ompl.search import Factory
from pushplan.recording import Recording, Where
from pushplan.result import ProgressPoint, Run
from pushplan.scenario import Scenario
from pushplan.stable_sets.named import add_set
from pushplan.stable_sets.stable_set import StableSet
from pushplan.stopwatch import Stopwatch


def run(
    scenario: Scenario,
    *,
    log: Where = None,
    runs: Path | str | None = None,
    planner: str | Factory | None = None,
    stable_set: str | type[StableSet] | None = None,
    seed: int | None = None,
    time_limit: float | None = None,
    first: bool = False,
    iterations: int | None = None,
    cost: str | None = None,
    margin: float | Literal["auto"] | None = None,
    gap: float | None = None,
    progress: Callable[[ProgressPoint], None] | None = None,
    tell: Callable[[str], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> Run:
    """Plan a push, execute it in the kinematic simulator, and record both.

    Args:
        scenario: The problem.
        log: File to write the run log to (MCAP), or False for none; None records the run in the folder `runs`. A
            run that finds no plan, or is refused, is recorded as well.
        runs: Folder of recorded runs; None for $PUSHPLAN_RUNS, else `pushplan/runs` in $XDG_STATE_HOME or in
            ~/.local/state. One that cannot be written is a warning, and `Run.log` is None then.
        planner: See `plan`.
        stable_set: See `plan`.
        seed: See `plan`.
        time_limit: See `plan`.
        first: See `plan`.
        iterations: See `plan`.
        cost: See `plan`.
        margin: See `plan`.
        gap: See `plan`.
        progress: See `plan`.
        tell: See `plan`; takes warnings about the recording, too.
        stop: See `plan`; the outcome in the log of a run that was told to stop is `interrupted`.

    Raises:
        PushplanError: As `plan`.
        OutputError: When the file named by `log` cannot be written: before planning, or, as an `IncompleteLogError`
            that has the run, after it.
    """
    watch = Stopwatch()
    settings = {
        "planner": planner_named(planner or scenario.planner.name)[0],
        "set": add_set(stable_set or scenario.stability.set),
        "seed": scenario.planner.seed if seed is None else seed,
        "time_limit": scenario.planner.time_limit if time_limit is None else time_limit,
        "cost": cost or scenario.planner.cost,
        "margin": scenario.stability.margin if margin is None else margin,
        "gap": scenario.planner.gap if gap is None else gap,
    }
    with Recording(scenario, settings, log, runs, tell, watch) as recording:

        def improved(point: ProgressPoint) -> None:
            recording.improved(point)
            if progress is not None:
                progress(point)

        result = plan(
            scenario,
            planner=planner,
            stable_set=stable_set,
            seed=seed,
            time_limit=time_limit,
            first=first,
            iterations=iterations,
            cost=cost,
            margin=margin,
            gap=gap,
            progress=improved,
            tell=tell,
            watch=watch,
            stop=stop,
        )
        recording.end(result, interrupted=stop is not None and stop())
    return recording.finished(result)
