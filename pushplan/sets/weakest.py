"""Which contact keeps a set of pushes from being stable, in words."""

from __future__ import annotations

import numpy as np

from pushplan.mechanics.chain import PLATE, Chain
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray

HELP = "more friction there, a wider contact, or fewer objects"
"""What helps a contact that does not hold."""


def weakest_contact(stable: StableSet, twist: FloatArray) -> int:
    """Return the contact that holds least well under a body twist (3,)."""
    return int(np.argmin(stable.contact_margins(twist[None])[0]))


def contact_words(chain: Chain, index: int) -> str:
    """Return what messages call the two bodies of a contact."""
    contact = chain.contacts[index]
    pushed = f"'{chain.objects[contact.pushed].name}'"
    where = "the plate" if contact.pusher == PLATE else f"'{chain.objects[contact.pusher].name}'"
    return f"{pushed} on {where}"


def emptiness(stable: StableSet, minimum: float) -> tuple[str, int | None]:
    """Tell why no push has a margin above a minimum.

    Returns:
        The sentence, empty if some push has; and the contact that does not hold, None where all hold by too little.
    """
    twists, margins = stable.peaks
    best = float(margins.max(initial=-1.0))
    if best > minimum:
        return "", None
    if best > 0.0:
        return (
            f"no push has a margin above {minimum:.3g}; the largest is {best:.3g}; allowed: less than that",
            None,
        )
    at_best = f" (the best misses by a margin of {-best:.3g})" if len(margins) else ""
    weakest = weakest_contact(stable, twists[margins.argmax()]) if len(margins) else 0
    names = contact_words(stable.chain, weakest)
    what = f"the stable set is empty: no push keeps {names} together with the rest{at_best}"
    return f"{what}; allowed: {HELP}", weakest
