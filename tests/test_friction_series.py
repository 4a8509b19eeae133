"""Moments of polygons, the series for far centres of rotation, and the logarithm of an edge, each by another way."""

from __future__ import annotations

import math

import numpy as np
import pytest

import pushplan.core.contacts as contacts
from pushplan.mechanics.packed import WEIGHTS, complex_moments, series_coefficients
from pushplan.util.arrays import FloatArray

ORDERS = 6
NODES, PARTS = np.polynomial.legendre.leggauss(20)


def rectangle(low: tuple[float, float], high: tuple[float, float]) -> FloatArray:
    return np.array([low, (high[0], low[1]), high, (low[0], high[1])])


def grid(low: tuple[float, float], high: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """Return Gauss points z (400,), complex, of a rectangle and their weights."""
    (x, y), (w, h) = np.add(low, high) / 2.0, np.subtract(high, low) / 2.0
    z = (x + w * NODES)[:, None] + 1j * (y + h * NODES)[None, :]
    return z.ravel(), (w * h * np.outer(PARTS, PARTS)).ravel()


@pytest.mark.parametrize(("low", "high"), [((-0.3, -0.1), (0.2, 0.4)), ((1.0, 2.0), (1.5, 2.25))])
def test_moments_of_a_rectangle_are_the_integrals_of_its_monomials(
    low: tuple[float, float], high: tuple[float, float]
) -> None:
    z, weights = grid(low, high)
    found = complex_moments(rectangle(low, high), ORDERS)
    assert found.shape == (ORDERS + 1, ORDERS + 1)
    for p in range(ORDERS + 1):
        for q in range(ORDERS + 1):
            exact = (weights * z**p * z.conj() ** q).sum() if p + q <= ORDERS else 0.0
            assert found[p, q] == pytest.approx(exact, rel=1e-12, abs=1e-15)


def test_moments_of_a_polygon_are_those_of_its_parts() -> None:
    corner = np.array([[0.0, 0.0], [0.2, 0.0], [0.2, 0.1], [0.1, 0.1], [0.1, 0.3], [0.0, 0.3]])
    parts = rectangle((0.0, 0.0), (0.2, 0.1)), rectangle((0.0, 0.1), (0.1, 0.3))
    whole = sum(complex_moments(part, ORDERS) for part in parts)
    np.testing.assert_allclose(complex_moments(corner, ORDERS), whole, rtol=1e-12, atol=1e-16)


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


def test_centres_are_far_from_a_multiple_of_the_radius_on() -> None:
    for speed, radius in ((0.3, 0.1), (2.0, 5.0)):
        omega = contacts.REACH * speed / radius
        for sign in (1.0, -1.0):
            assert contacts.in_reach(speed, sign * omega * 0.999, radius)
            assert not contacts.in_reach(speed, sign * omega * 1.001, radius)
    assert not contacts.in_reach(0.0, 1.0, 0.1)
    assert not contacts.in_reach(0.0, 0.0, 0.1)
    assert contacts.REACH ** (contacts.ORDER + 1) < 1e-14


@pytest.mark.parametrize("d", [1e-3, 0.01, -0.3, 20.0])
@pytest.mark.parametrize(("s", "length"), [(-0.05, 0.1), (0.0, 0.3), (0.4, 0.01), (-2.0, 1.0), (-0.5, 0.5)])
def test_the_logarithm_of_an_edge_is_a_difference_of_inverse_hyperbolic_sines(
    d: float, s: float, length: float
) -> None:
    rho_sum = math.hypot(s, d) + math.hypot(s + length, d)
    found = contacts.edge_log(d, length, rho_sum)
    sines = math.asinh((s + length) / abs(d)) - math.asinh(s / abs(d))
    assert found == pytest.approx(d * d * sines, rel=1e-9, abs=0.0)
    assert found == pytest.approx(2.0 * d * d * math.atanh(length / rho_sum), rel=1e-9, abs=0.0)


@pytest.mark.parametrize("share", [1e-3, 0.03, 0.0999999, 0.1000001, 0.3, 0.9])
def test_the_logarithm_is_exact_for_edges_near_and_far(share: float) -> None:
    assert contacts.edge_log(0.5, share, 1.0) == pytest.approx(0.5 * math.atanh(share), rel=2e-15, abs=0.0)


def test_on_the_line_of_an_edge_the_logarithm_adds_nothing() -> None:
    for rho_sum in (1.0, 1.0 - 1e-16, 0.5):
        assert contacts.edge_log(0.0, 1.0, rho_sum) == 0.0
