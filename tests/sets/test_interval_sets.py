"""Loads and frictions known only as intervals: the vertices decide, and nothing in between is missed."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from conftest import ChainMaker

from pushplan.errors import ChainError, PushplanError, SupportError
from pushplan.mechanics.chain import GRAVITY, Chain
from pushplan.mechanics.intervals import IntervalChain
from pushplan.mechanics.support import FeetSupport, UnknownSupport
from pushplan.sets.interval_set import stable_set_over
from pushplan.sets.named import stable_set
from pushplan.util.arrays import FloatArray


def forward_twists(chain: Chain, seed: int, count: int = 300) -> FloatArray:
    spread = np.array([0.3, 0.3, 0.3 / chain.characteristic_length])
    twists = np.random.default_rng(seed).normal(size=(count, 3)) * spread + np.array([1.0, 0.0, 0.0])
    return np.asarray(twists, dtype=np.float64)


def widened(chain: Chain) -> IntervalChain:
    """Return the chain with wide intervals of masses, floor frictions and contact frictions."""
    return IntervalChain.from_ranges(
        chain,
        mass={obj.name: (0.6 * obj.mass, 1.5 * obj.mass) for obj in chain.objects},
        floor_friction={chain.objects[0].name: (0.1, 0.5)},
        contact_friction={chain.objects[-1].name: (0.25, 0.9)},
    )


def with_loads(interval: IntervalChain, loads: FloatArray) -> Chain:
    """Return the chain with lowest contact frictions and given friction loads (n,), N."""
    objects = tuple(
        replace(obj, mass=float(load / (obj.floor_friction * GRAVITY)))
        for obj, load in zip(interval.chain.objects, loads, strict=True)
    )
    return replace(interval.chain, objects=objects)


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_the_set_is_that_of_all_vertices(make_chain: ChainMaker, n: int) -> None:
    """Exactly; and its margin is no larger than that of any vertex."""
    for seed in range(4):
        interval = widened(make_chain.random(seed, n, tree=seed == 3, feet=seed == 1))
        twists = forward_twists(interval.chain, seed)
        margin = stable_set_over(interval).margin(twists)
        vertices = [np.array(v) for v in itertools.product(*interval.loads)]
        least = np.min([stable_set(with_loads(interval, v)).margin(twists) for v in vertices], axis=0)
        assert ((margin > 0.0) == (least > 0.0)).all()
        assert (margin <= least + 1e-12)[margin > 0.0].all()


@pytest.mark.parametrize("name", ["ecof", "translation", "stable", "robust"])
def test_nothing_between_the_vertices_is_missed(make_chain: ChainMaker, name: str) -> None:
    """Random loads in the intervals, contact frictions above the lowest: what is in the set is stable for them."""
    inside = 0
    for seed in range(3):
        interval = widened(make_chain.random(seed, 3))
        twists = forward_twists(interval.chain, seed) * ([1.0, 1.0, 0.0] if name == "translation" else 1.0)
        found = stable_set_over(interval, name).contains(twists)
        rng = np.random.default_rng(seed)
        for _ in range(8):
            chain = with_loads(interval, rng.uniform(interval.loads[:, 0], interval.loads[:, 1]))
            last = replace(chain.contacts[-1], friction=float(rng.uniform(0.25, 0.9)))
            chain = replace(chain, contacts=(*chain.contacts[:-1], last))
            assert not (found & ~stable_set(chain, name).contains(twists)).any()
        inside += int(found.sum())
    assert inside > 50


def test_sets_over_intervals_are_nested(make_chain: ChainMaker) -> None:
    for seed in range(3):
        interval = widened(make_chain.random(seed, 3))
        twists = forward_twists(interval.chain, seed)
        stable, robust, exact = (
            stable_set_over(interval, s).contains(twists) for s in ("stable", "robust", "ecof")
        )
        assert not (stable & ~robust).any()
        assert not (robust & ~exact).any()
        assert stable.any()


def test_fractions_of_feet(make_chain: ChainMaker) -> None:
    """The set holds for random fractions in the intervals; each point outside fails for some vertex."""
    feet = np.array([[-0.04, -0.04], [0.05, -0.03], [0.04, 0.04], [-0.03, 0.05]])
    chain = make_chain.boxes(2, support=lambda _: FeetSupport(feet, np.full(4, 0.25)))
    spans = [(0.1, 0.4), (0.2, 0.35), (0.1, 0.3), (0.15, 0.5)]
    interval = IntervalChain.from_ranges(chain, fractions={"box1": spans})
    twists = forward_twists(chain, 1, 400)
    found = stable_set_over(interval).contains(twists)
    ends = np.array(spans)
    vertices = []
    for free in range(4):
        for choice in itertools.product((0, 1), repeat=3):
            fractions = np.insert(np.delete(ends, free, axis=0)[range(3), choice], free, 0.0)
            fractions[free] = 1.0 - fractions.sum()
            if ends[free, 0] <= fractions[free] <= ends[free, 1]:
                vertices.append(fractions)
    margins = [stable_set(on_feet(chain, feet, v)).margin(twists) for v in vertices]
    assert len(vertices) > 4
    assert (found == (np.min(margins, axis=0) > 0.0)).all()
    mixed = np.random.default_rng(0).dirichlet(np.ones(len(vertices)), size=10) @ np.array(vertices)
    for fractions in mixed:
        assert not (found & ~stable_set(on_feet(chain, feet, fractions)).contains(twists)).any()
    assert found.sum() > 50


def on_feet(chain: Chain, feet: FloatArray, fractions: FloatArray) -> Chain:
    standing = replace(chain.objects[1], support=FeetSupport(feet, fractions))
    return replace(chain, objects=(chain.objects[0], standing))


def test_heights_need_floor_friction_as_a_number(make_chain: ChainMaker) -> None:
    chain = make_chain.boxes(2, contact_height=0.01)
    interval = IntervalChain.from_ranges(chain, floor_friction={"box1": (0.2, 0.3)})
    for name in ("ecof", "robust"):
        with pytest.raises(SupportError, match="shifts the load of 'box1' by its floor friction"):
            stable_set_over(interval, name)
    masses = IntervalChain.from_ranges(chain, mass={"box1": (0.5, 1.5)})
    assert stable_set_over(masses, "ecof").contains([[1.0, 0.0, 0.0]]).all()
    for name in ("stable", "translation"):
        assert stable_set_over(interval, name).contains([[1.0, 0.0, 0.0]]).all()
        assert stable_set_over(interval, name).margin([[1.0, 0.0, 0.0]]) > 0.0


def test_wrong_intervals_are_refused(make_chain: ChainMaker) -> None:
    chain = make_chain.boxes(2)
    with pytest.raises(ChainError, match="no object is called 'bux'; there are box0, box1"):
        IntervalChain.from_ranges(chain, mass={"bux": (1.0, 2.0)})
    with pytest.raises(PushplanError, match=r"mass of 'box0' is the interval \(2, 1\); .* 0 < low <= high"):
        IntervalChain.from_ranges(chain, mass={"box0": (2.0, 1.0)})
    with pytest.raises(PushplanError, match=r"mass of 'box0' is the interval \(0, 1\)"):
        IntervalChain.from_ranges(chain, mass={"box0": (0.0, 1.0)})
    with pytest.raises(PushplanError, match=r"contact friction of 'box1' is the interval \(-0.1, 1\)"):
        IntervalChain.from_ranges(chain, contact_friction={"box1": (-0.1, 1.0)})
    with pytest.raises(
        PushplanError, match=r"floor friction of 'box1' is the interval \(0, inf\); it must be finite"
    ):
        IntervalChain.from_ranges(chain, floor_friction={"box1": (0.0, np.inf)})
    with pytest.raises(SupportError, match="'box0' does not stand on feet"):
        IntervalChain.from_ranges(chain, fractions={"box0": [(0.0, 1.0)]})
    with pytest.raises(PushplanError, match="the stable set 'ecoff' is not known for intervals"):
        stable_set_over(IntervalChain.from_ranges(chain), "ecoff")
    with pytest.raises(SupportError, match="the load under 'box0' is unknown"):
        stable_set_over(IntervalChain.from_ranges(make_chain.boxes(1, support=UnknownSupport)))


def test_wrong_fractions_are_refused(make_chain: ChainMaker) -> None:
    feet = np.array([[-0.04, 0.0], [0.04, 0.03], [0.04, -0.03]])
    chain = make_chain.boxes(1, support=lambda _: FeetSupport(feet, np.full(3, 1.0 / 3.0)))
    with pytest.raises(SupportError, match="'box0' has 3 feet, but 2 intervals"):
        IntervalChain.from_ranges(chain, fractions={"box0": [(0.0, 1.0)] * 2})
    with pytest.raises(SupportError, match=r"sum to between 0\.3 and 0\.6; 1 must be possible"):
        IntervalChain.from_ranges(chain, fractions={"box0": [(0.1, 0.2)] * 3})
    interval = IntervalChain.from_ranges(chain, fractions={"box0": [(0.2, 0.5)] * 3})
    with pytest.raises(SupportError, match="leave open for 'box0'"):
        stable_set_over(interval, "stable")
