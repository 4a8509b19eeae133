"""Samples of what the unknowns may be, given what was measured: an ensemble of Markov chains.

Half of the proposals are differences of two other members (ter Braak 2006, DE-MC), which know no scale; half come
from a distribution that is about the one that is looked for, as the normal one around the most likely place.

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
from typing import Protocol

import numpy as np
from scipy.linalg import solve_triangular

from pushplan.util.arrays import FloatArray

ROUNDS = 300
"""Of all members once, at most; the first third is forgotten."""
_LOOK = 60
"""Rounds between looks at whether the samples are enough."""
_WIDER = 1.2
"""Proposals around the most likely place over what Laplace's approximation says: too narrow ones never leave."""


class Proposals(Protocol):
    """A distribution in the unit cube that is about the one that is looked for."""

    def draw(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Return places (count, p)."""

    def log_density(self, places: FloatArray) -> FloatArray:
        """Return the logarithm of the density (q,), but for a constant."""


def sample(
    log_likelihood: Callable[[FloatArray], FloatArray],
    proposals: Proposals,
    rng: np.random.Generator,
    rounds: int = ROUNDS,
    members: int = 40,
    enough: float = np.inf,
    progress: Callable[[int, int], None] | None = None,
) -> FloatArray:
    """Return what the members were at (2/3 of the rounds, members, p) from a likelihood over the unit cube.

    All of the cube was alike likely before. The first third of the rounds is forgotten.

    Args:
        log_likelihood: Of places (q, p) in the cube; (q,).
        proposals: Where the members begin, and half of the proposals.
        rng: Where the random numbers come from.
        rounds: How often each member moves at most.
        members: Of the ensemble.
        enough: Independent samples; no more rounds are made when they are `worth` so many.
        progress: Called with the rounds that are done, and how many there are at most.
    """
    places = proposals.draw(members, rng)
    p = places.shape[1]
    level = log_likelihood(places)
    seen: list[FloatArray] = []
    for k in range(rounds):
        # Members move by differences of the other half, which rests meanwhile: that keeps the balance of each move.
        for half in (np.arange(0, len(places), 2), np.arange(1, len(places), 2)):
            others = np.setdiff1d(np.arange(len(places)), half)
            if rng.random() < 0.5:
                proposed = proposals.draw(len(half), rng)
                correction = proposals.log_density(places[half]) - proposals.log_density(proposed)
            else:
                proposed = places[half] + _difference(places[others], len(half), p, rng)
                correction = np.zeros(len(half))
            # Outside nothing was likely before: no simulation is spent there.
            inside = ((proposed > 0.0) & (proposed < 1.0)).all(axis=1)
            found = np.full(len(half), -np.inf)
            if inside.any():
                found[inside] = log_likelihood(proposed[inside])
            taken = np.log(rng.uniform(size=len(half))) < found - level[half] + correction
            places[half[taken]], level[half[taken]] = proposed[taken], found[taken]
        seen.append(places.copy())
        if progress is not None:
            progress(k + 1, rounds)
        if (k + 1) % _LOOK == 0 and worth(_later(seen)) >= enough:
            break
    return _later(seen)


def _later(rounds: list[FloatArray]) -> FloatArray:
    """Return the rounds but for the first third, in which the members may still be on their way."""
    return np.array(rounds[len(rounds) // 3 :])


def worth(chains: FloatArray) -> float:
    """Return how many independent samples the rounds (k, m, p) of m members are worth.

    The mean over the rounds of a member scatters the less, the more independent samples it is made of.
    """
    scatter = chains.mean(axis=0).var(axis=0, ddof=1)
    return float(chains.shape[1] * (chains.var(axis=(0, 1)) / np.maximum(scatter, 1e-300)).min())


def _difference(others: FloatArray, count: int, p: int, rng: np.random.Generator) -> FloatArray:
    first = rng.integers(len(others), size=count)
    pairs = np.column_stack([first, (first + rng.integers(1, len(others), size=count)) % len(others)])
    # 2.38 / sqrt(2 p) is best for a normal distribution; 1 now and then jumps between its modes (ter Braak 2006).
    scale = 1.0 if rng.random() < 0.1 else 2.38 / np.sqrt(2.0 * p)
    jitter = 1e-4 * rng.standard_normal((count, p))
    return np.asarray(scale * (others[pairs[:, 0]] - others[pairs[:, 1]]) + jitter)


class Near:
    """The normal distribution around the most likely place, cut off at the cube's sides."""

    def __init__(self, best: FloatArray, information: FloatArray) -> None:
        self._best = np.clip(best, 0.01, 0.99)
        even = 12.0 * np.eye(len(best))  # what is known of a number that is anywhere in [0, 1]
        self._root = np.linalg.cholesky((information + even) / _WIDER**2)

    def draw(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Return places (count, p)."""
        found = np.empty((0, len(self._best)))
        while len(found) < count:
            steps = solve_triangular(self._root.T, rng.standard_normal((len(self._best), 4 * count)), lower=False)
            places = self._best + steps.T
            found = np.vstack([found, places[((places > 0.0) & (places < 1.0)).all(axis=1)]])
        return found[:count]

    def log_density(self, places: FloatArray) -> FloatArray:
        """Return the logarithm of the density (q,), but for a constant."""
        return np.asarray(-0.5 * (((places - self._best) @ self._root) ** 2).sum(axis=1))


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
