"""Work that is over soon where only its form is looked at: a rough answer is one, too."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from pushplan.sim.control.controller import DEFAULTS
from pushplan.sim.identify import posterior


def rough_identification(patch: pytest.MonkeyPatch) -> None:
    """Let few members of the ensemble, and few starts, do."""
    for name, value in {"MEMBERS": 8, "ROUNDS": 4, "PASSES": 1, "_BATCH": 20}.items():
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
