"""Shortcuts for tests that check only the form of an answer, so that a rough one is enough."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import pytest

from pushplan.plans.settings import PlanSettings
from pushplan.scenario.model import Scenario
from pushplan.sim.control.controller import DEFAULTS
from pushplan.sim.identify import posterior


def rough_identification(patch: pytest.MonkeyPatch) -> None:
    """Use few members of the ensemble and few starts."""
    for name, value in {"MEMBERS": 8, "ROUNDS": 4}.items():
        patch.setattr(posterior, name, value)
    patch.setattr("pushplan.sim.identify.identify.LOOKED_AT", 16)
    patch.setattr("pushplan.sim.identify.identify.STARTS", 1)


@contextmanager
def slow_controllers() -> Iterator[None]:
    """Halve the default step rate of controllers."""
    rate = DEFAULTS.rate
    object.__setattr__(DEFAULTS, "rate", 0.5 * rate)
    yield
    object.__setattr__(DEFAULTS, "rate", rate)


@contextmanager
def first_plans() -> Iterator[None]:
    """End searches with their first plan, and wait for it on a busy machine."""
    completed = PlanSettings.completed

    def first(settings: PlanSettings, scenario: Scenario) -> PlanSettings:
        limit = 60.0 if settings.time_limit is None else 20.0 * settings.time_limit  # independent of the machine
        return completed(replace(settings, first=True, time_limit=limit), scenario)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(PlanSettings, "completed", first)
        yield
