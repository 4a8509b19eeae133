"""One run from scenario to checked execution: what the process of a run does."""

from __future__ import annotations

import os
import resource
from dataclasses import replace
from pathlib import Path

from pushplan.bench.processes.child import resident_megabytes
from pushplan.bench.processes.outcome import Figures, Task
from pushplan.bench.processes.validation import clearance, flaw, with_kept_margin
from pushplan.errors import EmptyStableSetError, PlanningError
from pushplan.plans.result import Run
from pushplan.run import run
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.util.stopwatch import Stopwatch

LOG = "run.mcap"
"""Name of the run's log in the run's folder."""


def perform(task: Task, folder: Path) -> Figures:
    """Plan, time, execute, log and check one push.

    Args:
        task: What to do.
        folder: Where the log goes.

    Raises:
        PushplanError: When the problem cannot be read or posed.
    """
    watch, base = Stopwatch(), resident_megabytes(os.getpid())
    with watch("loading"):
        scenario = scenario_from_text(task.source, f"{task.name}.yaml", task.attachments)
    try:
        done = run(
            scenario,
            log=folder / LOG,
            planner=task.planner,
            stable_set=task.stable_set,
            seed=task.seed,
            time_limit=task.time_limit,
            first=task.first,
            iterations=task.iterations,
            cost=task.cost,
            gap=task.gap,
        )
    except (PlanningError, EmptyStableSetError) as error:
        return Figures(reason=str(error), seconds=watch.seconds, memory=peak_memory() - base)
    success = _success(done, task, watch) if task.trials else None
    return replace(figures(scenario, done, watch), trial_success=success, memory=peak_memory() - base)


def _success(done: Run, task: Task, watch: Stopwatch) -> float | None:
    """Return the share of sampled worlds in which a plan arrives; None without a plan or known loads."""
    if done.plan.trajectory is None or not done.scenario.chain.loads_known:
        return None
    with watch("trials"):
        from pushplan.sim.trials.execute import execute_trials  # most suites do not ask for it

        return execute_trials(
            done.scenario, done.plan.trajectory, task.trials, seed=task.seed, jobs=1
        ).success


def figures(scenario: Scenario, done: Run, watch: Stopwatch) -> Figures:
    """Check an execution and return all that was measured but the memory."""
    plan, execution = done.plan, done.execution
    with watch("validation"):
        fault = plan.reason if execution is None else flaw(with_kept_margin(scenario, plan), execution)
        free = None if execution is None else clearance(scenario, execution)
    path = plan.path
    arcs = (
        []
        if path is None
        else [(*t, s) for t, s in zip(path.twists.tolist(), path.lengths.tolist(), strict=True)]
    )
    error = (None, None) if execution is None else execution.goal_error
    return Figures(
        reason=fault,
        found=plan.solved or plan.first_solution_s is not None,
        valid=plan.solved and not fault,
        first_solution_s=plan.first_solution_s,
        seconds={**watch.seconds, **done.seconds},
        path_cost=None if path is None else path.cost,
        lower_bound=plan.lower_bound,
        arcs=tuple(arcs),
        clearance=free,
        goal_position_error=error[0],
        goal_angle_error=error[1],
        margin=plan.margin,
        min_margin=None if execution is None else execution.min_margin,
        min_dynamic_margin=None if execution is None else execution.min_dynamic_margin,
        duration=None if plan.trajectory is None else plan.trajectory.duration,
        extensions=plan.extensions,
        progress=tuple((point.seconds, point.cost, point.iterations) for point in plan.progress),
    )


def peak_memory() -> float:
    """Return the largest resident set that this process has had, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6
