"""Posterior samples of the unknowns given the measurements: an ensemble of Markov chains.

Half of the proposals are differences of two other members (ter Braak 2006, DE-MC), which need no scale. The others
come from the normal distribution around the most likely point, or from the whole cube. Every proposal is simulated,
because mode switches of contacts make the errors non-smooth.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import logsumexp

from pushplan.util.arrays import FloatArray, IntArray

MEMBERS, ROUNDS = 80, 150
"""Number of chains and of rounds at most; along a ridge of loads, chains move slowly."""
ENOUGH = 250.0
"""Number of independent samples that ends the sampling; the tail probabilities are then accurate to about 10 %."""
_LOOK = 30
"""Number of rounds between checks whether the samples suffice."""
_NEAR, _ANYWHERE = 0.35, 0.15
"""Shares of rounds with proposals around the most likely point, and from the whole cube."""
_LOST = 10.0
"""Difference of log-likelihoods, beside one for each unknown, from which on a member counts as lost."""
_WIDER = 1.8
"""Width of the proposals around the most likely point over Laplace's approximation; narrow ones trap the chains."""


def sample(
    log_likelihood: Callable[[FloatArray], FloatArray],
    near: Near,
    rng: np.random.Generator,
    progress: Callable[[int, int], None] | None = None,
) -> FloatArray:
    """Return the points of all members, (2/3 of the rounds, members, p).

    The prior is uniform on the unit cube. The first third of the rounds is dropped. Sampling ends early once the
    samples are `worth` `ENOUGH`.

    Args:
        log_likelihood: Function from points (q, p) in the cube to the logarithm of their likelihood (q,).
        near: Distribution of half of the initial members and of a part of the proposals.
        rng: Random generator.
        progress: Callback with the number of finished rounds and the largest number of rounds.
    """
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
        if k == _LOOK // 3 - 1:  # among the rounds that are dropped: members that found no likely point start again
            lost = np.flatnonzero(level < level.max() - _LOST - p)
            new = rng.choice(np.setdiff1d(np.arange(len(places)), lost), len(lost))
            places[lost], level[lost] = places[new], level[new]
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


NOISES = np.geomspace(0.1, 2.0, 18)
"""Standard deviations of measurements to try, over those that the best prediction leaves."""
SPREADS = np.concatenate([[0.0], np.geomspace(5e-3, 0.25, 12)])
"""Relative spreads of the unknowns between pushes to try."""
USUAL = 0.06
"""Mean of the exponential prior of that spread: few pushes do not determine it."""
TAILS = 4.0
"""Degrees of freedom of Student's distribution: now and then a real push does something else."""


@dataclass(frozen=True, eq=False)
class Likelihood:
    """Likelihood of errors that come from noise and from unknowns that differ a little between pushes.

    Real friction and pressure differ between pushes, and no model is exact. The errors of push g therefore follow
    Student's distribution with the covariance a^2 I + s^2 J J', where J are their derivatives by the unknowns of this
    push alone. Noise a and spread s are unknown and integrated out: intervals are as wide as pushes disagree.

    Attributes:
        modes: Left singular vectors of all J, (k, q).
        gains: Singular values, (q,).
        directions: Right singular vectors over the unit of each unknown, (q, p).
        of_error, of_mode: Index of the push of each error and of each mode, one column for each push: (k, g), (q, g).
        free: Degrees of freedom of the errors of each push, (g,).
    """

    modes: FloatArray
    gains: FloatArray
    directions: FloatArray
    of_error: FloatArray
    of_mode: FloatArray
    free: FloatArray

    @classmethod
    def from_slopes(cls, slopes: FloatArray, groups: IntArray, units: FloatArray, free: float) -> Likelihood:
        """Return the likelihood.

        Args:
            slopes: Derivatives of the errors by the unknowns, (k, p).
            groups: Index of the push of each error, (k,).
            units: Change of each unknown that counts as a relative change of 1, (p,).
            free: Degrees of freedom per error.
        """
        parts = []
        for g in np.unique(groups):
            rows = groups == g
            u, d, v = np.linalg.svd(slopes[rows] * units, full_matrices=False)
            modes = np.zeros((len(slopes), len(d)))
            modes[rows] = u
            parts.append((modes, d, v / units, np.full(len(d), g)))
        modes, gains, directions, of_mode = zip(*parts, strict=True)
        own = [np.equal.outer(each, np.unique(groups)).astype(float) for each in (groups, np.concatenate(of_mode))]
        of_error, mode = own
        return cls(
            np.hstack(modes),
            np.concatenate(gains),
            np.vstack(directions),
            of_error,
            mode,
            free * of_error.sum(axis=0),
        )

    def __call__(self, errors: FloatArray) -> FloatArray:
        """Return the logarithm of the likelihood (q,) of errors (q, k)."""
        return np.asarray(logsumexp(self._table(errors), axis=(1, 2)))

    def information(self, errors: FloatArray) -> FloatArray:
        """Return the information matrix (p, p) at the likely noise for errors (k,), and at a usual spread or more."""
        best = np.unravel_index(int(np.argmax(self._table(errors[None])[0])), (len(NOISES), len(SPREADS)))
        noise, spread = NOISES[best[0]], max(USUAL, SPREADS[best[1]])
        weighted = self.directions * (self.gains / np.hypot(noise, spread * self.gains))[:, None]
        return np.asarray(weighted.T @ weighted)

    def _table(self, errors: FloatArray) -> FloatArray:
        """Return the logarithm of likelihood times prior (q, noises, spreads)."""
        within = (errors @ self.modes) ** 2
        beside = np.maximum(errors**2 @ self.of_error - within @ self.of_mode, 0.0)
        ratios = 1.0 + (SPREADS[:, None] * self.gains / NOISES[:, None, None]) ** 2  # (noises, spreads, modes)
        squares = np.einsum("qm,nsm,mg->qnsg", within, 1.0 / ratios, self.of_mode, optimize=True)
        squares = (squares + beside[:, None, None]) / NOISES[:, None, None] ** 2
        found = ((TAILS + self.free) * np.log1p(squares / TAILS)).sum(axis=3)
        found += np.log(ratios).sum(axis=2) + 2.0 * self.free.sum() * np.log(NOISES)[:, None]
        prior = np.log(np.gradient(SPREADS)) - SPREADS / USUAL
        return np.asarray(prior - 0.5 * found)


class Near:
    """Student's distribution around the most likely point, truncated to the unit cube.

    Its tails are as heavy as those of the likelihood: with a normal one, chains that start far away would stay there.
    """

    def __init__(self, best: FloatArray, information: FloatArray) -> None:
        self._best = np.clip(best, 0.01, 0.99)
        even = 12.0 * np.eye(len(best))  # information of the uniform prior on [0, 1]: 1 / variance
        self._root = np.linalg.cholesky((information + even) / _WIDER**2)

    def draw(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Return random points (count, p)."""
        found = np.empty((0, len(self._best)))
        while len(found) < count:
            steps = solve_triangular(self._root.T, rng.standard_normal((len(self._best), 4 * count)), lower=False)
            places = self._best + steps.T / np.sqrt(rng.chisquare(TAILS, (4 * count, 1)) / TAILS)
            found = np.vstack([found, places[((places > 0.0) & (places < 1.0)).all(axis=1)]])
        return found[:count]

    def log_density(self, places: FloatArray) -> FloatArray:
        """Return the logarithm of the density at points (q, p), up to a constant."""
        squares = (((places - self._best) @ self._root) ** 2).sum(axis=1)
        return np.asarray(-0.5 * (TAILS + len(self._best)) * np.log1p(squares / TAILS))
