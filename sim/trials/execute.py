"""Execute a trajectory in sampled worlds, several at a time."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from pushplan.errors import PushplanError
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.model import Scenario
from pushplan.sim.slip.settings import SlipSettings
from pushplan.sim.slip.simulate import simulate
from pushplan.sim.slip.simulator import DEFAULTS
from pushplan.sim.trials.result import Trials
from pushplan.sim.trials.uncertain import TrialUncertainty, sampled_world


def execute_trials(
    scenario: Scenario,
    trajectory: Trajectory,
    samples: int = 200,
    uncertainty: TrialUncertainty | None = None,
    seed: int = 1,
    settings: SlipSettings = DEFAULTS,
    jobs: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> Trials:
    """Execute a trajectory in sampled worlds.

    Args:
        scenario: What the plan believes.
        trajectory: The plan.
        samples: Number of worlds.
        uncertainty: See `sampled_world`.
        seed: Of the random numbers: the same seed gives the same worlds.
        settings: Of the simulator.
        jobs: Threads; None for one a processor.
        progress: Called with the number of samples that are done.

    Raises:
        PushplanError: When `samples` is below 1.
        SupportError: When the load under an object is not known.
    """
    if samples < 1:
        raise PushplanError(f"the number of samples is {samples}; it must be at least 1")

    def one(i: int) -> tuple[object, ...]:
        world = sampled_world(scenario, uncertainty, np.random.default_rng([seed, i]))
        report = simulate(trajectory, world, settings)
        jammed = report.jammed_at is not None
        return (
            report.goal_errors(scenario.goal),
            report.object_poses[-1],
            report.arrived(scenario.goal),
            report.loss,
            jammed,
        )

    found = []
    with ThreadPoolExecutor(jobs or os.cpu_count() or 1) as pool:
        for row in pool.map(one, range(samples)):
            found.append(row)
            if progress is not None:
                progress(len(found))
    errors, poses, arrived, losses, jammed = zip(*found, strict=True)
    return Trials(
        scenario=scenario,
        trajectory=trajectory,
        uncertainty=uncertainty,
        seed=seed,
        settings=settings,
        errors=np.array(errors),
        object_poses=np.array(poses),
        arrived=np.array(arrived, dtype=np.bool_),
        losses=losses,
        jammed=np.array(jammed, dtype=np.bool_),
    )
