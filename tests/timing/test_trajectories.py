"""The scenario chooses how a path is timed and which limits count."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from plans_of import timed

from pushplan.errors import TimingError
from pushplan.mechanics.dynamics import ContactDynamics
from pushplan.planners.planner import plan
from pushplan.planners.timing.arc_limits import Bounds
from pushplan.planners.timing.blending import blend_path
from pushplan.planners.timing.exact_timing import time_path
from pushplan.plans.judge import contact_dynamics
from pushplan.plans.path import PushPath
from pushplan.scenario.model import Scenario
from pushplan.sets.named import stable_set

Planned = Callable[[str], tuple[Scenario, PushPath]]


def _with(scenario: Scenario, **limits: str | float) -> Scenario:
    pusher = scenario.chain.pusher
    changed = replace(pusher, limits=replace(pusher.limits, **limits))  # type: ignore[arg-type]
    return replace(scenario, chain=replace(scenario.chain, pusher=changed))


@pytest.mark.parametrize("word", ["exact", "blended"])
def test_the_word_chooses(planned: Planned, word: str) -> None:
    scenario, path = planned("two-crates")
    scenario, stable = replace(scenario, trajectory=word), stable_set(scenario.chain, "ecof")
    found = timed(scenario, path, "ecof", 50.0)
    bounds = Bounds(scenario.chain.pusher.limits)
    exact = time_path(path, bounds, 50.0)
    wanted = exact if word == "exact" else blend_path(scenario, path, stable, bounds, 50.0).trajectory
    np.testing.assert_array_equal(found.coefficients, wanted.coefficients)
    np.testing.assert_array_equal(found.breaks, wanted.breaks)
    assert found.rate == 50.0
    assert (found.duration < exact.duration) == (word == "blended")


def test_without_a_margin_dynamic_limits_are_refused(planned: Planned) -> None:
    """Planned turns lie on the boundary of the stable set then, where inertia has no room at all."""
    scenario, path = planned("one-box")
    with pytest.raises(TimingError, match=r"raise stability\.margin"):
        timed(_with(scenario, contact="dynamic"), path, "ecof")


@pytest.mark.parametrize(
    ("name", "worst"), [("ecof", False), ("robust", True), ("stable", True), ("of my own", False)]
)
def test_a_set_for_unknown_loads_asks_for_the_worst_case(planned: Planned, name: str, worst: bool) -> None:
    scenario, _ = planned("two-crates")
    assert contact_dynamics(scenario, name).worst_case == worst


def test_dynamic_limits_of_unknown_loads_hold_for_known_ones(planned: Planned) -> None:
    scenario, _ = planned("two-crates")
    settings = replace(scenario.stability, set="robust", margin=0.05)
    scenario = _with(replace(scenario, stability=settings), contact="dynamic", acceleration=3.0, jerk=60.0)
    path = plan(scenario, seed=1, time_limit=60.0, iterations=20_000).path
    assert path is not None
    trajectory = timed(scenario, path, "robust")
    times = np.linspace(1e-3, trajectory.duration - 1e-3, 3000)
    rates = (trajectory.twists_at(times + 1e-6) - trajectory.twists_at(times - 1e-6)) / 2e-6
    moving = np.abs(trajectory.twists_at(times)).max(axis=1) > 1e-6
    margins = ContactDynamics(scenario.chain).margins(trajectory.twists_at(times)[moving], rates[moving])
    assert margins.min() > 0.0
