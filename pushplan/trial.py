"""Try a plan in sampled worlds: one of any kind, that of a scenario, or that of a recorded run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from pushplan.errors import PlanningError
from pushplan.planners.planner import plan
from pushplan.plans.plan import Plan
from pushplan.scenario.model import Scenario
from pushplan.sim.report import ContactLoss
from pushplan.sim.slip.simulator import slip
from pushplan.sim.trials import Simulator, Trials, TrialUncertainty, execute_trials
from pushplan.util.names import SIMULATORS
from pushplan.util.naming import function_named, simulator_names

if TYPE_CHECKING:
    from pushplan.logging.recorded import RecordedRun
    from pushplan.plans.run import Run


def trial(
    what: Scenario | Plan | Run | RecordedRun | Path | str,
    samples: int = 200,
    *,
    uncertainty: TrialUncertainty | None = None,
    seed: int = 1,
    simulator: Simulator | str = SIMULATORS[0],
    jobs: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> Trials:
    """Execute a plan in worlds whose friction, loads and places of objects are drawn at random.

    Args:
        what: A plan, a run, or the path of its log; of a scenario, a plan is made first, with the scenario's own
            settings.
        samples: Number of worlds.
        uncertainty: By how much worlds differ. None takes the intervals of the scenario where it states any, and the
            defaults of `TrialUncertainty` otherwise.
        seed: Of the worlds: the same seed gives the same ones.
        simulator: What executes it: a function of a plan and a world that returns a `ContactReport`, or the name of
            one: `slip`, `module:attribute`, or that of an installed package.
        jobs: Threads; None for one a processor.
        progress: Called with the number of samples that are done.

    Raises:
        PlanningError: When there is no plan.
        PushplanError: When no simulator has this name.
        RunLogError: When the log cannot be read.
        SupportError: When the load under an object is not known.
    """
    found, execute = plan_to_try(what), simulator_named(simulator)
    return execute_trials(found, samples, uncertainty, seed, execute, jobs, progress)


def simulator_named(simulator: Simulator | str) -> Simulator:
    """Return a simulator by its name.

    Raises:
        PushplanError: When there is none.
    """
    if not isinstance(simulator, str):
        return simulator
    return slip if simulator == SIMULATORS[0] else function_named(simulator, simulator_names(), "simulator")


def plan_to_try(what: Scenario | Plan | Run | RecordedRun | Path | str) -> Plan:
    """Return the plan of what `trial` takes.

    Raises:
        PlanningError: When there is none.
        RunLogError: When the log cannot be read.
    """
    if isinstance(what, Path | str):
        from pushplan.logging.reader import load_run

        what = load_run(what)
    if isinstance(what, Scenario):
        what = plan(what)
    found = what if isinstance(what, Plan) else what.plan
    if found is None or found.trajectory is None:
        why = "the log ends before a plan" if found is None else found.reason
        raise PlanningError(f"there is no plan to try: {why}")
    return found


def write_trial(trials: Trials, sample: int, path: Path | str) -> None:
    """Simulate a sample again and write its log; viewers show the objects where contacts slipped.

    Raises:
        OutputError: When the file cannot be written.
    """
    from pushplan.logging.writer import RunLogWriter

    plan, report = trials.plan, trials.report(sample)
    settings = {"planner": plan.planner, "set": plan.stable_set, "seed": plan.seed}
    words = {**settings, "trial_seed": trials.seed, "trial_sample": sample}
    with RunLogWriter.create(path, trials.scenario, words) as log:
        log.plan(plan)
        log.execution(report.execution)
        loss = report.loss
        if isinstance(loss, ContactLoss):
            what = f"{loss.contact} was the first contact to move, at {loss.time:.2f} s"
            log.log("warning", f"{what} ({loss.mode.name.lower()})")
        if report.jammed_at is not None:
            log.log("warning", f"jammed at {report.jammed_at:.2f} s: no motion satisfies all contacts")
        log.finish("arrived" if report.arrived(trials.scenario) else "missed")
