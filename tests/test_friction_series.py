"""Moments of polygons, the series for far centres of rotation, and the logarithm of an edge, each by another way."""

from __future__ import annotations

import numpy as np
import pytest

import pushplan.core.contacts as contacts
from pushplan.mechanics.packed import WEIGHTS, series_coefficients
from pushplan.util.arrays import FloatArray

NODES, PARTS = np.polynomial.legendre.leggauss(20)


def rectangle(low: tuple[float, float], high: tuple[float, float]) -> FloatArray:
    return np.array([low, (high[0], low[1]), high, (low[0], high[1])])


def grid(low: tuple[float, float], high: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """Return Gauss points z (400,), complex, of a rectangle and their weights."""
    (x, y), (w, h) = np.add(low, high) / 2.0, np.subtract(high, low) / 2.0
    z = (x + w * NODES)[:, None] + 1j * (y + h * NODES)[None, :]
    return z.ravel(), (w * h * np.outer(PARTS, PARTS)).ravel()


@pytest.mark.parametrize("far", [1.0, 0.5, 0.03, 1e-6, 0.0])
@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize(("low", "high"), [((-0.02, -0.01), (0.03, 0.04)), ((0.045, -0.001), (0.05, 0.001))])
def test_the_series_is_the_integral_of_the_direction_of_motion(
    far: float, sense: float, low: tuple[float, float], high: tuple[float, float]
) -> None:
    """For the directions v / |v| with v = v0 + i omega z, times 1, z and the products of two of z and conj z.

    A small box at the end of the radius is the worst case: every power counts in full.
    """
    z, weights = grid(low, high)
    speed, radius = 0.7, float(np.hypot(*high))
    series = series_coefficients(rectangle(low, high), radius)
    assert series.shape == (len(WEIGHTS), contacts.TERMS)
    for heading in (0.0, 0.5, 2.0, -1.2):
        v0 = speed * np.exp(1j * heading)
        spin = sense * far * contacts.REACH * speed
        velocity = v0 + 1j * spin / radius * z
        for row in range(len(WEIGHTS) - 1):
            found = contacts.series_pair(series, row, v0.real, v0.imag, spin)
            for value, (a, b) in zip(found, WEIGHTS[row : row + 2], strict=True):
                factor = z**a * z.conj() ** b
                exact = (weights * velocity / np.abs(velocity) * factor).sum()
                assert value == pytest.approx(exact, abs=8e-15 * weights.sum() * radius ** (a + b))
