"""From measured pushes to intervals of friction and loads."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from pushplan.basics.arrays import FloatArray
from pushplan.errors import PushplanError
from pushplan.sim.identify.course import Course
from pushplan.sim.identify.fit import STEP, best_start, refined
from pushplan.sim.identify.identification import Identification
from pushplan.sim.identify.prediction import Comparison
from pushplan.sim.identify.surrogate import sample_errors
from pushplan.sim.identify.unknowns import Unknowns
from pushplan.sim.worlds.world import World

EXPECTED = np.array([1e-3, 1e-3, 5e-3])
"""Errors of measured poses to begin with: m, m, rad."""
LEAST = np.array([5e-5, 5e-5, 2e-4])
"""Errors that are taken for granted, even of simulated poses: those of steps and of loads on points."""


def identify_courses(
    world: World,
    courses: Sequence[Course],
    *,
    seed: int = 1,
    jobs: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Identification:
    """Find contact friction, loads and ratios of floor friction.

    Quasi-static motion does not change when all floor frictions grow alike: poses determine only their ratios.

    Args:
        world: Shapes and contacts of the chain, masses, obstacles; its frictions and loads do not matter, but that
            ratios of floor friction are looked for around the stated ones.
        courses: What was measured of this chain, pushed one or several times.
        seed: Of the random numbers.
        jobs: Threads; None for one a processor.
        progress: Called with the rounds that are done, and how many there are.

    Raises:
        PushplanError: When there is no course, one is of another number of objects, or nothing moves in any.
    """
    _check(world, courses)
    problem = _Problem(world, courses, jobs or os.cpu_count() or 1)
    with problem.pool:
        place = problem.best()
        errors, information, correlation = problem.linearised(place)
        best = place[: problem.count]
        found = sample_errors(errors, best, information, np.random.default_rng(seed), progress)
    scales = problem.scales
    return Identification(
        problem.unknowns,
        problem.unknowns.values(found.places),
        (float(scales[0]), float(scales[2])),
        correlation,
        found.worth,
    )


def _check(world: World, courses: Sequence[Course]) -> None:
    if not courses:
        raise PushplanError("there is no push to learn from; at least one course is needed")
    n = len(world.chain.objects)
    for course in courses:
        if course.object_poses.shape[1] != n:
            raise PushplanError(
                f"{course.name}: {course.object_poses.shape[1]} objects were measured; the chain has {n}"
            )


class _Problem:
    """All courses with what is not known: the numbers of the chain, and where the objects stood at first."""

    def __init__(self, world: World, courses: Sequence[Course], jobs: int) -> None:
        self.unknowns = Unknowns.from_world(world)
        self.count = len(self.unknowns.each)
        reach = world.chain.reach
        self.comparisons = [piece for course in courses for piece in Comparison.of_pieces(course, reach)]
        if not self.comparisons:
            raise PushplanError("the plate hardly moves in any course, so there is nothing to learn from")
        self.shape = (len(world.chain.objects), 3)
        self.scales = EXPECTED
        self.pool = ThreadPoolExecutor(jobs)

    def errors(self, place: FloatArray) -> FloatArray:
        """Return the errors of all courses over their expected sizes; the places of the start follow the cube's."""
        parts, shifts = place[: self.count], self._shifts(place)
        packed = self.unknowns.packed_for(self.unknowns.values(parts))
        rows = self.pool.map(
            lambda k: self.comparisons[k].errors(packed, shifts[k]), range(len(self.comparisons))
        )
        return np.concatenate([(row / self.scales).reshape(-1) for row in rows])

    def _shifts(self, place: FloatArray) -> FloatArray:
        return np.asarray(place[self.count :].reshape(len(self.comparisons), *self.shape) * EXPECTED)

    def best(self) -> FloatArray:
        """Return the most likely place, with expected errors that are as large as those it leaves."""
        none = np.zeros(len(self.comparisons) * self.shape[0] * 3)
        place = best_start(lambda parts: self.errors(np.concatenate([parts, none])), self.count)
        place = np.concatenate([place, none])
        for _ in range(2):
            place = refined(self.errors, place, jacobian=self.jacobian, free=len(none))
            self.scales = self._left_over(place)
        return place

    def _left_over(self, place: FloatArray) -> FloatArray:
        """Return the root mean square errors that a place leaves, m, m, rad."""
        errors = self.errors(place).reshape(-1, 3) * self.scales
        free = max(0.5, 1.0 - len(place) / errors.size)  # degrees of freedom that are left
        squares = (errors**2).mean(axis=0) / free
        away = 0.5 * (squares[0] + squares[1])
        return np.asarray(np.maximum(np.sqrt([away, away, squares[2]]), LEAST))

    def jacobian(self, place: FloatArray) -> FloatArray:
        """Return the derivatives of the errors; where a course began changes that course only."""
        base = self.errors(place)

        def column(j: int) -> FloatArray:
            step = STEP if place[j] < 0.5 else -STEP
            moved = place.copy()
            moved[j] += step
            return (self.errors(moved) - base) / step

        columns = [column(j) for j in range(self.count)]
        packed = self.unknowns.packed_for(self.unknowns.values(place[: self.count]))
        shifts, begin = self._shifts(place), 0
        for k, comparison in enumerate(self.comparisons):
            size = len(comparison.marks) * self.shape[0] * 3
            for j in range(self.shape[0] * 3):
                moved = shifts[k].copy()
                moved.reshape(-1)[j] += 0.05 * EXPECTED[j % 3]
                there = (comparison.errors(packed, moved) / self.scales).reshape(-1)
                whole = np.zeros(len(base))
                whole[begin : begin + size] = (there - base[begin : begin + size]) / 0.05
                columns.append(whole)
            begin += size
        return np.stack(columns, axis=1)

    def linearised(self, place: FloatArray) -> tuple[Callable[[FloatArray], FloatArray], FloatArray, float]:
        """Return the errors of places in the cube, half of their squares' second derivatives, and their correlation.

        Where the courses began is integrated out: what that can explain of the errors, to first order, is taken away.
        """
        p, slope = self.count, self.jacobian(place)
        explained = np.linalg.qr(slope[:, p:])[0]
        widened = self._correlation(self.errors(place))

        def left(errors: FloatArray) -> FloatArray:
            return np.asarray((errors - explained @ (explained.T @ errors)) / np.sqrt(widened))

        def one(parts: FloatArray) -> FloatArray:
            return left(self.errors_here(np.concatenate([parts, place[p:]])))

        rows = left(slope[:, :p])
        return lambda places: np.array(list(self.pool.map(one, places))), rows.T @ rows, widened

    def errors_here(self, place: FloatArray) -> FloatArray:
        """Return `errors` without handing work to other threads: for those that are at work in one."""
        packed = self.unknowns.packed_for(self.unknowns.values(place[: self.count]))
        pairs = zip(self.comparisons, self._shifts(place), strict=True)
        return np.concatenate([(one.errors(packed, shift) / self.scales).reshape(-1) for one, shift in pairs])

    def _correlation(self, errors: FloatArray) -> float:
        """Return (1 + r) / (1 - r) with the correlation r between neighbours along the courses, >= 1."""
        begin, products, squares = 0, 0.0, 1e-300
        for comparison in self.comparisons:
            size = len(comparison.marks) * self.shape[0] * 3
            rows = errors[begin : begin + size].reshape(len(comparison.marks), -1)
            products += float((rows[1:] * rows[:-1]).sum())
            squares += float((rows**2).sum())
            begin += size
        r = min(max(products / squares, 0.0), 0.95)
        return (1.0 + r) / (1.0 - r)
