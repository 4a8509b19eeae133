"""Loads, frictions and pressures within bounds: twists in the set hold for all of them."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from conftest import ChainMaker, Patch
from test_dynamics import widened

import pushplan.core.uncertain as uncertain
from pushplan.mechanics import support as supports
from pushplan.mechanics.chain import GRAVITY, Chain, Contact, PushedObject, Pusher
from pushplan.mechanics.intervals import IntervalChain
from pushplan.mechanics.support import FeetSupport, PressureMapSupport, Support, UniformSupport
from pushplan.mechanics.uncertain import pack_intervals
from pushplan.sets.named import stable_set, stable_set_over
from pushplan.util.arrays import FloatArray


def forward_twists(chain: Chain, seed: int, count: int = 300) -> FloatArray:
    spread = np.array([0.3, 0.3, 0.3 / chain.characteristic_length])
    twists = np.random.default_rng(seed).normal(size=(count, 3)) * spread + np.array([1.0, 0.0, 0.0])
    return np.asarray(twists, dtype=np.float64)


def with_loads(interval: IntervalChain, loads: FloatArray) -> Chain:
    """Return the chain with lowest contact frictions and given friction loads (n,), N."""
    objects = tuple(
        replace(obj, mass=float(load / (obj.floor_friction * GRAVITY)))
        for obj, load in zip(interval.chain.objects, loads, strict=True)
    )
    return replace(interval.chain, objects=objects)


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_the_set_is_that_of_all_vertices(make_chain: ChainMaker, n: int) -> None:
    """Exactly; the margin is not larger than that of any vertex."""
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
    """With random loads in the intervals and contact frictions above the lowest, twists in the set are stable."""
    inside = 0
    for seed in range(3):
        interval = widened(make_chain.random(seed, 3))
        twists = forward_twists(interval.chain, seed) * ([1.0, 1.0, 0.0] if name == "translation" else 1.0)
        found = stable_set_over(interval, name).contains(twists)
        rng = np.random.default_rng(seed)
        for _ in range(8):
            chain = with_loads(interval, rng.uniform(interval.loads[:, 0], interval.loads[:, 1]))
            last = replace(chain.contacts[-1], friction=chain.contacts[-1].friction * rng.uniform(1.0, 1.6))
            chain = replace(chain, contacts=(*chain.contacts[:-1], last))
            assert not (found & ~stable_set(chain, name).contains(twists)).any()
        inside += int(found.sum())
    assert inside > 50


def test_sets_over_intervals_are_nested(make_chain: ChainMaker) -> None:
    for seed in range(3):
        interval = widened(make_chain.random(seed, 3))
        twists = forward_twists(interval.chain, seed)
        stable, robust, exact = (stable_set_over(interval, s).contains(twists) for s in ("stable", "robust", "ecof"))
        assert not (stable & ~robust).any()
        assert not (robust & ~exact).any()
        assert stable.any()


def test_fractions_of_feet(make_chain: ChainMaker) -> None:
    """The set holds for random fractions in the intervals; each twist outside fails for some vertex."""
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


SHARE = 0.1
SQUARE = np.array([[-0.05, -0.05], [0.05, -0.05], [0.05, 0.05], [-0.05, 0.05]])
OUTLINES = {
    "box": np.array([[-0.05, -0.04], [0.05, -0.04], [0.05, 0.04], [-0.05, 0.04]]),
    "slender": np.array([[-0.5, -0.02], [0.5, -0.02], [0.5, 0.02], [-0.5, 0.02]]),
    "triangle": np.array([[0.0, 0.0], [0.3, 0.0], [0.0, 0.3]]),
    "angle": np.array([[0.0, 0.0], [0.3, 0.0], [0.3, 0.02], [0.02, 0.02], [0.02, 0.3], [0.0, 0.3]]),
}


def chain_on(support: Support, outline: FloatArray) -> Chain:
    """Return one object and a plate that need not touch, because mechanics does not check it."""
    obj = PushedObject("box", outline, 1.0, 0.3, support, np.array([0.3, 0.1, 0.4]))
    contact = Contact(np.array([0.0, -0.05]), np.array([0.0, 0.06]), 0.4, 0, -1)
    return Chain((obj,), (contact,), Pusher(np.array([[-0.03, -0.1], [0.0, -0.1], [0.0, 0.1], [-0.03, 0.1]]), 0.4))


def pulls_of(points: FloatArray, twist: FloatArray, length: float) -> FloatArray:
    """Return the wrenches (c, 3) for unit loads at points (c, 2), moments divided by the length."""
    u = np.stack([twist[0] - twist[2] * points[:, 1], twist[1] + twist[2] * points[:, 0]], axis=1)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    return np.column_stack([u, (points[:, 0] * u[:, 1] - points[:, 1] * u[:, 0]) / length])


def worst(pulls: FloatArray, parts: FloatArray, rows: FloatArray) -> FloatArray:
    """Return the largest sum p theta r over |theta| <= 1 with sum p theta = 0, by sorting, because theta is a
    sign.
    """
    losses = []
    for r in (pulls @ rows.T).T:
        order = np.argsort(r)
        before = np.cumsum(parts[order]) - parts[order]
        theta = np.clip((0.5 - before) / parts[order], 0.0, 1.0) * 2.0 - 1.0
        losses.append(-float((parts[order] * theta) @ r[order]))
    return np.array(losses)


@pytest.mark.parametrize("name", OUTLINES)
def test_the_worst_pressure_within_the_share_is_a_tight_bound(name: str, monkeypatch: Patch) -> None:
    """The worst pressure comes from sorting thirty times as many cells; CORs are inside, near and far."""
    chain, rng = chain_on(UniformSupport(OUTLINES[name]), OUTLINES[name]), np.random.default_rng(0)
    coarse, _ = chain.objects[0].support.cells()
    near = coarse[rng.integers(len(coarse), size=60)] + rng.normal(size=(60, 2)) * 0.03
    c, s = np.cos(0.4), np.sin(0.4)
    near = near @ np.array([[c, s], [-s, c]]) + [0.3, 0.1]
    cors = np.concatenate([near, rng.normal(size=(60, 2))])
    twists = np.column_stack([cors[:, 1], -cors[:, 0], np.ones(120)]) * rng.choice([-1.0, 1.0], (120, 1))
    load = chain.objects[0].friction_load
    known, _ = uncertain.rows_of(pack_intervals(IntervalChain.from_ranges(chain)), twists)
    packed = pack_intervals(IntervalChain.from_ranges(chain, pressures={"box": SHARE}))
    counted = (known - uncertain.rows_of(packed, twists)[0])[:, 0] / load
    monkeypatch.setattr(supports, "CELLS", 3000)
    places, parts = chain.objects[0].support.cells()
    places = places @ np.array([[c, s], [-s, c]]) + [0.3, 0.1]
    length = chain.characteristic_length
    exact = SHARE * np.array([worst(pulls_of(places, v, length), parts, packed.facets[0]) for v in twists])
    assert (exact <= counted + 1e-12).all()
    assert np.median(counted[:60] / exact[:60]) < 1.12  # the others lose almost nothing


def test_cells_have_the_load_and_the_centre_of_the_pressure() -> None:
    """Exactly, because every cell has its own centre of load; for affine pressures up to the size of a cell."""
    for outline in OUTLINES.values():
        support = UniformSupport(outline)
        points, parts = support.cells()
        assert parts.sum() == pytest.approx(1.0)
        assert parts @ points == pytest.approx(support.center)
    rng = np.random.default_rng(1)
    many = PressureMapSupport(rng.normal(size=(5000, 2)), np.full(5000, 1.0 / 5000))
    points, parts = many.cells()
    assert len(parts) < 250
    assert parts @ points == pytest.approx(many.center)
    assert FeetSupport(SQUARE, np.full(4, 0.25)).cells()[0].tolist() == SQUARE.tolist()
