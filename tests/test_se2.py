"""Group laws of planar poses, near the identity and far from it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from pushplan.geometry import se2
from pushplan.util.arrays import FloatArray

numbers = st.one_of(st.floats(-5.0, 5.0), st.floats(-1e-9, 1e-9), st.just(0.0))
poses = st.tuples(numbers, numbers, numbers).map(np.array)


def _matrix(pose: FloatArray) -> FloatArray:
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.array([[c, -s, pose[0]], [s, c, pose[1]], [0.0, 0.0, 1.0]])


@settings(max_examples=50)
@given(poses, poses)
def test_composition_is_the_matrix_product(a: FloatArray, b: FloatArray) -> None:
    np.testing.assert_allclose(_matrix(se2.compose(a, b)), _matrix(a) @ _matrix(b), atol=1e-12)


@settings(max_examples=50)
@given(poses, poses)
def test_relative_undoes_composition(a: FloatArray, b: FloatArray) -> None:
    np.testing.assert_allclose(se2.relative(a, se2.compose(a, b)), b, atol=1e-12)


@settings(max_examples=50)
@given(poses)
def test_exponential_is_the_matrix_exponential(twist: FloatArray) -> None:
    algebra = np.array([[0.0, -twist[2], twist[0]], [twist[2], 0.0, twist[1]], [0.0, 0.0, 0.0]])
    np.testing.assert_allclose(_matrix(se2.exp(twist)), expm(algebra), atol=1e-11)


@given(poses)
def test_logarithm_undoes_the_exponential(pose: FloatArray) -> None:
    twist = np.append(pose[:2], se2.wrap_angle(pose[2]))
    assert se2.log(se2.exp(twist)) == pytest.approx(twist, abs=1e-9)


@pytest.mark.parametrize(
    ("angle", "wrapped"), [(np.pi, -np.pi), (-np.pi, -np.pi), (7.0, 7.0 - 2 * np.pi), (0.0, 0.0)]
)
def test_angles_wrap_into_a_half_open_turn(angle: float, wrapped: float) -> None:
    assert se2.wrap_angle(angle) == pytest.approx(wrapped, abs=1e-15)


@settings(max_examples=50, deadline=None)
@given(poses, st.lists(poses, max_size=4))
def test_a_chain_of_poses_is_composed_pose_by_pose(start: FloatArray, steps: list[FloatArray]) -> None:
    expected = [start]
    for step in steps:
        expected.append(se2.compose(expected[-1], step))
    np.testing.assert_allclose(se2.chained(start, np.array(steps).reshape(-1, 3)), expected, atol=1e-12)
