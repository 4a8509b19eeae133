"""The sphere of twist directions: its angles, its centres of rotation, and the rows of stable intervals."""

import numpy as np
import pytest

from pushplan.errors import PushplanError
from pushplan.mechanics.sphere import POLE, angles_of, checked_twists, twists_about, twists_at

LENGTH = 0.4


def test_angles_and_twists_are_inverse() -> None:
    rng = np.random.default_rng(0)
    lon, lat = rng.uniform(-np.pi, np.pi, 200), rng.uniform(-POLE, POLE, 200)
    twists = twists_at(lon, lat, LENGTH)
    assert twists.shape == (200, 3)
    np.testing.assert_allclose(np.linalg.norm(twists * [1.0, 1.0, LENGTH], axis=1), 1.0)
    for factor in (1.0, 3.0):
        np.testing.assert_allclose(angles_of(factor * twists, LENGTH), (lon, lat), atol=1e-12)


def test_centres_of_rotation_lie_on_a_line_through_the_origin() -> None:
    """c = L cot(lat) (-sin lon, cos lon), and a turn about it has v = -omega J c."""
    lon, lat = 0.7, np.array([-1.2, -0.3, 0.4, 1.5])
    cors = LENGTH / np.tan(lat)[:, None] * [-np.sin(lon), np.cos(lon)]
    twists = twists_at(lon, lat, LENGTH)
    for sense in (1, -1):
        some = np.sign(lat) == sense
        turned = twists_about(cors[some], sense)
        np.testing.assert_allclose(turned, twists[some] / np.abs(twists[some, 2:]), atol=1e-12)
    assert twists_about([0, 3], 1).dtype == np.float64
    with pytest.raises(PushplanError, match=r"sense is 2; it must be \+1 \(counter-clockwise\) or -1"):
        twists_about([0.0, 1.0], 2)


def test_one_zero_twist_among_others_is_found() -> None:
    twists = [[1.0, 0.0, 0.0], [0.0, 0.0, -1e-300], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    np.testing.assert_array_equal(checked_twists(twists[:2]), twists[:2])
    with pytest.raises(
        PushplanError, match=r"^twist 2 is zero; only the direction of a motion is stable or not$"
    ):
        checked_twists(twists)
