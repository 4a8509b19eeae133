"""Colours for viser that look the same as in all other viewers.

The window's colours pass through the filmic curve of three.js (ACES, S. Hill's fit), which makes them pale: a matrix,
a quotient of quadratic polynomials for each channel, another matrix. This module inverts the curve. Lines have linear
colours; the colours of bodies depend on the lights. It does not import viser, so tests run without it.
"""

from __future__ import annotations

import numpy as np

from pushplan.drawing.palette import red_green_blue
from pushplan.util.arrays import FloatArray

LIGHT = 3.0
"""Brightness of a body's top under the window's lights, as a multiple of its colour; measured on pixels."""

EXPOSURE = 1.0 / 0.6
INTO = np.array([[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]])
OUT = np.array([[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]])
CURVE = (0.0245786, 0.000090537, 0.983729, 0.4329510, 0.238081)
"""(v^2 + a v - b) / (c v^2 + d v + e)."""


def of_line(colour: str) -> tuple[int, int, int]:
    """Return red, green and blue, 0 to 255, for a line that appears in a colour `#rrggbb`."""
    return _parts(_before_curve(colour))


def of_body(colour: str) -> tuple[int, int, int]:
    """Return red, green and blue, 0 to 255, for a body that appears in a colour `#rrggbb` from above."""
    lit = np.clip(_before_curve(colour) / LIGHT, 0.0, 1.0)
    return _parts(np.where(lit <= 0.0031308, 12.92 * lit, 1.055 * lit ** (1.0 / 2.4) - 0.055))


def _before_curve(colour: str) -> FloatArray:
    """Return the linear light (3,) that the curve maps to a colour."""
    share = np.array(red_green_blue(colour)) / 255.0
    seen = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    y, (a, b, c, d, e) = np.linalg.solve(OUT, seen), CURVE
    # (1 - c y) v^2 + (a - d y) v - (b + e y) = 0
    square, linear, rest = 1.0 - c * y, a - d * y, b + e * y
    v = (np.sqrt(linear**2 + 4.0 * square * rest) - linear) / (2.0 * square)
    return np.asarray(np.linalg.solve(INTO, v) / EXPOSURE)


def _parts(shares: FloatArray) -> tuple[int, int, int]:
    red, green, blue = (round(255.0 * float(part)) for part in np.clip(shares, 0.0, 1.0))
    return red, green, blue
