"""The scenario chooses how a path is timed and which limits count."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from plans_of import timed

from pushplan.errors import TimingError
from pushplan.planners.timing.arc_limits import Bounds
from pushplan.planners.timing.blending import blend_path
from pushplan.planners.timing.exact_timing import time_path
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
