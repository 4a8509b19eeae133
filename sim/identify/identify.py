"""Identify intervals of friction and loads from measured pushes."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import qmc

import pushplan.core.slip as slip
from pushplan.errors import PushplanError
from pushplan.sim.identify.measured_push import Comparison, Identification, MeasuredPush
from pushplan.sim.identify.posterior import Likelihood, Near, sample, worth
from pushplan.sim.identify.unknowns import Unknowns
from pushplan.slip.packing import half_extent
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray

STEP = 5e-3
"""Step of finite differences in the unit cube; with smaller steps, mode switches of contacts disturb the slope."""
LOOKED_AT, STARTS = 256, 4
"""Number of points that are evaluated first, and of the best ones from which a least-squares search starts."""

EXPECTED = np.array([1e-3, 1e-3, 5e-3])
"""Initial standard errors of measured poses: m, m, rad."""
LEAST = np.array([5e-5, 5e-5, 2e-4])
"""Smallest standard errors of poses, also of simulated ones: errors of step size and point loads."""
EXPECTED_FORCE, LEAST_FORCE = 0.1, 0.01
"""Initial and smallest standard errors of wrenches: shares of the mean force (torque: times the half extent)."""


def identify_pushes(
    world: World,
    pushes: Sequence[MeasuredPush],
    *,
    seed: int = 1,
    jobs: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Identification:
    """Identify contact friction, loads and floor friction.

    Quasi-static motion does not change when all floor frictions scale by one factor. Poses therefore determine only
    their ratios; measured wrenches of the plate determine the factor.

    Args:
        world: Chain with shapes, contacts and masses, and obstacles. Its contact frictions and loads are ignored; its
            floor frictions are the centre of the search.
        pushes: Measured pushes of this chain.
        seed: Seed of the random numbers.
        jobs: Number of threads; None for one per processor.
        progress: Callback with the number of finished rounds and of all rounds.

    Raises:
        PushplanError: If there is no push, a push has another number of objects, or nothing moves in any.
    """
    _check(world, pushes)
    problem = _Problem(world, pushes, jobs or os.cpu_count() or 1)
    # Threads, not processes: `march` runs without the interpreter's lock.
    with problem.pool:
        place = problem.best()
        likelihood, information, correlation = problem.linearised(place)
        # The initial poses of the pushes are integrated out, so the samples cover only the chain's unknowns.
        best = place[: problem.count]
        chains = sample(likelihood, Near(best, information), np.random.default_rng(seed), progress)
    scales, values = problem.scales[0], problem.unknowns.values(chains.reshape(-1, len(best)))
    return Identification(
        problem.unknowns,
        problem.unknowns.with_model_error(values, np.random.default_rng([seed, 1])),
        (float(scales[0]), float(scales[2])),
        correlation,
        worth(chains),
    )


def _check(world: World, pushes: Sequence[MeasuredPush]) -> None:
    if not pushes:
        raise PushplanError("no push is given; identification needs at least one")
    n = len(world.chain.objects)
    for push in pushes:
        if push.object_poses.shape[1] != n:
            raise PushplanError(f"{push.name}: {push.object_poses.shape[1]} objects were measured; the chain has {n}")


def _mean_force(pushes: Sequence[MeasuredPush]) -> float | None:
    """Return the mean measured force, N; None if no push has wrenches."""
    measured = [push.wrenches for push in pushes if push.wrenches is not None]
    if not measured:
        return None
    wrenches = np.concatenate(measured)
    force = float(np.hypot(wrenches[:, 0], wrenches[:, 1]).mean())
    if not force > 0.0:
        raise PushplanError("all measured forces are zero; leave out the wrenches of a push without a force sensor")
    return force


def _mean_squares(errors: Sequence[FloatArray]) -> FloatArray:
    """Return the mean squares (3,) of errors (..., 3); x and y share one."""
    squares = np.concatenate([rows.reshape(-1, 3) for rows in errors]) ** 2
    away, turned = squares[:, :2].mean(), squares[:, 2].mean()
    return np.array([away, away, turned])


class _Problem:
    """Least-squares problem of all pushes.

    A place holds the chain's unknowns in the unit cube, then the shifts of the initial object poses of each piece.
    """

    def __init__(self, world: World, pushes: Sequence[MeasuredPush], jobs: int) -> None:
        forces = _mean_force(pushes)
        self.unknowns = Unknowns.from_world(world, absolute=forces is not None)
        self.count = len(self.unknowns.each)
        reach = world.chain.reach
        pieces = [(k, piece) for k, push in enumerate(pushes) for piece in Comparison.of_pieces(push, reach)]
        self.of_push, self.comparisons = [k for k, _ in pieces], [piece for _, piece in pieces]
        if not self.comparisons:
            raise PushplanError("the plate hardly moves in any push, so there is nothing to learn from")
        self.shape = (len(world.chain.objects), 3)
        length = half_extent(world.chain)
        unit = (forces or 1.0) * np.array([1.0, 1.0, length])  # without measured wrenches no row uses it
        self.least = np.vstack([np.tile(LEAST, (self.shape[0], 1)), LEAST_FORCE * unit])
        self.scales = np.vstack([np.tile(EXPECTED, (self.shape[0], 1)), EXPECTED_FORCE * unit])
        self.pool = ThreadPoolExecutor(jobs)

    def errors(self, place: FloatArray) -> FloatArray:
        """Return the errors of all pushes at a place, divided by their standard errors."""
        parts, shifts = place[: self.count], self._shifts(place)
        packed = self.unknowns.packed_for(self.unknowns.values(parts))
        pairs = zip(self.comparisons, shifts, strict=True)
        return np.concatenate(list(self.pool.map(lambda pair: self._scaled(pair[0], packed, pair[1]), pairs)))

    def _scaled(self, comparison: Comparison, packed: slip.World, shift: FloatArray) -> FloatArray:
        errors = comparison.errors(packed, shift)
        return np.asarray((errors / self.scales[: errors.shape[1]]).reshape(-1))

    def _shifts(self, place: FloatArray) -> FloatArray:
        return np.asarray(place[self.count :].reshape(len(self.comparisons), *self.shape) * EXPECTED)

    def best(self) -> FloatArray:
        """Return the most likely place; set the standard errors to its residuals."""
        # Mode switches of contacts can cause several minima, and each search ends in the nearest one.
        place = min((self._refined(start) for start in self._starts()), key=self._cost)
        self.scales = self._residual_sizes(place)
        # The residuals now tell the accuracy of the measurements, which changes the weights of the errors.
        place = self._refined(place)
        self.scales = self._residual_sizes(place)
        return place

    def _cost(self, place: FloatArray) -> float:
        return float((np.sqrt(1.0 + self.errors(place) ** 2) - 1.0).sum())  # `soft_l1`

    def _starts(self) -> list[FloatArray]:
        """Return the best of some places spread over the unit cube, with the initial object poses as measured."""
        count = self.count
        spread = qmc.Sobol(count, seed=1).random(LOOKED_AT) if count else np.zeros((1, 0))
        parts = np.vstack([np.full((1, count), 0.5), 0.02 + 0.96 * spread])
        places = np.hstack([parts, np.zeros((len(parts), len(self.comparisons) * self.shape[0] * 3))])
        return list(places[np.argsort([self._cost(place) for place in places], kind="stable")[:STARTS]])

    def _refined(self, start: FloatArray) -> FloatArray:
        """Return the nearest least-squares place; the unknowns stay in the cube, the initial poses are free."""
        bounded, free = self.count, len(start) - self.count
        low = np.concatenate([np.zeros(bounded), np.full(free, -np.inf)])
        high = np.concatenate([np.ones(bounded), np.full(free, np.inf)])
        # Start off the bounds: the trust region of `least_squares` shrinks with the distance to them.
        inside = np.concatenate([np.clip(start[:bounded], 0.01, 0.99), start[bounded:]])
        how: dict[str, Any] = {"bounds": (low, high), "xtol": 1e-4, "ftol": 1e-4, "max_nfev": 20, "loss": "soft_l1"}
        return np.asarray(least_squares(self.errors, inside, jac=self.jacobian, **how).x)

    def _residual_sizes(self, place: FloatArray) -> FloatArray:
        """Return the root mean square residuals of poses and wrenches at a place; x and y share one."""
        errors, n = self.errors(place), self.shape[0]
        free = max(0.5, 1.0 - len(place) / errors.size)  # degrees of freedom that are left
        rows = list(self._by_comparison(errors))
        left = [np.asarray(self.scales[0] * np.sqrt(_mean_squares([row[:, :n] for row in rows]) / free))] * n
        pushed = [
            row[comparison.closed, n:]
            for comparison, row in zip(self.comparisons, rows, strict=True)
            if row.shape[1] > n and comparison.closed.any()
        ]
        left.append(self.scales[n] * (np.sqrt(_mean_squares(pushed) / free) if pushed else 1.0))
        return np.asarray(np.maximum(left, self.least))

    def _by_comparison(self, errors: FloatArray) -> Iterator[FloatArray]:
        """Yield the errors of each comparison: (k, n, 3), with wrenches (k, n + 1, 3)."""
        begin = 0
        for comparison in self.comparisons:
            shape = (len(comparison.marks), self.shape[0] + (comparison.push.wrenches is not None), 3)
            end = begin + int(np.prod(shape))
            yield errors[begin:end].reshape(shape)
            begin = end

    def jacobian(self, place: FloatArray) -> FloatArray:
        """Return the derivatives of the errors; initial poses affect only the errors of their own push."""
        base = self.errors(place)

        def column(j: int) -> FloatArray:
            step = STEP if place[j] < 0.5 else -STEP
            moved = place.copy()
            moved[j] += step
            return (self.errors(moved) - base) / step

        columns = [column(j) for j in range(self.count)]
        packed = self.unknowns.packed_for(self.unknowns.values(place[: self.count]))
        shifts, begin = self._shifts(place), 0
        for k, (comparison, rows) in enumerate(zip(self.comparisons, self._by_comparison(base), strict=True)):
            for j in range(self.shape[0] * 3):
                moved = shifts[k].copy()
                moved.reshape(-1)[j] += 0.05 * EXPECTED[j % 3]
                there = self._scaled(comparison, packed, moved)
                whole = np.zeros(len(base))
                whole[begin : begin + rows.size] = (there - rows.reshape(-1)) / 0.05
                columns.append(whole)
            begin += rows.size
        return np.stack(columns, axis=1)

    def linearised(self, place: FloatArray) -> tuple[Callable[[FloatArray], FloatArray], FloatArray, float]:
        """Return the log-likelihood on the cube, the information matrix (p, p), and the correlation factor.

        The initial poses are integrated out: the part of the errors that they explain to first order is removed.
        """
        p, slope = self.count, self.jacobian(place)
        # Orthonormal basis of the errors that other initial poses explain; the projection removes them.
        explained = np.linalg.qr(slope[:, p:])[0]
        here = self.errors(place)
        widened = self._correlation(here)

        def left(errors: FloatArray) -> FloatArray:
            return np.asarray((errors - explained @ (explained.T @ errors)) / np.sqrt(widened))

        def one(parts: FloatArray) -> FloatArray:
            return left(self.errors_here(np.concatenate([parts, place[p:]])))

        groups = np.repeat(self.of_push, [rows.size for rows in self._by_comparison(here)])
        free = (1.0 - explained.shape[1] / len(slope)) / widened
        likelihood = Likelihood.from_slopes(left(slope[:, :p]), groups, self.unknowns.units(place[:p]), free)

        def of_all(places: FloatArray) -> FloatArray:
            return likelihood(np.array(list(self.pool.map(one, places))))

        return of_all, likelihood.information(left(here)), widened

    def errors_here(self, place: FloatArray) -> FloatArray:
        """Return `errors` without other threads; workers of the pool call this."""
        packed = self.unknowns.packed_for(self.unknowns.values(place[: self.count]))
        pairs = zip(self.comparisons, self._shifts(place), strict=True)
        return np.concatenate([self._scaled(one, packed, shift) for one, shift in pairs])

    def _correlation(self, errors: FloatArray) -> float:
        """Return (1 + r) / (1 - r) >= 1, where r is the correlation of neighbouring errors along the pushes."""
        products, squares = 0.0, 1e-300
        for rows in self._by_comparison(errors):
            products += float((rows[1:] * rows[:-1]).sum())
            squares += float((rows**2).sum())
        # Neighbouring errors are correlated: k poses of an AR(1) series count as k (1 - r) / (1 + r) poses.
        r = min(max(products / squares, 0.0), 0.95)
        return (1.0 + r) / (1.0 - r)
