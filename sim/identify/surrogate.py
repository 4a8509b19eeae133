"""Samples of what the unknowns may be, from few simulations: a polynomial stands in for the errors.

Errors are smooth in the unknowns, but where contacts change what they do. A polynomial fitted to them is sampled at
length for next to nothing; some of its samples are simulated and taught to it. In the end it only proposes: an
ensemble of chains asks the simulator about every place it moves to. Weights on the polynomial's own samples
(importance sampling) would not do: where it thinks nothing likely there are none to weigh: intervals end too soon.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations_with_replacement

import numpy as np

from pushplan.sim.identify.posterior import Near, sample, worth
from pushplan.util.arrays import FloatArray

PASSES = 4
"""How often the polynomial is taught before it proposes."""
MEMBERS, ROUNDS = 50, 240
"""Chains that the simulator judges, and how often each moves at most: along a ridge of loads they walk slowly."""
ENOUGH = 250.0
"""Independent samples, with which the ends of intervals are sure to about a tenth of the chance beyond them."""
_BATCH = 90
"""Simulations in a pass."""
_COOL = 0.5
"""The polynomial is sampled as if errors were larger by the root of 2: it has to know the surroundings."""


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
        progress: Called with the rounds that are done, and how many there are.
    """
    near = Near(best, information)
    # Some from all of the cube: a polynomial that was taught around the best place only is wild elsewhere.
    places = np.vstack([best, near.draw(2 * _BATCH, rng), rng.uniform(size=(_BATCH, len(best)))])
    rows = errors(places)
    for _ in range(PASSES):
        drawn = _Taught.sampled(_Polynomial.fitted(places, rows), best, information, rng).draw(_BATCH, rng)
        places, rows = np.vstack([places, drawn]), np.vstack([rows, errors(drawn)])
    taught = _Taught.sampled(_Polynomial.fitted(places, rows), best, information, rng)

    def log_likelihood(at: FloatArray) -> FloatArray:
        return np.asarray(-0.5 * (errors(at) ** 2).sum(axis=1))

    chains = sample(log_likelihood, taught, rng, ROUNDS, MEMBERS, ENOUGH, progress)
    return Samples(chains.reshape(-1, len(best)), worth(chains))


@dataclass(frozen=True, eq=False)
class _Taught:
    """Proposals that follow a polynomial: its samples, of which some are drawn."""

    model: _Polynomial
    samples: FloatArray

    @classmethod
    def sampled(
        cls, model: _Polynomial, best: FloatArray, information: FloatArray, rng: np.random.Generator
    ) -> _Taught:
        near = Near(best, _COOL * information)
        chains = sample(lambda at: _COOL * model.log_likelihood(at), near, rng, members=120)
        return cls(model, chains.reshape(-1, len(best)))

    def draw(self, count: int, rng: np.random.Generator) -> FloatArray:
        return np.asarray(self.samples[rng.choice(len(self.samples), count, replace=False)])

    def log_density(self, places: FloatArray) -> FloatArray:
        return _COOL * self.model.log_likelihood(places)


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
        # Places that are out of the question must not bend the polynomial where the likely ones are.
        weight = 1.0 / np.sqrt(1.0 + (cost - cost.min()) / places.shape[1])
        terms = _terms(places, degree) * weight[:, None]
        # There may be no more places than terms.
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
