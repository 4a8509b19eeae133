"""What contacts transmit: the friction of all they carry, about near and far centres, and nothing without it."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from conftest import ChainMaker

import pushplan.core.contacts as contacts
from pushplan.mechanics.contacts import carried_objects, contact_state, friction_wrench
from pushplan.mechanics.packed import pack_chain
from pushplan.mechanics.support import UniformSupport
from pushplan.sets.named import stable_set

TWISTS = np.array(
    [
        *(
            [np.cos(a), np.sin(a), w]
            for a in (0.0, 0.4, np.pi / 2, 2.5)
            for w in (0.0, 1e-9, 1e-3, -0.1, 0.3)
        ),
        *([1e-9, -0.3, 2.0], [0.2, 1e-12, -5.0], [0.0, 0.0, 1.0]),
    ]
)
"""Translations, turns about far and about near centres, along the axes and across them."""


@pytest.mark.parametrize("feet", [False, True])
@pytest.mark.parametrize("affine", [False, True])
def test_every_contact_transmits_the_friction_of_what_it_carries(
    make_chain: ChainMaker, feet: bool, affine: bool
) -> None:
    chain = make_chain.random(7, 4, tree=True, feet=feet)
    if affine and not feet:
        loads = [obj.support for obj in make_chain.boxes(4).objects]
        objects = [
            replace(obj, outline=load.hull, support=UniformSupport(load.hull, np.array([0.01, -0.005])))
            for obj, load in zip(chain.objects, loads, strict=True)
        ]
        chain = replace(chain, objects=tuple(objects))
    alone = np.array([-friction_wrench(obj, TWISTS) for obj in chain.objects])
    for k, carried in enumerate(carried_objects(chain)):
        together = contact_state(chain, TWISTS).wrenches[:, k]
        np.testing.assert_allclose(together, alone[carried].sum(axis=0), atol=1e-11)


def test_without_force_a_contact_is_at_its_friction_angle_outside(make_chain: ChainMaker) -> None:
    chain = make_chain.boxes(2, contact_friction=0.5)
    chain = replace(chain, objects=(chain.objects[0], replace(chain.objects[1], floor_friction=0.0)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        state = contact_state(chain, TWISTS[:3])
    np.testing.assert_array_equal(state.margins[:, 1], 0.0)
    assert (state.margins[0] >= 0.0).all()
    np.testing.assert_allclose(state.friction_margins[:, 1], -np.arctan(0.5))
    assert np.isinf(state.lambdas[:, 1]).all()
    for array in (state.margins, state.friction_margins, state.lambdas, state.forces, state.wrenches):
        assert not array.flags.writeable


def test_a_margin_is_exact_above_the_floor_asked_for(make_chain: ChainMaker) -> None:
    chain = make_chain.random(3, 4, tree=True)
    packed, exact = pack_chain(chain), stable_set(chain).margin(TWISTS)
    for twist, margin in zip(TWISTS[:, None], exact, strict=True):
        assert contacts.margins_of(packed, twist, -2.0) == pytest.approx(margin, abs=1e-12)
        assert contacts.margins_of(packed, twist, margin - 0.01) == pytest.approx(margin, abs=1e-12)
        assert contacts.margins_of(packed, twist, margin + 0.01) <= margin + 0.01
