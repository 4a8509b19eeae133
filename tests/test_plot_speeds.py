"""The picture of admissible speeds: what limits them, in every format, the same bytes each time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from pushplan.drawing.format import PlotError
from pushplan.drawing.speeds import limiting_rows, plot_admissible_speeds
from pushplan.mechanics.chain import GRAVITY
from pushplan.mechanics.dynamics.admissible_speeds import SpeedWindow, admissible_speeds

if TYPE_CHECKING:
    from conftest import ChainMaker


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
@pytest.mark.parametrize("twist", [(1.0, 0.0, 0.0), (0.9, 0.0, 1.0), (-1.0, 0.0, 0.0)])
def test_it_is_drawn_twice_alike(
    make_chain: ChainMaker, tmp_path: Path, suffix: str, twist: tuple[float, float, float]
) -> None:
    chain = make_chain.boxes(2)
    speeds = admissible_speeds(chain, twist, SpeedWindow(1.0, 2.0))
    files = [tmp_path / f"{i}{suffix}" for i in range(2)]
    for file in files:
        plot_admissible_speeds(chain, speeds, file)
    assert files[0].read_bytes() == files[1].read_bytes()
    assert files[0].stat().st_size > 2000


def test_the_limits_named_are_those_that_bound(make_chain: ChainMaker) -> None:
    """A row that is left out does not change the polygon; one that is named does."""
    chain = make_chain.boxes(3)
    speeds = admissible_speeds(chain, (0.9, -0.02, 0.8), SpeedWindow(4.0, 20.0))
    named = limiting_rows(speeds)
    assert named
    u = np.random.default_rng(1).uniform([0.0, -20.0], [4.0, 20.0], (20000, 2))
    rows = speeds.rows
    values = rows.alpha[..., None] + rows.gamma[..., None] * u[:, 0] + rows.beta[..., None] * u[:, 1]
    inside = (values > 0.0).all(axis=(0, 1))
    only = np.ones_like(inside)
    for k, j in named:
        only &= values[k, j] > 0.0
    np.testing.assert_array_equal(inside, only)
    for k, j in named:
        others = np.delete(values.reshape(-1, len(u)), 4 * k + j, axis=0)
        corners = speeds.vertices
        at = rows.alpha[k, j] + rows.gamma[k, j] * corners[:, 0] + rows.beta[k, j] * corners[:, 1]
        assert np.sum(np.abs(at) < 1e-9) >= 2
        assert others.shape[0] == 11


def test_a_straight_push_is_limited_by_every_object_that_could_fly_ahead(make_chain: ChainMaker) -> None:
    speeds = admissible_speeds(make_chain.boxes(2), (1.0, 0.0, 0.0), SpeedWindow(1.0, 5.0))
    assert {k for k, _ in limiting_rows(speeds)} == {0, 1}
    assert speeds.vertices[:, 1].min() == pytest.approx(-0.3 * GRAVITY)


def test_only_pictures_are_written(make_chain: ChainMaker, tmp_path: Path) -> None:
    chain = make_chain.boxes(1)
    with pytest.raises(PlotError, match="a picture ends in"):
        plot_admissible_speeds(chain, admissible_speeds(chain, (1.0, 0.0, 0.0)), tmp_path / "a.txt")
