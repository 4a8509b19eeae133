"""Plan, time, execute and record a push: the whole pipeline in one call."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal

from pushplan.errors import PushplanError
from pushplan.plan import plan
from pushplan.planners.ompl.factories import planner_named
from pushplan.planners.ompl.search import Factory
from pushplan.result import PlanResult, ProgressPoint, Run
from pushplan.scenario import Scenario
from pushplan.stable_sets.named import add_set
from pushplan.stable_sets.stable_set import StableSet
from pushplan.stopwatch import Stopwatch


def run(
    scenario: Scenario,
    *,
    log: Path | str | None = None,
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
) -> Run:
    """Plan a push, execute it in the kinematic simulator, and record both.

    Args:
        scenario: The problem.
        log: File to write the run log to (MCAP); None records nothing. A run that finds no plan, or is refused,
            is recorded as well.
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
        tell: See `plan`.

    Raises:
        PushplanError: As `plan`, or when the log cannot be written.
    """
    watch = Stopwatch()

    def planned() -> PlanResult:
        return plan(
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
            progress=progress,
            tell=tell,
            watch=watch,
        )

    if log is None:
        result = planned()
        return Run(scenario, result, result.execution, None, watch.seconds)
    settings = {
        "planner": planner_named(planner or scenario.planner.name)[0],
        "set": add_set(stable_set or scenario.stability.set),
        "seed": scenario.planner.seed if seed is None else seed,
        "time_limit": scenario.planner.time_limit if time_limit is None else time_limit,
        "cost": cost or scenario.planner.cost,
        "margin": scenario.stability.margin if margin is None else margin,
        "gap": scenario.planner.gap if gap is None else gap,
    }
    with watch("logging"):
        from pushplan.logging.writer import RunLogWriter  # nobody waits for it who logs nothing

        writer = RunLogWriter.create(log, scenario, settings)
    with writer:
        try:
            result = planned()
        except PushplanError as error:
            writer.log("error", str(error))
            writer.finish("refused")
            raise
        with watch("logging"):
            writer.plan(result)
            if result.execution is not None:
                writer.execution(result.execution)
            writer.finish("solved" if result.solved else "unsolved", watch.seconds)
    return Run(scenario, result, result.execution, Path(log), watch.seconds)
