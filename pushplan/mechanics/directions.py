"""Twists that follow one another in one direction: a motion keeps its direction for most of its samples.

Margins, quasi-static wrenches and where they pass depend on a twist's direction alone, so they need to be worked out
once for all of them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pushplan.compiled import compiled
from pushplan.util.arrays import FloatArray, IntArray

SAME = 1e-12
"""Components, as shares of the largest one, of one direction differ by less.

Rounding stays below 1e-13 in blended trajectories, also where they come to rest.
"""


WORTHWHILE = 0.7
"""Share of directions among twists from which on copying takes as long as working out every one."""


def by_direction(values: Callable[[FloatArray], FloatArray], twists: FloatArray, length: float) -> FloatArray:
    """Return what `values` returns (m, ...) for twists (m, 3), asked once for neighbours of one direction.

    Args:
        values: Depends on the directions of twists only.
        twists: None of them zero.
        length: By which angular velocities are multiplied to be compared with the others, m.
    """
    owner, first = directions(twists, length)
    if len(first) > WORTHWHILE * len(twists):
        return values(twists)
    return np.asarray(values(twists[first])[owner])


@compiled
def directions(twists: FloatArray, length: float) -> tuple[IntArray, IntArray]:
    """Return the number of the direction that each twist (m, 3) has, (m,), and the first twist of each (d,)."""
    owner, first, count = np.empty(len(twists), np.int64), np.empty(len(twists), np.int64), 0
    x = y = turn = 0.0
    for i in range(len(twists)):
        vx, vy, omega = twists[i, 0], twists[i, 1], length * twists[i, 2]
        size = max(abs(vx), abs(vy), abs(omega))
        vx, vy, omega = vx / size, vy / size, omega / size
        if count == 0 or max(abs(vx - x), abs(vy - y), abs(omega - turn)) > SAME:
            x, y, turn = vx, vy, omega
            first[count] = i
            count += 1
        owner[i] = count - 1
    return owner, first[:count]
