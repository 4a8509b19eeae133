"""Monte Carlo trials of a plan, a scenario or a recorded run, and their logs."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pushplan.errors import PlanningError, PushplanError, RunLogError
from pushplan.logging.recording import Recording, Where
from pushplan.logging.verify import Check
from pushplan.planner import plan
from pushplan.plans.execution import TrialEnd
from pushplan.plans.plan import Plan
from pushplan.plans.robustness import TrialUncertainty
from pushplan.plans.settings import Observer, PlanSettings
from pushplan.run import fields_of, fields_of_plan
from pushplan.scenario.model import Scenario
from pushplan.sim.report import ContactLoss, with_margins
from pushplan.sim.slip import slip
from pushplan.sim.trials import Simulator, Trials, execute_trials, sampled_world
from pushplan.util.names import SIMULATORS
from pushplan.util.naming import SIMULATOR_NAMES, function_named

if TYPE_CHECKING:
    from pushplan.logging.recorded import RecordedRun
    from pushplan.plans.execution import Execution
    from pushplan.plans.run import Run

TRIAL = "pushplan.trial"
"""Metadata record of trial logs: seed, uncertainty, simulator, and the index of the sample in a log of only one."""


def trial(
    what: Scenario | Plan | Run | RecordedRun | Path | str,
    samples: int = 200,
    *,
    uncertainty: TrialUncertainty | None = None,
    seed: int = 1,
    simulator: Simulator | str = SIMULATORS[0],
    jobs: int | None = None,
    log: Where = False,
    runs: Path | str | None = None,
    observer: Observer | None = None,
    progress: Callable[[TrialEnd], None] | None = None,
) -> Trials:
    """Execute a plan in Monte Carlo samples with random friction, loads and object poses.

    Args:
        what: Plan, run, or path of a log. A scenario is planned first, with its own settings.
        samples: Number of samples.
        uncertainty: Size of the deviations. None uses the intervals of the scenario where it specifies any, and the
            defaults of `TrialUncertainty` otherwise.
        seed: Seed of the samples; the same seed gives the same samples.
        simulator: Function of a plan and a world that returns a `ContactReport`, or its name: `slip`,
            `module:attribute`, or the name of an installed simulator.
        jobs: Number of threads; None for one per processor.
        log: Log file for the plan and the outcome of each sample, written as they finish; None for a file in the
            folder `runs`, False for none.
        runs: Folder of the logs, as in `pushplan.run`.
        observer: Receiver of messages about planning and recording.
        progress: Callback with the outcome of each sample, in order.

    Raises:
        PlanningError: If there is no plan.
        PushplanError: If no simulator has this name.
        RunLogError: If the log cannot be read.
        SupportError: If the load under an object is not known.
        OutputError: If the log cannot be written, as in `pushplan.run`.
    """
    if isinstance(what, Path | str):
        from pushplan.logging.reader import load_run

        what = load_run(what)
    execute, observer = simulator_named(simulator), Observer() if observer is None else observer
    scenario = what if isinstance(what, Scenario) else what.scenario
    known = what if isinstance(what, Plan) else None if isinstance(what, Scenario) else what.plan
    fields = fields_of(scenario, PlanSettings()) if known is None else fields_of_plan(known)
    with Recording(scenario, fields, log, runs, observer.message) as recording:
        recording.write(lambda log: log.note(TRIAL, _trial_fields(seed, uncertainty, execute)))
        if isinstance(what, Scenario):
            known = plan(scenario, observer=recording.listening(observer))
        found = known
        if found is not None:
            recording.write(lambda log: log.plan(found))
        if found is None or found.trajectory is None:
            why = "the log ends before a plan" if found is None else found.reason
            raise PlanningError(f"there is no plan to execute: {why}")

        def ended(end: TrialEnd) -> None:
            recording.write(lambda log: log.trial(end))
            if progress is not None:
                progress(end)

        done = execute_trials(found, samples, uncertainty, seed, execute, jobs, ended)
        rate = f"{int(done.arrived.sum())} of {done.samples} samples arrive"
        recording.write(lambda log: log.log("info", rate))
        recording.finish("tried")
    recording.require_whole(done)
    return replace(done, log=recording.log)


def simulator_named(simulator: Simulator | str) -> Simulator:
    """Return the simulator with a name; return a function unchanged.

    Raises:
        PushplanError: If no simulator has this name.
    """
    if not isinstance(simulator, str):
        return simulator
    return slip if simulator == SIMULATORS[0] else function_named(simulator, SIMULATOR_NAMES, "simulator")


def write_trial(trials: Trials, sample: int, path: Path | str) -> None:
    """Simulate a sample again and write its log, which viewers play with the slipping objects.

    Raises:
        OutputError: If the file cannot be written.
    """
    from pushplan.logging.writer import RunLogWriter

    plan, report = trials.plan, trials.report(sample)
    words = _trial_fields(trials.seed, trials.uncertainty, trials.simulator) | {"sample": str(sample)}
    with RunLogWriter.create(path, trials.scenario, fields_of_plan(plan)) as log:
        log.note(TRIAL, words)
        log.plan(plan)
        log.execution(report.execution)
        loss = report.loss
        if isinstance(loss, ContactLoss):
            what = f"{loss.contact} was the first contact to move, at {loss.time:.2f} s"
            log.log("warning", f"{what} ({loss.mode.name.lower()})")
        if report.jammed_at is not None:
            log.log("warning", f"jammed at {report.jammed_at:.2f} s: no motion satisfies all contacts")
        if report.stalled_at is not None:
            limit = plan.scenario.pusher.limits.force
            log.log("warning", f"stalled at {report.stalled_at:.2f} s: the push needs more than {limit:.3g} N")
        log.finish("arrived" if report.arrived(trials.scenario) else "missed")


def _trial_fields(seed: int, uncertainty: TrialUncertainty | None, simulator: Simulator) -> dict[str, str]:
    named = simulator if hasattr(simulator, "__qualname__") else type(simulator)
    name = SIMULATORS[0] if simulator is slip else f"{named.__module__}:{named.__qualname__}"
    drawn = None if uncertainty is None else asdict(uncertainty)
    return {"seed": str(seed), "uncertainty": json.dumps(drawn), "simulator": name}


def executed_again(run: RecordedRun) -> Execution | None:
    """Execute the sample of a single-sample log again; None if another simulator than pushplan's own executed it.

    Raises:
        RunLogError: If the log does not name its sample.
    """
    seed, uncertainty, simulated = _read_trial_fields(run)
    if not simulated or run.plan is None:
        return None
    try:
        sample = int(run.fields[TRIAL]["sample"])
    except (KeyError, ValueError) as error:
        raise RunLogError(str(run.path), f"the sample of the trial cannot be read: {error}") from error
    world = sampled_world(run.scenario, uncertainty, np.random.default_rng([seed, sample]))
    return with_margins(slip(run.plan, world), run.plan).execution


def check_trials(run: RecordedRun) -> list[Check]:
    """Execute the plan of a log again in its samples and compare the outcomes.

    Raises:
        RunLogError: If the log does not say how its samples were drawn.
    """
    seed, uncertainty, simulated = _read_trial_fields(run)
    if not simulated or run.plan is None or not run.trials:
        return []
    again: list[TrialEnd] = []
    execute_trials(run.plan, len(run.trials), uncertainty, seed, slip, progress=again.append)
    checks = []
    for name in ("objects", "errors"):
        first, second = (np.array([getattr(end, name) for end in ends]) for ends in (run.trials, again))
        checks.append(Check(f"trials: {name}", float(np.abs(first - second).max())))
    for name in ("arrived", "jammed", "contact", "mode", "time", "object", "point"):
        values = [[str(getattr(end, name)) for end in ends] for ends in (run.trials, again)]
        count = sum(one != other for one, other in zip(*values, strict=True))
        checks.append(Check(f"trials: {name}", float(count), 0.0, what=f"{count} samples differ" * (count > 0)))
    return checks


def _read_trial_fields(run: RecordedRun) -> tuple[int, TrialUncertainty | None, bool]:
    """Return seed and uncertainty of the samples of a log, and whether the simulator is pushplan's own."""
    try:
        fields = run.fields[TRIAL]
        values = json.loads(fields["uncertainty"])
        uncertainty = None if values is None else TrialUncertainty(**values)
        return int(fields["seed"]), uncertainty, fields["simulator"] == SIMULATORS[0]
    except (KeyError, TypeError, ValueError, PushplanError) as error:
        what = f"the seed and uncertainty of the trials cannot be read: {error}"
        raise RunLogError(str(run.path), what) from error
