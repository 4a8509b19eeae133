"""Pressures that are a little off: none takes more from a row than is counted, and the worst takes about as much."""

from __future__ import annotations

import numpy as np
import pytest

from pushplan.errors import SupportError
from pushplan.mechanics.chain import PushedObject
from pushplan.mechanics.support import FeetSupport, PressureMapSupport, UniformSupport, UnknownSupport
from pushplan.mechanics.worst_case import load_cells as cells
from pushplan.mechanics.worst_case.load_cells import load_cells
from pushplan.mechanics.worst_case.pressure_error import CELLS_MISS, center, row_loss
from pushplan.util.arrays import FloatArray

LENGTH = 0.5
SQUARE = np.array([[-0.05, -0.05], [0.05, -0.05], [0.05, 0.05], [-0.05, 0.05]])
OUTLINES = {
    "box": np.array([[-0.05, -0.04], [0.05, -0.04], [0.05, 0.04], [-0.05, 0.04]]),
    "slender": np.array([[-0.5, -0.02], [0.5, -0.02], [0.5, 0.02], [-0.5, 0.02]]),
    "triangle": np.array([[0.0, 0.0], [0.3, 0.0], [0.0, 0.3]]),
    "angle": np.array([[0.0, 0.0], [0.3, 0.0], [0.3, 0.02], [0.02, 0.02], [0.02, 0.3], [0.0, 0.3]]),
}


def standing(support: UniformSupport | PressureMapSupport | FeetSupport | UnknownSupport) -> PushedObject:
    return PushedObject("box", SQUARE, 1.0, 0.3, support, np.array([0.3, 0.1, 0.4]))


def pulls_of(points: FloatArray, twist: FloatArray) -> FloatArray:
    """Return the wrenches (c, 3) that unit loads at points (c, 2) ask for, moments divided by the length."""
    u = np.stack([twist[0] - twist[2] * points[:, 1], twist[1] + twist[2] * points[:, 0]], axis=1)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    moment = (points[:, 0] * u[:, 1] - points[:, 1] * u[:, 0]) / LENGTH
    return np.column_stack([u, moment])


def counted_losses(obj: PushedObject, twist: FloatArray, rows: FloatArray) -> list[float]:
    """Return what is counted as lost of rows (j, 3), for a share of 1."""
    points, parts = load_cells(obj)
    cells, pulls = np.column_stack([points, parts]), pulls_of(points, twist)
    center(pulls, cells, 0, len(cells))
    return [row_loss(pulls, cells, 0, len(cells), gx, gy, gm, CELLS_MISS[1]) for gx, gy, gm in rows]


def worst(points: FloatArray, parts: FloatArray, twist: FloatArray, rows: FloatArray) -> FloatArray:
    """Return the largest sum p theta r over |theta| <= 1 with sum p theta = 0: by sorting, as theta is a sign."""
    values = pulls_of(points, twist) @ rows.T
    losses = []
    for r in values.T:
        order = np.argsort(r)
        before = np.cumsum(parts[order]) - parts[order]
        theta = np.clip((0.5 - before) / parts[order], 0.0, 1.0) * 2.0 - 1.0
        losses.append(-float((parts[order] * theta) @ r[order]))
    return np.array(losses)


@pytest.mark.parametrize("name", OUTLINES)
def test_no_pressure_within_the_share_takes_more_and_the_worst_takes_about_as_much(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The worst one found by sorting forty times as many cells; centres of rotation inside, near and far."""
    obj, share, rng = standing(UniformSupport(OUTLINES[name])), 0.1, np.random.default_rng(0)
    coarse, _ = load_cells(obj)
    near = coarse[rng.integers(len(coarse), size=60)] + rng.normal(size=(60, 2)) * 0.03
    cors = np.concatenate([near, rng.normal(size=(60, 2))])
    twists = np.column_stack([cors[:, 1], -cors[:, 0], np.ones(120)]) * rng.choice([-1.0, 1.0], (120, 1))
    rows = rng.normal(size=(12, 3))
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    counted = share * np.array([counted_losses(obj, twist, rows) for twist in twists])
    monkeypatch.setattr(cells, "CELLS", 3000)
    points, parts = load_cells(obj)
    exact = share * np.array([worst(points, parts, twist, rows) for twist in twists])
    assert (exact <= counted + 1e-12).all()
    far = (counted - share * 0.015)[60:] / np.maximum(exact[60:], 1e-9)
    assert np.median(far) < 1.15


def test_cells_have_the_load_and_the_centre_of_the_pressure() -> None:
    """Exactly, as every cell stands for its own centre of load; affine pressures to the size of a cell."""
    for outline in OUTLINES.values():
        points, parts = load_cells(standing(UniformSupport(outline)))
        obj = standing(UniformSupport(outline))
        assert parts.sum() == pytest.approx(1.0)
        center = np.array([np.cos(0.4), np.sin(0.4)]), np.array([-np.sin(0.4), np.cos(0.4)])
        x, y = obj.support.center
        assert parts @ points == pytest.approx(np.array([0.3, 0.1]) + x * center[0] + y * center[1])
    rng = np.random.default_rng(1)
    many = PressureMapSupport(rng.normal(size=(5000, 2)), np.full(5000, 1.0 / 5000))
    points, parts = load_cells(PushedObject("map", SQUARE, 1.0, 0.3, many, np.zeros(3)))
    assert len(parts) < 200
    assert parts @ points == pytest.approx(many.center)
    few = FeetSupport(SQUARE, np.full(4, 0.25))
    assert load_cells(PushedObject("feet", SQUARE, 1.0, 0.3, few, np.zeros(3)))[0].tolist() == SQUARE.tolist()


def test_cells_need_a_known_load() -> None:
    with pytest.raises(SupportError, match="the load under 'box' is unknown; cells of it need a known one"):
        load_cells(standing(UnknownSupport(SQUARE)))


def test_translations_lose_force_nowhere_but_for_what_cells_may_miss() -> None:
    """The floor pulls in one direction everywhere: where the load rests does not matter for the force."""
    losses = counted_losses(standing(UniformSupport(SQUARE)), np.array([1.0, 0.3, 0.0]), np.eye(3))
    assert losses[:2] == pytest.approx([0.015, 0.015])
    assert losses[2] > 0.015
