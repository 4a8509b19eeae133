"""What contacts carry: which objects, their common centre of friction, and every centre that loads may have."""

from itertools import product

import numpy as np
import pytest
import shapely

from pushplan.mechanics.contacts import center_range, common_centers


def test_where_there_is_no_friction_the_plain_mean_stands_in() -> None:
    carried = np.array([[True, True], [False, True]])
    found = common_centers(carried, np.array([3.0, 0.0]), np.array([[0.0, 0.0], [1.0, 2.0]]))
    np.testing.assert_allclose(found, [[0.0, 0.0], [1.0, 2.0]])
    found = common_centers(carried, np.zeros(2), np.array([[0.0, 0.0], [1.0, 2.0]]))
    np.testing.assert_allclose(found, [[0.5, 1.0], [1.0, 2.0]])
    found = common_centers(carried, np.array([0.03, 0.01]), np.array([[0.0, 0.0], [1.0, 2.0]]))
    np.testing.assert_allclose(found, [[0.25, 0.5], [1.0, 2.0]])
    found = center_range(np.zeros((2, 2)), np.array([[0.0, 0.0], [1.0, 2.0]]))
    np.testing.assert_allclose(found, [[0.5, 1.0]])


@pytest.mark.parametrize("seed", range(20))
def test_the_range_of_centres_is_the_hull_of_all_extreme_loads(seed: int) -> None:
    """A centre is a ratio of linear functions of the loads, so the extremes are among their corners."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 7))
    centers = rng.normal(size=(n, 2))
    loads = np.sort(rng.uniform(0.0, 2.0, (n, 2)) * (rng.random((n, 2)) < 0.8), axis=1)
    loads[0] = [0.5, 1.5]
    extreme = [np.array(some) for some in product(*loads) if sum(some) > 0.0]
    everything = shapely.MultiPoint([some @ centers / some.sum() for some in extreme]).convex_hull
    corners = center_range(loads, centers)
    assert shapely.MultiPoint(corners).convex_hull.hausdorff_distance(everything) < 1e-9
    again = shapely.get_coordinates(everything)
    assert all(np.abs(again - corner).max(axis=1).min() < 1e-9 for corner in corners)
