"""Samples of what the unknowns may be, given what was measured: an ensemble of Markov chains.

Half of the proposals are differences of two other members (ter Braak 2006, DE-MC), which know no scale; others come
from the normal distribution around the most likely place, or from anywhere. The simulator is asked about every place:
errors are smooth in the unknowns, but where contacts change what they do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

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
    log_likelihood: Callable[[FloatArray], FloatArray],
    proposals: Near,
    rng: np.random.Generator,
    rounds: int = ROUNDS,
    members: int = MEMBERS,
    enough: float = np.inf,
    progress: Callable[[int, int], None] | None = None,
) -> FloatArray:
    """Return what the members were at (2/3 of the rounds, members, p) from a likelihood over the unit cube.

    All of the cube was alike likely before. The first third of the rounds is forgotten.

    Args:
        log_likelihood: Of places (q, p) in the cube; (q,).
        proposals: Where half of the members begin, and a part of the proposals.
        rng: Where the random numbers come from.
        rounds: How often each member moves at most.
        members: Of the ensemble.
        enough: Independent samples; no more rounds are made when they are `worth` so many.
        progress: Called with the rounds that are done, and how many there are at most.
    """
    places = proposals.draw(members, rng)
    p = places.shape[1]
    places[::2] = rng.uniform(size=places[::2].shape)
    level = log_likelihood(places)
    seen: list[FloatArray] = []
    for k in range(rounds):
        # Members move by differences of the other half, which rests meanwhile: that keeps the balance of each move.
        for half in (np.arange(0, len(places), 2), np.arange(1, len(places), 2)):
            others = np.setdiff1d(np.arange(len(places)), half)
            kind, correction = rng.random(), np.zeros(len(half))
            if kind < _NEAR:
                proposed = proposals.draw(len(half), rng)
                correction = proposals.log_density(places[half]) - proposals.log_density(proposed)
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

    def log_likelihood(at: FloatArray) -> FloatArray:
        return np.asarray(-0.5 * (errors(at) ** 2).sum(axis=1))

    chains = sample(log_likelihood, Near(best, information), rng, ROUNDS, MEMBERS, ENOUGH, progress)
    return Samples(chains.reshape(-1, len(best)), worth(chains))
