"""Every planner hands over the branches of its trees, and without a path the way that ends nearest to the goal."""

from __future__ import annotations

import numpy as np
import pytest
from plain import load_plain

import pushplan
from pushplan.planners.search.session import MOST_BRANCHES, Branches
from pushplan.util.names import PLANNERS


@pytest.mark.parametrize("planner", PLANNERS)
def test_a_search_leaves_branches(planner: str) -> None:
    scenario = load_plain("narrow-gap")
    tree = pushplan.plan(scenario, planner=planner, iterations=60, time_limit=60.0, seed=3).tree
    assert 0 < len(tree) <= MOST_BRANCHES
    assert np.isfinite(tree).all()
    apart = np.abs(np.diff(tree[:, :, :2], axis=1)).max(axis=(1, 2))
    assert apart.max() > 0.01
    xmin, xmax = scenario.workspace.xmin, scenario.workspace.xmax  # type: ignore[union-attr]
    assert ((tree[:, :, 0] > xmin) & (tree[:, :, 0] < xmax)).all()


def test_the_largest_trees_count_and_are_thinned_evenly() -> None:
    count = 3 * MOST_BRANCHES
    poses = np.arange(3.0 * count).reshape(count, 3)
    kept = Branches()
    kept.offer((poses[:5], np.array([-1, 0, 1, 1, 3])))
    assert kept.ends.tolist() == [
        poses[[0, 1]].tolist(),
        poses[[1, 2]].tolist(),
        poses[[1, 3]].tolist(),
        poses[[3, 4]].tolist(),
    ]
    kept.offer((poses, np.arange(count) - 1))
    kept.offer((poses[:5], np.array([-1, 0, 0, 0, 0])))
    assert (len(kept.ends), kept.size) == (MOST_BRANCHES, count - 1)
    assert kept.ends[0].tolist() == poses[[0, 1]].tolist()
    assert kept.ends[-1].tolist() == poses[[-2, -1]].tolist()
