"""Work that is over soon where only its form is looked at: a rough answer is one, too."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import pytest

from pushplan.plans.settings import PlanSettings
from pushplan.scenario.model import Scenario
from pushplan.sim.control.controller import DEFAULTS
from pushplan.sim.identify import posterior


def rough_identification(patch: pytest.MonkeyPatch) -> None:
    """Let few members of the ensemble, and few starts, do."""
    for name, value in {"MEMBERS": 8, "ROUNDS": 4}.items():
        patch.setattr(posterior, name, value)
    patch.setattr("pushplan.sim.identify.identify.LOOKED_AT", 16)
    patch.setattr("pushplan.sim.identify.identify.STARTS", 1)


@contextmanager
def slow_controllers() -> Iterator[None]:
    """Let controllers that nobody says otherwise of step half as often."""
    rate = DEFAULTS.rate
    object.__setattr__(DEFAULTS, "rate", 0.5 * rate)
    yield
    object.__setattr__(DEFAULTS, "rate", rate)


@contextmanager
def first_plans() -> Iterator[None]:
    """Let searches end with their first plan, and wait for it on a busy machine."""
    completed = PlanSettings.completed

    def first(settings: PlanSettings, scenario: Scenario) -> PlanSettings:
        limit = 60.0 if settings.time_limit is None else 20.0 * settings.time_limit  # whatever the machine
        return completed(replace(settings, first=True, time_limit=limit), scenario)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(PlanSettings, "completed", first)
        yield
