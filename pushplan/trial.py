"""Try a plan in sampled worlds: the plan of a scenario, or that of a recorded run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from pushplan.errors import PlanningError
from pushplan.logging.old.reader import read_run
from pushplan.plan import plan
from pushplan.scenario.model import Scenario
from pushplan.sim.slip.settings import SlipSettings
from pushplan.sim.slip.simulator import DEFAULTS
from pushplan.sim.trials.execute import execute_trials
from pushplan.sim.trials.result import Trials
from pushplan.sim.trials.uncertain import TrialUncertainty

if TYPE_CHECKING:
    from pushplan.logging.old.messages.recorded import RecordedRun
    from pushplan.plans.result import Run


def trial(
    what: Scenario | Run | RecordedRun | Path | str,
    samples: int = 200,
    *,
    uncertainty: TrialUncertainty | None = None,
    seed: int = 1,
    settings: SlipSettings = DEFAULTS,
    jobs: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> Trials:
    """Execute a plan in worlds whose friction, loads and places of objects are drawn at random.

    Args:
        what: A run, or the path of its log; of a scenario, a plan is made first, with the scenario's own settings.
        samples: Number of worlds.
        uncertainty: By how much worlds differ. None takes the intervals of the scenario where it states any, and the
            defaults of `TrialUncertainty` otherwise.
        seed: Of the worlds: the same seed gives the same ones.
        settings: Of the simulator.
        jobs: Threads; None for one a processor.
        progress: Called with the number of samples that are done.

    Raises:
        PlanningError: When there is no plan.
        RunLogError: When the log cannot be read.
        SupportError: When the load under an object is not known.
    """
    run = read_run(what) if isinstance(what, Path | str) else what
    scenario = run if isinstance(run, Scenario) else run.scenario
    result = plan(run) if isinstance(run, Scenario) else run.plan
    if result is None or result.trajectory is None:
        why = "the log ends before a plan" if result is None else result.reason
        raise PlanningError(f"there is no plan to try: {why}")
    return execute_trials(scenario, result.trajectory, samples, uncertainty, seed, settings, jobs, progress)
