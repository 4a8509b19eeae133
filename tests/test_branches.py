"""Every planner hands over the branches of its trees, and without a path the way that ends nearest to the goal."""

from __future__ import annotations

import numpy as np
import pytest
from plain import load_plain

import pushplan
from pushplan.planners.search.session import MOST_BRANCHES, Branches
from pushplan.scenario.file import scenario_from_text
from pushplan.util.names import PLANNERS

WALLED = """\
format: pushplan/1
floor: {friction: 0.3}
objects: [{name: box, shape: {box: [0.1, 0.1]}, mass: 1.0}]
contacts: {friction: 0.4}
pusher: {width: 0.2, thickness: 0.03, friction: 0.4}
goal: {pose: [2.0, 0.2, 0.2]}
workspace: {x: [-0.5, 2.5], y: [-1.0, 1.0]}
obstacles: [{polygon: [[1.2, -1.0], [1.4, -1.0], [1.4, 1.0], [1.2, 1.0]]}]
"""


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


@pytest.mark.parametrize("planner", PLANNERS)
def test_a_search_without_a_path_keeps_the_nearest_way(planner: str) -> None:
    done = pushplan.plan(scenario_from_text(WALLED), planner=planner, iterations=300, time_limit=60.0, seed=3)
    assert not done.solved
    assert done.nearest is not None
    assert len(done.nearest.segments) == 1
    assert done.nearest.error[0] < 1.9


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
