"""Best costs at regular times, as OMPL's benchmarks take them: Planner Arena smooths over them.

Improvements alone, most of them in the first moments, are too close to one another for that.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

SAMPLES = 100
"""Times in each run, the last one at its end."""

Point = tuple[float, float, int]
"""Seconds, best cost and iterations."""


def sampled(improvements: Sequence[Point], end: float) -> list[Point]:
    """Return what was best at `SAMPLES` regular times of a search that took `end` seconds, from its first path on."""
    if not improvements:
        return []
    moments = [point[0] for point in improvements]
    end = max(end, moments[-1])
    times = {end * (i + 1) / SAMPLES for i in range(SAMPLES)}
    known = ((time, bisect_right(moments, time)) for time in sorted(times))
    return [(time, *improvements[count - 1][1:]) for time, count in known if count]
