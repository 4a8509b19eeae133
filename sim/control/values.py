"""Values of the estimator: their indices, names and description."""

from __future__ import annotations

import math

import numpy as np

from pushplan.util.arrays import FloatArray

START_X, START_Y, START_THETA, DELAY, ODOMETRY, DRIFT, TURNS = range(7)
"""Indices of the values that all objects share: true start of the plate, delay of measurements, errors of wheels."""
COMMON = 7
"""Number of shared values; x, y and theta of each object's measurement bias follow."""
NAMES = ("start x", "start y", "start theta", "delay", "odometry", "drift", "turns")
"""Names of the shared values."""
OWN = slice(DELAY, COMMON)
"""Values of clock and wheels, which stay the same from one push to the next."""
WHEELS = slice(ODOMETRY, COMMON)
"""Values of the wheels."""


def errors_in_words(values: FloatArray, sigma: FloatArray, prior: FloatArray) -> str:
    """Return the found errors of sensors and wheels as text, and the names of those that are not observable yet.

    Args:
        values: Values of an estimator, (COMMON + 3 n,).
        sigma: Standard deviations of the values.
        prior: Standard deviations of the values before any measurement.
    """
    found, open_yet = [], []
    far, theta = float(np.hypot(values[START_X], values[START_Y])), values[START_THETA]
    tau, s, c, w = values[OWN]
    bias = values[COMMON:].reshape(-1, 3)
    offset, turned = float(np.hypot(*bias[:, :2].T).max()), float(np.abs(bias[:, 2]).max())
    for value, k, text in (
        (far, START_X, f"plate's start {1e3 * far:.1f} mm off"),
        (abs(theta), START_THETA, f"directions {math.degrees(theta):.2f} deg off"),
        (offset, COMMON, f"camera offset {1e3 * offset:.1f} mm"),
        (turned, COMMON + 2, f"headings {math.degrees(turned):.2f} deg off"),
        (abs(tau), DELAY, f"delay {1e3 * tau:.0f} ms"),
        (abs(s), ODOMETRY, f"odometry {100 * abs(s):.1f} % {'short' if s > 0 else 'long'}"),
        (abs(c), DRIFT, f"drift aside {100 * abs(c):.1f} %"),
        (abs(w), TURNS, f"turns {100 * abs(w):.1f} % {'short' if w > 0 else 'long'}"),
    ):
        if value > 4.0 * sigma[k] and value > 0.2 * prior[k]:
            found.append(text)
        elif sigma[k] > 0.8 * prior[k] and value < prior[k]:
            open_yet.append(text.split(" ")[0])
    errors = ", ".join(found)
    return errors + (f"; not observable yet: {', '.join(open_yet)}" if found and open_yet else "")
