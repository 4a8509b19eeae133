"""Posterior samples of the unknowns given the measurements: an ensemble of Markov chains.

Half of the proposals are differences of two other members (ter Braak 2006, DE-MC), which need no scale. The others
come from the normal distribution around the most likely point, or from the whole cube. Every proposal is simulated,
because mode switches of contacts make the errors non-smooth.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import solve_triangular

from pushplan.util.arrays import FloatArray

MEMBERS, ROUNDS = 80, 150
"""Number of chains and of rounds at most; along a ridge of loads, chains move slowly."""
ENOUGH = 250.0
"""Number of independent samples that ends the sampling; the tail probabilities are then accurate to about 10 %."""
_LOOK = 30
"""Number of rounds between checks whether the samples suffice."""
_NEAR, _ANYWHERE = 0.35, 0.15
"""Shares of rounds with proposals around the most likely point, and from the whole cube."""
_WIDER = 1.8
"""Width of the proposals around the most likely point over Laplace's approximation; narrow ones trap the chains."""


def sample(
    errors: Callable[[FloatArray], FloatArray],
    near: Near,
    rng: np.random.Generator,
    progress: Callable[[int, int], None] | None = None,
) -> FloatArray:
    """Return the points of all members, (2/3 of the rounds, members, p).

    The errors are normal and the prior is uniform on the unit cube. The first third of the rounds is dropped.
    Sampling ends early once the samples are `worth` `ENOUGH`.

    Args:
        errors: Function from points (q, p) in the cube to errors (q, k) over their standard deviation.
        near: Distribution of half of the initial members and of a part of the proposals.
        rng: Random generator.
        progress: Callback with the number of finished rounds and the largest number of rounds.
    """

    def log_likelihood(at: FloatArray) -> FloatArray:
        return np.asarray(-0.5 * (errors(at) ** 2).sum(axis=1))

    places = near.draw(MEMBERS, rng)
    p = places.shape[1]
    places[::2] = rng.uniform(size=places[::2].shape)
    level = log_likelihood(places)
    seen: list[FloatArray] = []
    for k in range(ROUNDS):
        # Members move by differences of the other half, which stays fixed: this keeps detailed balance.
        for half in (np.arange(0, len(places), 2), np.arange(1, len(places), 2)):
            others = np.setdiff1d(np.arange(len(places)), half)
            kind, correction = rng.random(), np.zeros(len(half))
            if kind < _NEAR:
                proposed = near.draw(len(half), rng)
                correction = near.log_density(places[half]) - near.log_density(proposed)
            elif kind < _NEAR + _ANYWHERE:
                proposed = rng.uniform(size=(len(half), p))
            else:
                proposed = places[half] + _difference(places[others], len(half), p, rng)
            # The prior is zero outside the cube: no simulation is needed there.
            inside = ((proposed > 0.0) & (proposed < 1.0)).all(axis=1)
            found = np.full(len(half), -np.inf)
            if inside.any():
                found[inside] = log_likelihood(proposed[inside])
            taken = np.log(rng.uniform(size=len(half))) < found - level[half] + correction
            places[half[taken]], level[half[taken]] = proposed[taken], found[taken]
        seen.append(places.copy())
        if progress is not None:
            progress(k + 1, ROUNDS)
        if (k + 1) % _LOOK == 0 and worth(_without_burn_in(seen)) >= ENOUGH:
            break
    return _without_burn_in(seen)


def _without_burn_in(rounds: list[FloatArray]) -> FloatArray:
    """Return the rounds without the first third (burn-in)."""
    return np.array(rounds[len(rounds) // 3 :])


def worth(chains: FloatArray) -> float:
    """Return the effective number of independent samples in the rounds (k, m, p) of m members.

    It follows from the scatter of the members' means over the rounds.
    """
    scatter = chains.mean(axis=0).var(axis=0, ddof=1)
    return float(chains.shape[1] * (chains.var(axis=(0, 1)) / np.maximum(scatter, 1e-300)).min())


def _difference(others: FloatArray, count: int, p: int, rng: np.random.Generator) -> FloatArray:
    first = rng.integers(len(others), size=count)
    pairs = np.column_stack([first, (first + rng.integers(1, len(others), size=count)) % len(others)])
    # 2.38 / sqrt(2 p) is best for a normal distribution; an occasional 1 jumps between modes (ter Braak 2006).
    scale = 1.0 if rng.random() < 0.1 else 2.38 / np.sqrt(2.0 * p)
    jitter = 1e-4 * rng.standard_normal((count, p))
    return np.asarray(scale * (others[pairs[:, 0]] - others[pairs[:, 1]]) + jitter)


class Near:
    """Normal distribution around the most likely point, truncated to the unit cube."""

    def __init__(self, best: FloatArray, information: FloatArray) -> None:
        self._best = np.clip(best, 0.01, 0.99)
        even = 12.0 * np.eye(len(best))  # information of the uniform prior on [0, 1]: 1 / variance
        self._root = np.linalg.cholesky((information + even) / _WIDER**2)

    def draw(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Return random points (count, p)."""
        found = np.empty((0, len(self._best)))
        while len(found) < count:
            steps = solve_triangular(self._root.T, rng.standard_normal((len(self._best), 4 * count)), lower=False)
            places = self._best + steps.T
            found = np.vstack([found, places[((places > 0.0) & (places < 1.0)).all(axis=1)]])
        return found[:count]

    def log_density(self, places: FloatArray) -> FloatArray:
        """Return the logarithm of the density (q,), up to a constant."""
        return np.asarray(-0.5 * (((places - self._best) @ self._root) ** 2).sum(axis=1))
