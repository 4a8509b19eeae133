"""What an estimator finds out: which of its values is which, and words for them."""

from __future__ import annotations

import math

import numpy as np

from pushplan.util.arrays import FloatArray

START_X, START_Y, START_THETA, DELAY, ODOMETRY, DRIFT, TURNS = range(7)
"""What all objects share: where the plate really started, how late measurements are, and what wheels err by."""
COMMON = 7
"""Number of these; x, y and theta of what is measured of each object follow."""
NAMES = ("start x", "start y", "start theta", "delay", "odometry", "drift", "turns")
"""Of these."""
OWN = slice(DELAY, COMMON)
"""Those of clock and wheels, which stay the same from one push to the next."""
WHEELS = slice(ODOMETRY, COMMON)
"""Those of the wheels."""


def errors_in_words(values: FloatArray, sigma: FloatArray, prior: FloatArray) -> str:
    """Return what errors of sensors and wheels were found, and what is not observable yet.

    Args:
        values: (COMMON + 3 n,) of an estimator.
        sigma: Their standard deviations.
        prior: Likewise, before anything was measured.
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
    told = ", ".join(found)
    return told + (f"; not observable yet: {', '.join(open_yet)}" if found and open_yet else "")
