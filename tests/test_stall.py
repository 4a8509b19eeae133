"""When a search without a better path ends: the sooner, the nearer its path is to what no path can beat."""

import numpy as np
import pytest
from plain import load_plain

from pushplan.planners.problem import build_problem
from pushplan.planners.search.session import DOUBT, DOUBTFUL, MOST_DOUBT, Budget, Session

STALL = 1_000
FORWARD = np.array([[1.0, 0.0, 0.0, 100.0]])
"""A path of 100 m: far above what is needed."""


@pytest.fixture
def session() -> Session:
    scenario = load_plain("one-box")
    session = Session(
        build_problem(scenario, scenario.stable_set()), scenario.start, Budget(60.0, stall=STALL), 1
    )
    session.take(FORWARD)
    return session


@pytest.mark.parametrize("excess", [1e-6, DOUBTFUL, 1.0, MOST_DOUBT])
def test_a_path_far_above_the_lower_bound_is_not_soon_taken_for_the_best(
    session: Session, excess: float
) -> None:
    session.raise_lower_bound(session.best.horizon / (1.0 + excess))
    last = STALL * (1.0 + DOUBT * max(0.0, excess - DOUBTFUL))
    session.iterations = int(last) - 1
    assert not session.settled()
    session.iterations = int(last) + 1
    assert session.settled()


def test_a_bound_that_says_nothing_does_not_keep_a_search_going_for_ever(session: Session) -> None:
    assert session.best.horizon > 10.0 * session.lower_bound
    session.iterations = int(STALL * (1.0 + DOUBT * (MOST_DOUBT - DOUBTFUL)))
    assert session.settled()
