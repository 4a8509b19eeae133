"""The sparse tree keeps its promises, and OMPL gets what a planner owes it."""

import numpy as np
import pytest
from ompl import base as ob
from plain import load_plain

from pushplan.core.collision import sweep_is_free
from pushplan.core.problem import Problem
from pushplan.core.search import SparseTree
from pushplan.geometry import se2
from pushplan.planners.problem import body_reach, build_problem, sampling_box
from pushplan.planners.search.form import pose_problem
from pushplan.planners.search.planners import StableSparseRRT
from pushplan.planners.search.session import Budget, Session
from pushplan.sets.named import stable_set
from pushplan.util.arrays import IntArray

HEADING_LENGTH = 0.4
RADII = (HEADING_LENGTH, 0.5, 0.25)


@pytest.fixture(scope="module")
def problem() -> Problem:
    scenario = load_plain("three-boxes-clutter")
    return build_problem(scenario, stable_set(scenario.chain))


def _session(problem: Problem, iterations: int) -> Session:
    start = load_plain("three-boxes-clutter").start
    return Session(problem, start, Budget(60.0, iterations=iterations), seed=1)


@pytest.fixture(scope="module")
def tree(problem: Problem) -> SparseTree:
    """Return a tree grown with 4,000 extensions, its connections to the goal left unused."""
    session = _session(problem, 1)
    box = sampling_box(load_plain("three-boxes-clutter"))
    tree = SparseTree(session.start, problem.goal, np.array(box), *RADII)
    done = 0
    while done < 4000:
        done += tree.grow(problem, session.random, np.inf, 4000 - done)[0]
    return tree


def _rows(tree: SparseTree) -> IntArray:
    return np.setdiff1d(np.arange(len(tree.nodes)), tree.unused)


def test_every_branch_is_a_free_arc_with_the_right_cost(problem: Problem, tree: SparseTree) -> None:
    rows = _rows(tree)
    assert len(rows) > 100
    nodes, to_go = tree.nodes, tree.to_go
    for row in rows[1:]:
        node, parent = nodes[row], nodes[int(nodes[row, 4])]
        end = se2.compose(parent[:3], se2.exp(node[5:8] * node[8]))
        np.testing.assert_allclose(node[:3], end, atol=1e-12)
        assert node[3] == pytest.approx(parent[3] + node[8], abs=1e-12)
        assert sweep_is_free(problem.scene, *parent[:3], *node[5:9])
        assert to_go[row] <= np.hypot(*(problem.goal[:2] - node[:2])) + 0.1 * np.pi + 1e-12


def test_it_is_an_ompl_planner_whose_solution_ends_at_the_goal(problem: Problem) -> None:
    scenario = load_plain("three-boxes-clutter")
    session = Session(problem, scenario.start, Budget(60.0, first=True), seed=3)
    information, definition = pose_problem(session, sampling_box(scenario), body_reach(scenario))
    planner = StableSparseRRT(information)
    assert isinstance(planner, ob.Planner)
    planner.setProblemDefinition(definition)
    planner.setup()
    status = planner.solve(ob.PlannerTerminationCondition(session.settled))
    assert status.getStatus() == ob.PlannerStatus.EXACT_SOLUTION
    assert definition.hasExactSolution()
    end = definition.getSolutionPath().getStates()[-1]
    np.testing.assert_allclose([end.getX(), end.getY()], problem.goal[:2], atol=1e-9)
    assert abs(float(se2.wrap_angle(end.getYaw() - problem.goal[2]))) < 1e-9
