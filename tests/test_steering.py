"""Exact connections: every word ends on the goal; for Dubins' car the shortest one is OMPL's."""

import numpy as np
import pytest
from ompl import base as ob

from pushplan.core.problem import LEFT, RIGHT, STRAIGHT, find_words
from pushplan.geometry import se2
from pushplan.plans.path import cost_rate
from pushplan.util.arrays import FloatArray


def _turning(cor: tuple[float, float], sense: float) -> FloatArray:
    twist = np.array([cor[1], -cor[0], 1.0]) * sense
    return np.asarray(twist / cost_rate(twist))


def _end(family: FloatArray, word: FloatArray, start: FloatArray) -> FloatArray:
    pose = start
    for letter, length in zip(word[1:4], word[4:7], strict=True):
        pose = se2.compose(pose, se2.exp(family[int(letter)] * length))
    return pose


@pytest.mark.parametrize("lean", [0.0, 0.3])
def test_every_word_ends_on_the_goal(lean: float) -> None:
    rng = np.random.default_rng(4)
    checked = 0
    for _ in range(300):
        left = (rng.uniform(-0.2, 0.1), rng.uniform(0.2, 1.0))
        right = (rng.uniform(-0.2, 0.1), rng.uniform(-1.0, -0.2))
        family = np.array([_turning(left, 1.0), [np.cos(lean), np.sin(lean), 0.0], _turning(right, -1.0)])
        start, goal = rng.uniform(-2.0, 2.0, (2, 3))
        for word in find_words(family, start, goal):
            end = _end(family, word, start)
            assert np.abs(end[:2] - goal[:2]).max() < 1e-9
            assert abs(se2.wrap_angle(end[2] - goal[2])) < 1e-9
            assert (word[4:7] >= 0.0).all()
            checked += 1
    assert checked > 1000


def test_the_shortest_word_of_a_symmetric_car_is_that_of_dubins() -> None:
    """The oracle is OMPL's Dubins space; with CORs at (0, +-R) turning costs (R + 0.1) per radian here."""
    rng = np.random.default_rng(5)
    radius = 0.7
    family = np.array([_turning((0.0, radius), 1.0), [1.0, 0.0, 0.0], _turning((0.0, -radius), -1.0)])
    travel = np.array([radius / (radius + 0.1), 1.0, radius / (radius + 0.1)])
    space = ob.DubinsStateSpace(radius)
    bounds = ob.RealVectorBounds(2)
    bounds.setLow(-10.0)
    bounds.setHigh(10.0)
    space.setBounds(bounds)
    a, b = space.allocState(), space.allocState()
    for _ in range(300):
        start, goal = rng.uniform(-3.0, 3.0, (2, 3))
        for state, pose in ((a, start), (b, goal)):
            state.setX(pose[0])
            state.setY(pose[1])
            state.setYaw(float(se2.wrap_angle(pose[2])))
        words = find_words(family, start, goal)
        shortest = min(word[4:7] @ travel[word[1:4].astype(int)] for word in words)
        assert shortest == pytest.approx(space.distance(a, b), abs=1e-7)


@pytest.mark.parametrize(("missing", "letters"), [(RIGHT, {LEFT, STRAIGHT}), (LEFT, {RIGHT, STRAIGHT})])
def test_turning_one_way_is_enough(missing: int, letters: set[int]) -> None:
    family = np.array([_turning((0.0, 0.5), 1.0), [1.0, 0.0, 0.0], _turning((0.0, -0.4), -1.0)])
    family[missing] = 0.0
    start, goal = np.array([0.0, 0.0, 0.0]), np.array([1.0, -0.7, 1.0])
    words = find_words(family, start, goal)
    assert len(words) == 1
    assert set(words[0, 1:4].astype(int)) <= letters
    np.testing.assert_allclose(_end(family, words[0], start)[:2], goal[:2], atol=1e-12)
