"""Odd chains and odd questions: every set has a defined answer, never nan, or a clear error."""

import numpy as np
import pytest
from conftest import ChainMaker

from pushplan.mechanics.chain import Chain
from pushplan.mechanics.intervals import IntervalChain
from pushplan.mechanics.sphere import twists_about
from pushplan.mechanics.support import FeetSupport, UniformSupport
from pushplan.sets.interval_set import stable_set_over
from pushplan.sets.named import stable_set
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray
from pushplan.util.names import STABLE_SETS

INTERVALS = tuple(f"{name} of intervals" for name in STABLE_SETS if name != "cof")


def make(chain: Chain, name: str) -> StableSet:
    """Return a set of a chain, or that of all masses and floor frictions within 30 % of its own."""
    name, _, rest = name.partition(" ")
    if not rest:
        return stable_set(chain, name)
    spans = {obj.name: (0.7 * obj.mass, 1.3 * obj.mass) for obj in chain.objects}
    frictions = {obj.name: (0.7 * obj.floor_friction, 1.3 * obj.floor_friction) for obj in chain.objects}
    return stable_set_over(IntervalChain.from_ranges(chain, spans, frictions), name)


def odd_chains(make_chain: ChainMaker) -> list[Chain]:
    """No friction on the floor or in contacts, huge friction, slivers, one or two feet, a centre off the middle."""
    sliver = np.array([[-0.05, -1e-7], [0.05, -1e-7], [0.05, 1e-7], [-0.05, 1e-7]])
    return [
        make_chain.boxes(2),
        make_chain.boxes(2, floor_friction=0.0),
        make_chain.boxes(2, contact_friction=0.0),
        make_chain.boxes(2, contact_friction=1e9, pusher_friction=1e9),
        make_chain.boxes(2, floor_friction=1e9),
        make_chain.boxes(2, size=(1e-6, 0.1)),
        make_chain.boxes(1, support=lambda _: UniformSupport(sliver)),
        make_chain.boxes(1, support=lambda _: FeetSupport(np.zeros((1, 2)), np.ones(1))),
        make_chain.boxes(
            1, support=lambda _: FeetSupport(np.array([[0.0, -0.05], [0.0, 0.05]]), np.full(2, 0.5))
        ),
        make_chain.boxes(1, support=lambda o: UniformSupport(o, np.array([0.01, 0.0]))),
    ]


def odd_twists(chain: Chain) -> FloatArray:
    """About corners, middles of edges, contact ends, centres of friction, near these, and far; and hardly moving."""
    corners = [obj.outline_chain for obj in chain.objects]
    contacts = np.array([end for c in chain.contacts for end in (c.right, c.left)])
    middles = [0.5 * (points + np.roll(points, -1, axis=0)) for points in corners]
    cors = np.concatenate([*corners, *middles, contacts, *(p.mean(axis=0)[None] for p in corners)])
    common = np.mean([p.mean(axis=0) for p in corners], axis=0)[None]
    cors = np.concatenate([cors, common, cors + 1e-9, cors * 1e9])
    slow = [[1.0, 0.0, 0.0], [1.0, 0.0, 1e-300], [1e-200, 0.0, 0.0]]
    return np.concatenate([twists_about(cors, +1), twists_about(cors, -1), slow])


@pytest.mark.parametrize("name", [*STABLE_SETS, *INTERVALS])
def test_odd_questions_have_answers(make_chain: ChainMaker, name: str) -> None:
    slow = name.startswith("robust")
    for chain in odd_chains(make_chain)[slow :: 3 if slow else 1]:
        stable = make(chain, name)
        margins = stable.contact_margins(odd_twists(chain))
        assert np.isfinite(margins).all()
        assert (np.abs(margins) <= 1.0 + 1e-9).all()
        # Which samples of an outline are looked at depends on the order of the rows: within what these may miss.
        near = 1e-5 if name.startswith("robust") else 1e-9
        np.testing.assert_allclose(stable.margin(odd_twists(chain)), margins.min(axis=1), atol=near)
        if name in STABLE_SETS:
            assert np.isfinite(stable.area())
            assert not np.isnan(stable.turning_radii()).any()
            assert stable.cor_region(+1).is_valid


@pytest.mark.parametrize("name", [*STABLE_SETS, *INTERVALS])
def test_nothing_is_stable_without_friction(make_chain: ChainMaker, name: str) -> None:
    """Nor does anything fail: regions are empty, radii infinite, cones None."""
    for chain in (make_chain.boxes(1, floor_friction=0.0), make_chain.boxes(2, contact_friction=0.0)):
        stable = make(chain, name)
        assert stable.translation_cone() is None
        assert len(stable.meridians(count=48)) == 0
        if name in STABLE_SETS:
            assert stable.area() == 0.0
            assert stable.cor_region(+1).is_empty
            assert stable.cor_region(-1).is_empty
            assert stable.turning_radii() == (np.inf, np.inf)


@pytest.mark.parametrize("name", [*STABLE_SETS, *INTERVALS])
def test_a_turn_about_the_centre_of_friction_is_not_stable(make_chain: ChainMaker, name: str) -> None:
    """The friction force vanishes there: nothing could be pushed."""
    chain = make_chain.boxes(1)
    center = chain.objects[0].outline_chain.mean(axis=0)
    for sense in (+1, -1):
        margin = make(chain, name).margin(twists_about(center[None], sense))
        assert margin[0] <= 0.0
