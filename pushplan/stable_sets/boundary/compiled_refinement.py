"""Refined meridians of the sets whose margins are compiled."""

from __future__ import annotations

import numpy as np

from pushplan.mechanics.sphere import Meridians
from pushplan.stable_sets.boundary.margin_kernel import Packed
from pushplan.stable_sets.boundary.refined_meridians import RefinedMeridians
from pushplan.stable_sets.boundary.refinement_kernel import refined
from pushplan.stable_sets.boundary.seed_kernel import seeds

_START = np.linspace(-np.pi, np.pi, 181)
"""Meridians to begin with, 2 degrees apart."""


def refine_compiled(packed: Packed, minimum: float) -> RefinedMeridians:
    """Return where margins exceed `minimum`, as `refine_meridians` does; scratch tables in `packed` change."""
    inside, hope = seeds(packed, packed.length, minimum)
    longitude = np.unique(np.concatenate((_START, inside)))
    longitude, counts, rows = refined(packed, packed.length, minimum, longitude, hope)
    meridians = Meridians(np.repeat(longitude, counts), rows[:, 0], rows[:, 1])
    return RefinedMeridians(longitude, meridians)
