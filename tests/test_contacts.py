"""Chains and their contact conditions, against a linear program over forces at the contacts' ends."""

from itertools import product

import numpy as np
import pytest
from conftest import ChainMaker
from numpy.typing import ArrayLike
from scipy.optimize import linprog

from pushplan.geometry import se2
from pushplan.mechanics.chain import PLATE, Chain
from pushplan.mechanics.contacts import contact_state, friction_wrench
from pushplan.mechanics.sphere import POLE, angles_of, twists_at
from pushplan.sets.named import stable_set
from pushplan.util.arrays import FloatArray


def random_twists(chain: Chain, seed: int, count: int) -> FloatArray:
    """Return mostly forward twists, so that both outcomes occur."""
    rng = np.random.default_rng(seed)
    twists = rng.normal(size=(count, 3)) * [0.3, 0.3, 0.3 / chain.characteristic_length]
    return np.asarray(twists + [1.0, 0.0, 0.0], dtype=np.float64)  # noqa: RUF005


def slack(chain: Chain, needed: ArrayLike, pose: ArrayLike = (0.0, 0.0, 0.0)) -> float:
    """Return the largest t such that every end-point force along a friction cone's edge can be at least t (an LP).

    Args:
        chain: Whose contacts transmit the forces.
        needed: (n, 3) wrenches that the contacts of each object together have to exert, about the world's origin.
        pose: Of the chain frame in the world.
    """
    n = len(chain.objects)
    columns = np.zeros((3 * n, 4 * n + 1))
    for k, contact in enumerate(chain.contacts):
        edges = [contact.normal + sign * contact.friction * contact.tangent for sign in (-1.0, 1.0)]
        for j, (end, edge) in enumerate(product((contact.right, contact.left), edges)):
            x, f = se2.transform_points(pose, end), se2.rotate(np.asarray(pose)[2], edge)
            wrench = np.array([*f, x[0] * f[1] - x[1] * f[0]])
            columns[3 * k : 3 * k + 3, 4 * k + j] += wrench
            if contact.pusher != PLATE:
                columns[3 * contact.pusher : 3 * contact.pusher + 3, 4 * k + j] -= wrench
    bounds = np.hstack([-np.eye(4 * n), np.ones((4 * n, 1))])
    cost = np.append(np.zeros(4 * n), -1.0)
    solution = linprog(cost, bounds, np.zeros(4 * n), columns, np.ravel(needed), bounds=(None, None))
    assert solution.x is not None, solution.message
    return float(solution.x[-1])


@pytest.mark.parametrize("tree", [False, True])
@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_margin_agrees_with_a_linear_program(make_chain: ChainMaker, n: int, tree: bool) -> None:
    """The slack is positive exactly if the margin is positive."""
    outcomes = []
    for seed in range(4):
        chain = make_chain.random(seed, n, tree=tree, feet=seed % 2 == 1)
        twists = random_twists(chain, seed, 12)
        for twist, m in zip(twists, stable_set(chain).margin(twists), strict=True):
            friction = [friction_wrench(obj, [twist])[0] for obj in chain.objects]
            outcomes.append(slack(chain, np.negative(friction)) > 0.0)
            assert outcomes[-1] == (m > 0.0)
    assert any(outcomes) or n > 3
    assert not all(outcomes)


def test_contact_state_describes_the_same_forces(make_chain: ChainMaker) -> None:
    """Margins are positive exactly if the force is inside the friction cone and passes through the segment."""
    chain = make_chain.random(11, 3)
    twists = random_twists(chain, 5, 300) * [1.0, 0.5, 0.4]
    state = contact_state(chain, twists)
    inside = (state.friction_margins > 0.0) & (state.lambdas > 0.0) & (state.lambdas < 1.0)
    np.testing.assert_array_equal(inside, state.margins > 0.0)
    assert inside.any()
    total = -sum(friction_wrench(obj, twists) for obj in chain.objects)
    np.testing.assert_allclose(state.wrenches[:, 0], total, atol=1e-12)
    for k, contact in enumerate(chain.contacts):
        at = contact.right + state.lambdas[:, k, None] * (contact.left - contact.right)
        force = state.forces[:, k]
        moment = at[:, 0] * force[:, 1] - at[:, 1] * force[:, 0]
        np.testing.assert_allclose(moment, state.wrenches[:, k, 2], atol=1e-9)


LENGTH = 0.4


def test_angles_and_twists_are_inverse() -> None:
    rng = np.random.default_rng(0)
    lon, lat = rng.uniform(-np.pi, np.pi, 200), rng.uniform(-POLE, POLE, 200)
    twists = twists_at(lon, lat, LENGTH)
    assert twists.shape == (200, 3)
    np.testing.assert_allclose(np.linalg.norm(twists * [1.0, 1.0, LENGTH], axis=1), 1.0)
    for factor in (1.0, 3.0):
        np.testing.assert_allclose(angles_of(factor * twists, LENGTH), (lon, lat), atol=1e-12)
