"""Chains, paths and trajectories cannot be built wrong: what is refused, and how it is said."""

import re
from dataclasses import replace

import numpy as np
import pytest
from conftest import ChainMaker

from pushplan.errors import ChainError, PushplanError
from pushplan.mechanics.chain import PLATE, Chain
from pushplan.plans.path import PushPath
from pushplan.plans.trajectory import Trajectory


def test_a_chain_has_objects_and_a_contact_for_each(make_chain: ChainMaker) -> None:
    chain = make_chain.boxes(2)
    with pytest.raises(ChainError, match="a chain needs at least one object"):
        Chain((), (), chain.pusher)
    with pytest.raises(ChainError, match="2 objects need as many contacts, not 1"):
        Chain(chain.objects, chain.contacts[:1], chain.pusher)


@pytest.mark.parametrize(("pushed", "pusher"), [(0, 0), (1, 1), (1, 2), (1, -2), (0, PLATE)])
def test_a_contact_pushes_its_object_from_the_plate_or_an_earlier_one(
    make_chain: ChainMaker, pushed: int, pusher: int
) -> None:
    chain = make_chain.boxes(2)
    wrong = replace(chain.contacts[1], pushed=pushed, pusher=pusher)
    text = f"contact 1 pushes object {pushed} from {pusher}; it must push object 1 from the plate (-1) or"
    with pytest.raises(ChainError, match=re.escape(text)):
        Chain(chain.objects, (chain.contacts[0], wrong), chain.pusher)


def test_paths_are_scaled_and_go_forward() -> None:
    ahead = np.array([[1.0, 0.0, 0.0]])
    with pytest.raises(PushplanError, match="an arc of the path has a negative length"):
        PushPath(np.zeros(3), ahead, np.array([-0.1]))
    with pytest.raises(PushplanError, match="must be scaled to a cost rate of 1 m/s"):
        PushPath(np.zeros(3), 2.0 * ahead, np.array([0.1]))
    nowhere = PushPath(np.array([1.0, 2.0, 3.0]), ahead[:0], np.zeros(0))
    np.testing.assert_array_equal(nowhere.poses_at([0.0, 1.0]), [[1.0, 2.0, 3.0]] * 2)


@pytest.mark.parametrize("breaks", [[0.1, 1.0], [0.0, 0.0], [0.0, -1.0]])
def test_time_begins_at_0_and_goes_on(breaks: list[float]) -> None:
    with pytest.raises(PushplanError, match="breaks of the trajectory must start at 0 and increase"):
        Trajectory(np.zeros(3), np.array(breaks), np.zeros((1, 1, 3, 3))[0], np.zeros(1))
    with pytest.raises(PushplanError, match=r"rate is 0\.0 Hz; it must be > 0"):
        Trajectory(np.zeros(3), np.array([0.0, 1.0]), np.zeros((1, 3, 3)), np.zeros(1), rate=0.0)
