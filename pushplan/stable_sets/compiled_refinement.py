"""Refined meridians of the sets whose margins are compiled."""

from __future__ import annotations

import numpy as np

from pushplan.arrays import FloatArray, IntArray
from pushplan.compiled import compiled
from pushplan.mechanics.sphere import Meridians
from pushplan.stable_sets.margin_kernel import Packed
from pushplan.stable_sets.refined_meridians import RefinedMeridians
from pushplan.stable_sets.refinement_kernel import refined
from pushplan.stable_sets.seed_kernel import seeds

_START = np.linspace(-np.pi, np.pi, 181)
"""Meridians to begin with, 2 degrees apart."""

Found = tuple[FloatArray, IntArray, FloatArray]
"""Longitudes (m,), the number of intervals (m,) on each, and these (k, 2)."""


@compiled
def _refined(packed: Packed, minimum: float) -> Found:
    inside, hope = seeds(packed, packed.length, minimum)
    longitude = np.unique(np.concatenate((_START, inside)))
    return refined(packed, packed.length, minimum, longitude, hope)


def refine_compiled(packed: Packed, minimum: float) -> RefinedMeridians:
    """Return where margins exceed `minimum`, as `refine_meridians` does; scratch tables in `packed` change."""
    longitude, counts, rows = _refined(packed, minimum)
    meridians = Meridians(np.repeat(longitude, counts), rows[:, 0], rows[:, 1])
    return RefinedMeridians(longitude, meridians)
