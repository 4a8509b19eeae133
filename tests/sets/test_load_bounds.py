"""The quick bounds of what any pressure does, against random pressures."""

from __future__ import annotations

import numpy as np
import pytest

from pushplan.mechanics.worst_case.area_table import pack_area, table_rows
from pushplan.mechanics.worst_case.load_area import LoadArea
from pushplan.mechanics.worst_case.robust_kernel import PackedAreas, central_loads
from pushplan.util.arrays import FloatArray


def packed(area: LoadArea) -> PackedAreas:
    """Return one object without contacts."""
    tables = pack_area(area, table_rows(area))[None]
    return PackedAreas(tables, np.ones((1, 2)), np.ones((1, 1), dtype=np.bool_), np.zeros((1, 4, 3)), 1.0)


def bounds_of(area: LoadArea, twist: FloatArray) -> FloatArray:
    """Return u, g x u, a, b, M_0, M_1 of `central_loads`."""
    out = np.empty((1, 7))
    central_loads(packed(area), twist[0], twist[1], twist[2], out)
    return np.asarray(out[0])


@pytest.mark.parametrize("high", [False, True])
def test_every_pressure_keeps_the_bounds(high: bool) -> None:
    """f = (1 - A) u + B J u and m = s M about the centre; some pressures come near every bound."""
    rng, closest = np.random.default_rng(0), np.full(4, np.inf)
    for _ in range(4000):
        points = rng.normal(size=(int(rng.integers(2, 5)), 2))
        fractions = rng.dirichlet(np.ones(len(points)))
        cor = rng.normal(size=2) * rng.choice([0.5, 2.0, 10.0])
        sense = rng.choice([-1.0, 1.0])
        twist = np.array([cor[1], -cor[0], 1.0]) * sense / max(1.0, float(np.abs(cor).max()))
        v = twist[:2] + twist[2] * np.stack([-points[:, 1], points[:, 0]], axis=1)
        u = v / np.linalg.norm(v, axis=1, keepdims=True)
        shift = float(rng.uniform(0.0, 0.5)) if high else 0.0
        center = fractions @ (points - shift * u)
        ux, uy, moment, a, b, low, rise = bounds_of(LoadArea(points, False, center, shift), twist)
        force = fractions @ u
        turned = sense * (fractions @ ((points - center)[:, 0] * u[:, 1] - (points - center)[:, 1] * u[:, 0]))
        slowed, aside = 1.0 - force @ [ux, uy], abs(force @ [-uy, ux])
        assert moment == pytest.approx(center[0] * uy - center[1] * ux)
        room = np.array([slowed, a - slowed, b - aside, rise - turned])
        assert (room > -1e-12).all()
        assert turned - low > -1e-12
        closest = np.minimum(closest, room[:4] / [1.0, a, b, rise])
    assert (closest < [0.001, 0.4, 0.4, 0.2]).all()


def test_translations_leave_no_room() -> None:
    area = LoadArea(np.array([[1.0, 0.0], [0.0, 2.0], [-1.0, -1.0]]), True, np.array([0.1, 0.2]), 0.05)
    np.testing.assert_allclose(
        bounds_of(area, np.array([0.6, 0.8, 0.0])), [0.6, 0.8, -0.04, 0.0, 0.0, 0.0, 0.0]
    )


def test_a_turn_about_the_centre_leaves_all_room() -> None:
    area = LoadArea(np.array([[1.0, 0.0], [0.0, 2.0], [-1.0, -1.0]]), True, np.zeros(2), 0.0)
    assert bounds_of(area, np.array([0.0, 0.0, 1.0])).tolist() == [1.0, 0.0, 0.0, 2.0, 1.0, -2.0, 2.0]
