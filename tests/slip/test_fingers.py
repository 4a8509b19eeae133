"""Pushes with round fingers, also some that were measured."""

import numpy as np
import pytest

from pushplan.geometry import se2
from pushplan.mechanics.chain import PushedObject
from pushplan.mechanics.support import UniformSupport
from pushplan.sim.slip.simulator import FingerPush
from pushplan.util.arrays import FloatArray

SQUARE = 0.045 * np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
TIP = np.array([[0.0, 0.0, 4.75e-3]])
REAL = np.array(
    [
        [0.36206, -0.04214, 0.00652, 0.39749, 0.0081, 0.3981, -0.04191, 0.35061, -0.0673, -0.66979],
        [0.33746, -0.03813, -1.94385, 0.39771, -0.0084, 0.42881, -0.04751, 0.33751, -0.03824, -1.94499],
        [0.32365, -0.02318, 1.6992, 0.37769, -0.05201, 0.33338, -0.0752, 0.30304, -0.02116, 1.16534],
        [0.35093, -0.05449, 1.04953, 0.41471, -0.0334, 0.45331, -0.0652, 0.35101, -0.05453, 1.0517],
        [0.32371, -0.03261, -0.86671, 0.38339, -0.0472, 0.40021, -9e-05, 0.32445, -0.03132, -0.68131],
    ]
)
"""Object before (x, y, theta), tip before and after (x, y), object after: pushes of the square 'rect1' on ABS by the
MIT MCube lab (Yu et al., IROS 2016), as logged in github.com/robinzhoucmu/Pushing, Apache-2.0; units changed."""


def square(fingers: FloatArray, friction: float = 0.225) -> FingerPush:
    obj = PushedObject("square", SQUARE[::-1], 1.0, 0.3, UniformSupport(SQUARE), np.zeros(3))
    return FingerPush(obj, fingers, friction)


def along(begin: tuple[float, float], end: tuple[float, float], steps: int = 50) -> FloatArray:
    share = np.linspace(0.0, 1.0, steps + 1)[:, None]
    return np.column_stack([np.array(begin) + (np.array(end) - begin) * share, np.zeros(steps + 1)])


def test_a_push_through_the_centre_goes_straight_and_one_beside_it_turns() -> None:
    reach = 0.045 + 4.75e-3
    straight = square(TIP).push(np.zeros(3), along((-reach, 0.0), (0.05 - reach, 0.0)))
    assert straight[-1] == pytest.approx([0.05, 0.0, 0.0], abs=1e-6)
    aside = square(TIP).push(np.zeros(3), along((-reach, 0.02), (0.05 - reach, 0.02)))
    assert aside[-1, 2] < -0.3


def test_two_fingers_hold_what_one_turns() -> None:
    reach = 0.045 + 2.5e-3
    two = np.array([[0.0, 0.009, 2.5e-3], [0.0, -0.009, 2.5e-3]])
    pushed = square(two, 0.5).push(np.zeros(3), along((-reach, 0.004), (0.05 - reach, 0.004)))
    assert pushed[-1] == pytest.approx([0.05, 0.0, 0.0], abs=1e-6)


def test_measured_pushes_are_predicted_to_some_millimetres() -> None:
    push = square(TIP)
    for row in REAL:
        predicted = push.push(row[:3], along(tuple(row[3:5]), tuple(row[5:7])))[-1]
        assert np.hypot(*(predicted - row[7:])[:2]) < 6e-3
        assert abs(se2.wrap_angle(predicted[2] - row[9])) < 0.2
