"""Pressures that are a little off: none takes more from a row than is counted, and the worst takes about as much."""

import numpy as np
import pytest

import pushplan.core.uncertain as uncertain
from pushplan.mechanics import support as supports
from pushplan.mechanics.chain import Chain, Contact, PushedObject, Pusher
from pushplan.mechanics.intervals import IntervalChain
from pushplan.mechanics.support import (
    FeetSupport,
    PressureMapSupport,
    Support,
    UniformSupport,
)
from pushplan.mechanics.uncertain import pack_intervals
from pushplan.util.arrays import FloatArray

SHARE = 0.1
SQUARE = np.array([[-0.05, -0.05], [0.05, -0.05], [0.05, 0.05], [-0.05, 0.05]])
OUTLINES = {
    "box": np.array([[-0.05, -0.04], [0.05, -0.04], [0.05, 0.04], [-0.05, 0.04]]),
    "slender": np.array([[-0.5, -0.02], [0.5, -0.02], [0.5, 0.02], [-0.5, 0.02]]),
    "triangle": np.array([[0.0, 0.0], [0.3, 0.0], [0.0, 0.3]]),
    "angle": np.array([[0.0, 0.0], [0.3, 0.0], [0.3, 0.02], [0.02, 0.02], [0.02, 0.3], [0.0, 0.3]]),
}


def chain_on(support: Support, outline: FloatArray) -> Chain:
    """Return one object pushed by a plate somewhere; mechanics does not ask where."""
    obj = PushedObject("box", outline, 1.0, 0.3, support, np.array([0.3, 0.1, 0.4]))
    contact = Contact(np.array([0.0, -0.05]), np.array([0.0, 0.06]), 0.4, 0, -1)
    return Chain(
        (obj,), (contact,), Pusher(np.array([[-0.03, -0.1], [0.0, -0.1], [0.0, 0.1], [-0.03, 0.1]]), 0.4)
    )


def pulls_of(points: FloatArray, twist: FloatArray, length: float) -> FloatArray:
    """Return the wrenches (c, 3) that unit loads at points (c, 2) ask for, moments divided by the length."""
    u = np.stack([twist[0] - twist[2] * points[:, 1], twist[1] + twist[2] * points[:, 0]], axis=1)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    return np.column_stack([u, (points[:, 0] * u[:, 1] - points[:, 1] * u[:, 0]) / length])


def worst(pulls: FloatArray, parts: FloatArray, rows: FloatArray) -> FloatArray:
    """Return the largest sum p theta r over |theta| <= 1 with sum p theta = 0: by sorting, as theta is a sign."""
    losses = []
    for r in (pulls @ rows.T).T:
        order = np.argsort(r)
        before = np.cumsum(parts[order]) - parts[order]
        theta = np.clip((0.5 - before) / parts[order], 0.0, 1.0) * 2.0 - 1.0
        losses.append(-float((parts[order] * theta) @ r[order]))
    return np.array(losses)


@pytest.mark.parametrize("name", OUTLINES)
def test_no_pressure_within_the_share_takes_more_and_the_worst_takes_about_as_much(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The worst one found by sorting thirty times as many cells; centres of rotation inside, near and far."""
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
    assert np.median(counted[:60] / exact[:60]) < 1.12  # the others lose next to nothing


def test_cells_have_the_load_and_the_centre_of_the_pressure() -> None:
    """Exactly, as every cell stands for its own centre of load; affine pressures to the size of a cell."""
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


def test_translations_lose_force_nowhere_but_for_what_cells_may_miss() -> None:
    """The floor pulls in one direction everywhere: where the load rests does not matter for the force."""
    chain, twist = chain_on(UniformSupport(SQUARE), SQUARE), np.array([[1.0, 0.3, 0.0]])
    packed = pack_intervals(IntervalChain.from_ranges(chain, pressures={"box": SHARE}))
    known, _ = uncertain.rows_of(pack_intervals(IntervalChain.from_ranges(chain)), twist)
    loss = (known - uncertain.rows_of(packed, twist)[0])[0, 0] / chain.objects[0].friction_load
    assert loss[:2] == pytest.approx(packed.miss[0, 1], abs=1e-8)
    assert (loss[2:] > packed.miss[0, 1]).all()
