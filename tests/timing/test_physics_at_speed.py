"""Dynamic limits before the physics engine: with them a fast pusher keeps every contact, without them it does not."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from conftest import ChainMaker

from pushplan.mechanics.chain import Chain, Limits
from pushplan.mechanics.dynamics import ContactDynamics
from pushplan.planners.timing.arc_limits import Bounds
from pushplan.planners.timing.blending import blend_path
from pushplan.planners.timing.exact_timing import time_path
from pushplan.plans.path import PushPath, cost_rate
from pushplan.scenario.model import Scenario
from pushplan.sets.named import stable_set
from pushplan.sets.stable_set import StableSet
from pushplan.sim.physics.simulate import simulate_trajectory
from pushplan.util.arrays import FloatArray

FAST = Limits(0.8, 5.0, 100.0, 5.0, 30.0, 600.0)
MARGIN = 0.05


@pytest.fixture(scope="module", autouse=True)
def _engine() -> None:
    pytest.importorskip("mujoco")


def _tight_path(stable: StableSet) -> PushPath:
    """A left turn, a right turn and a left turn, each not far from slipping."""
    turns = np.linspace(0.0, 8.0, 400)
    chosen = []
    for side in (1.0, -1.0, 1.0):
        twists = np.column_stack([np.ones(400), -0.1 * side * turns, side * turns])
        chosen.append(twists[np.flatnonzero(stable.margin(twists) > MARGIN)[-1]])
    twists = np.array(chosen)
    return PushPath(np.zeros(3), twists / cost_rate(twists)[:, None], np.array([0.12, 0.15, 0.12]))


def _scenario(template: Scenario, chain: Chain, path: PushPath) -> Scenario:
    chain = replace(chain, pusher=replace(chain.pusher, limits=FAST))
    settings = replace(template.stability, margin=0.9 * MARGIN)
    return replace(template, chain=chain, stability=settings, obstacles=(), workspace=None, start=path.start)


def _least_margin(contacts: ContactDynamics, twists: FloatArray, rates: FloatArray) -> float:
    moving = np.abs(twists).max(axis=1) > 1e-6
    return float(contacts.margins(twists[moving], rates[moving]).min())


@pytest.mark.parametrize("blended", [False, True])
def test_the_engine_sees_what_the_dynamic_rows_say(
    make_chain: ChainMaker, planned: Callable[[str], tuple[Scenario, PushPath]], blended: bool
) -> None:
    chain = make_chain.boxes(2, size=(0.1, 0.2))
    stable, contacts = stable_set(chain, "ecof"), ContactDynamics(chain)
    path = _tight_path(stable)
    scenario = _scenario(planned("one-box")[0], chain, path)
    kept = []
    for used in (None, contacts):
        trajectory = time_path(path, Bounds(FAST, used))
        if blended:
            blend = blend_path(scenario, path, stable, Bounds(FAST, used))
            assert len(blend.stops) < 2
            trajectory = blend.trajectory
        times = np.linspace(1e-3, trajectory.duration - 1e-3, 3000)
        rates = (trajectory.twists_at(times + 1e-6) - trajectory.twists_at(times - 1e-6)) / 2e-6
        predicted = _least_margin(contacts, trajectory.twists_at(times), rates)
        report = simulate_trajectory(chain, trajectory)
        assert report.kept == (predicted > 0.0), report.summaries
        kept.append(report.kept)
    assert kept == [False, True]
