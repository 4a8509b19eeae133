"""Fixtures for tests of closed loops."""

from collections.abc import Iterator

import pytest

from pushplan.sim.control import replanner
from pushplan.sim.control.controller import DEFAULTS


@pytest.fixture(scope="session", autouse=True)
def _patient() -> Iterator[None]:
    """Let only iterations end the searches of replans, because a time limit would depend on the load of the machine.
    The one settings object is the default of every closed loop. Its iterations take about as long as the time
    limit.
    """
    limit = DEFAULTS.time_limit
    object.__setattr__(DEFAULTS, "time_limit", 60.0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(replanner, "ITERATIONS", 1_500)
        yield
    object.__setattr__(DEFAULTS, "time_limit", limit)
