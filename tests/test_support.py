"""Supports: centres, pressures, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from pushplan.errors import SupportError
from pushplan.mechanics.support import (
    FeetSupport,
    PressureMapSupport,
    UniformSupport,
)
from pushplan.util.arrays import FloatArray

BOX = np.array([[-0.05, -0.03], [0.05, -0.03], [0.05, 0.03], [-0.05, 0.03]])


def test_affine_pressure_has_its_centre_where_asked() -> None:
    """Checked by summing p over a fine grid of the box."""
    support = UniformSupport(BOX, np.array([0.01, -0.004]))
    x, y = np.meshgrid((np.arange(200) + 0.5) / 2000 - 0.05, (np.arange(120) + 0.5) / 2000 - 0.03)
    points = np.column_stack([x.ravel(), y.ravel()])
    loads = (1.0 / support.moments.area + (points - support.moments.centroid) @ support.gradient) / 2000**2
    assert loads.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(loads @ points, [0.01, -0.004], rtol=1e-4)


def test_affine_pressure_is_refused_outside_the_middle_third() -> None:
    UniformSupport(BOX, np.array([0.1 / 6, 0.0]))
    with pytest.raises(
        SupportError, match=r"centre at \(0.02, 0\) would be negative at \(-0.05, .*-0.2 of the mean"
    ):
        UniformSupport(BOX, np.array([0.02, 0.0]))
    with pytest.raises(SupportError, match=r"would be negative at \(0.05, .*-0.2 of the mean"):
        UniformSupport(BOX, np.array([-0.02, 0.0]))


@pytest.mark.parametrize(
    ("fractions", "center", "text"),
    [
        ([0.5, 0.5, 0.5, -0.5], None, "-0.5 of point 3 must be > 0"),
        ([0.5, 0.25, 0.0, 0.25], None, "load fraction 0 of point 2 must be > 0"),
        ([0.25, 0.25, 0.25, 0.2], None, "sum to 0.95; they must sum to 1"),
        ([0.5, 0.5], None, "shape"),
        (None, None, "either"),
        ([0.25] * 4, [0.0, 0.0], "either"),
        (None, [0.06, 0.0], r"center_of_mass \(0.06, 0\) lies outside"),
    ],
)
def test_wrong_feet_are_refused(fractions: FloatArray | None, center: FloatArray | None, text: str) -> None:
    with pytest.raises(Exception, match=text) as caught:
        FeetSupport(BOX, fractions, center)
    assert type(caught.value).__module__ == "pushplan.errors"


def test_pressure_map_from_csv(tmp_path: Path) -> None:
    """Columns in any order, rows without pressure left out, pressures scaled to a sum of 1."""
    path = tmp_path / "map.csv"
    path.write_text("pressure, x, y\n300, 0, 0\n100, 0.1, 0\n\n0, 0.5, 0.5\n")
    support = PressureMapSupport.from_csv(path)
    np.testing.assert_allclose(support.fractions, [0.75, 0.25])
    np.testing.assert_allclose(support.center, [0.025, 0.0])


@pytest.mark.parametrize(
    ("text", "finding"),
    [
        ("x,y\n1,2\n", "map.csv:1: the header is 'x,y'; it must name x, y and pressure"),
        ("", "map.csv:1: the header is ''"),
        ("x,y,pressure\n0,0,1\n1,2\n", "map.csv:3: 2 cells; there must be 3"),
        ("x,y,pressure\n0,0,one\n", "map.csv:2: could not convert"),
        ("x,y,pressure\n0,0,-1\n", "map.csv:2: x, y and pressure must be finite and pressure >= 0"),
        ("x,y,pressure\n0,nan,1\n", "map.csv:2: x, y and pressure must be finite"),
        ("x,y,pressure\n0,0,0\n", "map.csv: no row has a pressure > 0"),
    ],
)
def test_wrong_pressure_maps_name_file_and_line(tmp_path: Path, text: str, finding: str) -> None:
    path = tmp_path / "map.csv"
    path.write_text(text)
    with pytest.raises(SupportError) as caught:
        PressureMapSupport.from_csv(path)
    assert finding in str(caught.value)
