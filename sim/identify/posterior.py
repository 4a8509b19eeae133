"""Samples of what the unknowns may be, given what was measured: an ensemble of Markov chains.

Half of the proposals are differences of two other members (ter Braak 2006, DE-MC), which know no scale; others come
from the normal distribution around the most likely place, or from anywhere. The simulator is asked about every place:
errors are smooth in the unknowns, but where contacts change what they do.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import solve_triangular

from pushplan.util.arrays import FloatArray

MEMBERS, ROUNDS = 80, 150
"""Chains, and how often each moves at most: along a ridge of loads they walk slowly."""
ENOUGH = 250.0
"""Independent samples, with which the ends of intervals are sure to about a tenth of the chance beyond them."""
_LOOK = 30
"""Rounds between looks at whether the samples are enough."""
_NEAR, _ANYWHERE = 0.35, 0.15
"""Shares of rounds in which proposals are drawn around the most likely place, and anywhere."""
_WIDER = 1.8
"""Proposals around the most likely place over what Laplace's approximation says: too narrow ones never leave."""


def sample(
    errors: Callable[[FloatArray], FloatArray],
    near: Near,
    rng: np.random.Generator,
    progress: Callable[[int, int], None] | None = None,
) -> FloatArray:
    """Return what the members were at (2/3 of the rounds, members, p), given errors that are normal.

    All of the unit cube was alike likely before. The first third of the rounds is forgotten; no more are made when
    they are `worth` enough.

    Args:
        errors: Of places (q, p) in the cube; (q, k) over their standard deviation.
        near: Where half of the members begin, and a part of the proposals.
        rng: Where the random numbers come from.
        progress: Called with the rounds that are done, and how many there are at most.
    """

    def log_likelihood(at: FloatArray) -> FloatArray:
        return np.asarray(-0.5 * (errors(at) ** 2).sum(axis=1))

    places = near.draw(MEMBERS, rng)
    p = places.shape[1]
    places[::2] = rng.uniform(size=places[::2].shape)
    level = log_likelihood(places)
    seen: list[FloatArray] = []
    for k in range(ROUNDS):
        # Members move by differences of the other half, which rests meanwhile: that keeps the balance of each move.
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
            # Outside nothing was likely before: no simulation is spent there.
            inside = ((proposed > 0.0) & (proposed < 1.0)).all(axis=1)
            found = np.full(len(half), -np.inf)
            if inside.any():
                found[inside] = log_likelihood(proposed[inside])
            taken = np.log(rng.uniform(size=len(half))) < found - level[half] + correction
            places[half[taken]], level[half[taken]] = proposed[taken], found[taken]
        seen.append(places.copy())
        if progress is not None:
            progress(k + 1, ROUNDS)
        if (k + 1) % _LOOK == 0 and worth(_later(seen)) >= ENOUGH:
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
