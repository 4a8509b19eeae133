"""The contact conditions against a linear program over forces at the contacts' ends, and their invariances."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import ChainMaker
from scipy.optimize import linprog

from pushplan.mechanics.chain import Chain, Contact
from pushplan.mechanics.contacts import contact_state, friction_wrench
from pushplan.sets.named import stable_set
from pushplan.util.arrays import FloatArray


def random_twists(chain: Chain, seed: int, count: int) -> FloatArray:
    """Return twists that mostly go forward, so that both outcomes occur."""
    rng = np.random.default_rng(seed)
    twists = rng.normal(size=(count, 3)) * [0.3, 0.3, 0.3 / chain.characteristic_length]
    return np.asarray(twists + [1.0, 0.0, 0.0], dtype=np.float64)  # noqa: RUF005


def slack(chain: Chain, twist: FloatArray) -> float:
    """Return by how much forces at the ends of all contacts can stay inside their friction cones, N.

    Unknowns: normal and tangential force at both ends of each contact, and the slack t, which is maximised. Every
    object is in equilibrium under its friction and the forces at all contacts it takes part in.
    """
    n = len(chain.objects)
    equal, load = np.zeros((3 * n, 4 * n + 1)), np.zeros(3 * n)
    bound = np.zeros((4 * n, 4 * n + 1))
    for k, contact in enumerate(chain.contacts):
        load[3 * k : 3 * k + 3] = -friction_wrench(chain.objects[k], [twist])[0]
        for end, point in enumerate((contact.right, contact.left)):
            for axis, direction in enumerate((contact.normal, contact.tangent)):
                column = 4 * k + 2 * end + axis
                wrench = [*direction, point[0] * direction[1] - point[1] * direction[0]]
                equal[3 * k : 3 * k + 3, column] = wrench
                if contact.pusher >= 0:
                    equal[3 * contact.pusher : 3 * contact.pusher + 3, column] = -np.array(wrench)
            for row, sign in enumerate((-1.0, 1.0)):
                bound[4 * k + 2 * end + row, 4 * k + 2 * end : 4 * k + 2 * end + 2] = [
                    -contact.friction,
                    sign,
                ]
                bound[4 * k + 2 * end + row, -1] = 1.0
    cost = np.zeros(4 * n + 1)
    cost[-1] = -1.0
    solution = linprog(cost, A_ub=bound, b_ub=np.zeros(4 * n), A_eq=equal, b_eq=load, bounds=(None, None))
    assert solution.x is not None, solution.message
    return float(solution.x[-1])


@pytest.mark.parametrize("tree", [False, True])
@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_margin_agrees_with_a_linear_program(make_chain: ChainMaker, n: int, tree: bool) -> None:
    """Positive slack exactly where the margin is positive."""
    outcomes = []
    for seed in range(8):
        chain = make_chain.random(seed, n, tree=tree, feet=seed % 2 == 1)
        twists = random_twists(chain, seed, 12)
        for twist, m in zip(twists, stable_set(chain).margin(twists), strict=True):
            outcomes.append(slack(chain, twist) > 0.0)
            assert outcomes[-1] == (m > 0.0)
    assert any(outcomes) or n > 3
    assert not all(outcomes)


def test_contact_state_describes_the_same_forces(make_chain: ChainMaker) -> None:
    """Margins are positive exactly where the force is inside the friction cone and passes through the segment."""
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


def test_stability_does_not_depend_on_the_frame(make_chain: ChainMaker) -> None:
    """Margins do (moments about another origin), their signs and the friction margins do not."""
    chain = make_chain.random(7, 3)
    pose = np.array([0.4, -0.3, 0.8])
    twists = random_twists(chain, 4, 200)
    c, s = np.cos(pose[2]), np.sin(pose[2])
    velocity = twists[:, :2] @ np.array([[c, s], [-s, c]])
    velocity -= twists[:, [2]] * np.array([-pose[1], pose[0]])
    moved_twists = np.column_stack([velocity, twists[:, 2]])
    state, moved = contact_state(chain, twists), contact_state(make_chain.moved(chain, pose), moved_twists)
    np.testing.assert_array_equal(state.margins > 0.0, moved.margins > 0.0)
    np.testing.assert_allclose(moved.friction_margins, state.friction_margins, atol=1e-10)
    np.testing.assert_allclose(moved.lambdas, state.lambdas, rtol=1e-7)


def test_long_narrow_contact_keeps_its_conditions(make_chain: ChainMaker) -> None:
    """A contact of 1 um can only transmit forces through itself: translation along its axis holds, turning not."""
    chain = make_chain.boxes(1, pusher_friction=0.5)
    needle = Contact(np.array([0.0, -5e-7]), np.array([0.0, 5e-7]), 0.5, 0, -1)
    stable = stable_set(replace(chain, contacts=(needle,)))
    assert stable.contains([[1.0, 0.0, 0.0], [1.0, 0.0, 0.1], [1.0, 0.0, -0.1]]).tolist() == [
        True,
        False,
        False,
    ]
