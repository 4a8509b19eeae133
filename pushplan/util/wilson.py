"""The interval in which a rate of success lies, from how often it succeeded."""

from __future__ import annotations

from math import nan, sqrt

Z95 = 1.959963984540054
"""Standard deviations on either side that hold 95 % of a normal distribution."""


def wilson(successes: int, count: int) -> tuple[float, float]:
    """Return Wilson's 95 % score interval of a share: in doubt even when all of few succeed (Wilson 1927)."""
    if count == 0:
        return nan, nan
    share, z2 = successes / count, Z95 * Z95 / count
    middle = (share + 0.5 * z2) / (1.0 + z2)
    half = Z95 * sqrt(share * (1.0 - share) / count + 0.25 * z2 / count) / (1.0 + z2)
    return max(0.0, middle - half), min(1.0, middle + half)
