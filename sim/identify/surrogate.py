"""Samples of what the unknowns may be, from few simulations: a polynomial stands in for the errors.

Errors are smooth in the unknowns, but where contacts change what they do. A polynomial fitted to them is sampled at
length for next to nothing; some of its samples are simulated and taught to it, and in the end weighted by how likely
they are over how likely it thought they were (importance sampling), which makes up for what it does not see.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations_with_replacement

import numpy as np

from pushplan.basics.arrays import FloatArray
from pushplan.sim.identify.posterior import Near, sample

PASSES = 4
"""How often the polynomial is taught before its samples may count."""
MOST_PASSES = 10
ENOUGH = 150.0
"""Samples that the weighted ones have to be worth."""
_BATCH = 90
"""Simulations in a pass, and in the last one four times as many."""
_COOL = 0.5
"""Samples to teach it with are drawn as if errors were larger by the root of 2: it has to know the surroundings."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Equally likely places in the unit cube.

    Attributes:
        places: (k, p).
        worth: How many independent samples they are worth.
    """

    places: FloatArray
    worth: float


def sample_errors(
    errors: Callable[[FloatArray], FloatArray],
    best: FloatArray,
    information: FloatArray,
    rng: np.random.Generator,
    progress: Callable[[int, int], None] | None = None,
) -> Samples:
    """Return samples of places in the unit cube, all alike likely before, given errors that are normal.

    Args:
        errors: Of places (q, p); (q, k) over their standard deviation.
        best: (p,) the most likely place.
        information: (p, p) second derivatives of half of the squared errors there, about.
        rng: Where the random numbers come from.
        progress: Called with the passes that are done, and how many there are at least.
    """
    near = Near(best, information)
    places = np.vstack([best, near.draw(2 * _BATCH, rng), rng.uniform(size=(_BATCH, len(best)))])
    rows = errors(places)
    for k in range(MOST_PASSES):
        model = _Polynomial.fitted(places, rows)
        if k < PASSES:
            drawn = _drawn(model, best, information, _BATCH, _COOL, rng)
        else:
            drawn = _drawn(model, best, information, 4 * _BATCH, 1.0, rng)
        found = errors(drawn)
        if progress is not None:
            progress(k + 1, max(k + 1, PASSES + 1))
        if k >= PASSES:
            weights = _weights(model, drawn, found)
            worth = float(1.0 / (weights**2).sum())
            if worth >= ENOUGH or k == MOST_PASSES - 1:
                break
        places, rows = np.vstack([places, drawn]), np.vstack([rows, found])
    return Samples(drawn[rng.choice(len(drawn), 20 * len(drawn), p=weights)], worth)


def _drawn(
    model: _Polynomial,
    best: FloatArray,
    information: FloatArray,
    count: int,
    cool: float,
    rng: np.random.Generator,
) -> FloatArray:
    found = sample(lambda at: cool * model.log_likelihood(at), best, cool * information, rng, members=120)
    return np.asarray(found[rng.choice(len(found), count, replace=False)])


def _weights(model: _Polynomial, places: FloatArray, rows: FloatArray) -> FloatArray:
    logs = -0.5 * (rows**2).sum(axis=1) - model.log_likelihood(places)
    weights = np.exp(logs - logs.max())
    weights = np.minimum(weights, np.sqrt(len(weights)) * weights.mean())  # truncated: Ionides 2008
    return np.asarray(weights / weights.sum())


@dataclass(frozen=True, eq=False)
class _Polynomial:
    """Errors as polynomials of places: e = f(place) C, so that the sum of squares is f (C C') f'."""

    degree: int
    squares: FloatArray

    @classmethod
    def fitted(cls, places: FloatArray, rows: FloatArray) -> _Polynomial:
        """Fit errors (m, k) at places (m, p); those that are likely count most."""
        degree = 3 if len(_terms(places[:1], 3)[0]) * 2 < len(places) else 2
        cost = 0.5 * (rows**2).sum(axis=1)
        weight = 1.0 / np.sqrt(1.0 + (cost - cost.min()) / places.shape[1])
        terms = _terms(places, degree) * weight[:, None]
        ridge = 1e-6 * np.trace(terms.T @ terms) / terms.shape[1] * np.eye(terms.shape[1])
        factors = np.linalg.solve(terms.T @ terms + ridge, terms.T @ (rows * weight[:, None]))
        return cls(degree, factors @ factors.T)

    def log_likelihood(self, places: FloatArray) -> FloatArray:
        terms = _terms(places, self.degree)
        return np.asarray(-0.5 * ((terms @ self.squares) * terms).sum(axis=1))


def _terms(places: FloatArray, degree: int) -> FloatArray:
    """Return all products of up to `degree` coordinates (m, f), from -1 to 1 in the cube."""
    factors = np.column_stack([np.ones(len(places)), 2.0 * places - 1.0])
    terms = np.ones((len(places), 1))
    for which in _products(factors.shape[1], degree).T:
        terms = terms * factors[:, which]
    return np.asarray(terms)


@lru_cache
def _products(factors: int, degree: int) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]]:
    return np.array(list(combinations_with_replacement(range(factors), degree)))
