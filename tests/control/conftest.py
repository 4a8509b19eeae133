"""What tests of closed loops share."""

from collections.abc import Iterator

import pytest

from pushplan.sim.control import replanner
from pushplan.sim.control.controller import DEFAULTS


@pytest.fixture(scope="session", autouse=True)
def _patient() -> Iterator[None]:
    """Let iterations alone end the searches of plans on the way: on a busy machine the time limit would, by chance.

    The one object of settings is the default of every closed loop, whichever way it is begun. So many iterations take
    about as long as the limit leaves.
    """
    limit = DEFAULTS.time_limit
    object.__setattr__(DEFAULTS, "time_limit", 60.0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(replanner, "ITERATIONS", 1_500)
        yield
    object.__setattr__(DEFAULTS, "time_limit", limit)
