"""Least change against SLSQP, and its contradictions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import LinearConstraint, minimize

from pushplan.planners.timing.parts import least_change
from pushplan.util.arrays import FloatArray


def _square(y: FloatArray) -> float:
    return float(y @ y)


@pytest.mark.parametrize("seed", range(20))
def test_it_is_the_shortest_that_a_general_optimiser_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    k, m, c = 8, 3, 4
    equations, rows, witness = rng.normal(size=(m, k)), rng.normal(size=(c, k)), rng.normal(size=k)
    values, bounds = equations @ witness, rows @ witness - rng.exponential(0.1, c)
    found = least_change(equations, values, rows, bounds)
    assert found is not None
    np.testing.assert_allclose(equations @ found, values, atol=1e-9)
    assert (rows @ found >= bounds - 1e-9).all()
    other = minimize(
        _square,
        witness,
        constraints=[LinearConstraint(equations, values, values), LinearConstraint(rows, bounds, np.inf)],
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 500},
    )
    assert found @ found == pytest.approx(other.fun, rel=1e-5)


def test_contradictions_are_seen() -> None:
    rows = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
    assert least_change(np.array([[1.0, 0.0, 0.0]]), np.ones(1), rows, np.ones(2)) is None
    assert least_change(np.eye(3), np.ones(3), np.array([[1.0, 0.0, 0.0]]), np.array([2.0])) is None


def test_what_holds_already_is_left_alone() -> None:
    found = least_change(np.array([[2.0, 0.0]]), np.ones(1), np.eye(2), np.array([-1.0, -1.0]))
    assert found is not None
    np.testing.assert_allclose(found, np.array([0.5, 0.0]))
