"""Chains, paths and trajectories cannot be built wrong: what is refused, and how it is said."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from pushplan.errors import ChainError, PushplanError
from pushplan.mechanics.chain import GRAVITY, PLATE, Chain, Contact
from pushplan.plans.path import PushPath
from pushplan.plans.trajectory import Trajectory

if TYPE_CHECKING:
    from conftest import ChainMaker


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


def test_a_contact_has_a_length_and_directions() -> None:
    contact = Contact(np.array([1.0, -1.0]), np.array([1.0, 3.0]), 0.3, 0, PLATE)
    assert contact.length == 4.0
    np.testing.assert_array_equal(contact.tangent, [0.0, 1.0])
    np.testing.assert_array_equal(contact.normal, [1.0, 0.0])
    with pytest.raises(ChainError, match=r"contact of object 0 has length 0\.0 m; it must be > 0"):
        Contact(np.zeros(2), np.zeros(2), 0.3, 0, PLATE)


def test_lengths_and_loads_of_a_chain(make_chain: ChainMaker) -> None:
    chain = make_chain.boxes(2, size=(0.1, 0.06), floor_friction=0.25)
    assert chain.characteristic_length == pytest.approx(np.hypot(0.2, 0.03), abs=1e-15)
    assert chain.objects[0].friction_load == pytest.approx(0.25 * GRAVITY)
    assert [chain.index_of(name) for name in ("box0", "box1")] == [0, 1]
    with pytest.raises(ChainError, match="no object is called 'box'; there are box0, box1"):
        chain.index_of("box")


def test_arrays_of_a_chain_cannot_be_changed(make_chain: ChainMaker) -> None:
    chain = make_chain.boxes(1)
    arrays = [chain.objects[0].outline, chain.objects[0].pose_chain, chain.contacts[0].right]
    arrays += [chain.contacts[0].left, chain.pusher.outline]
    for array in arrays:
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


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
