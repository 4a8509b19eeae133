"""The margin that a plan keeps: what `stability.margin: auto` means, and what is tried where that is too much."""

from __future__ import annotations

import numpy as np

from pushplan.mechanics.chain import Drive
from pushplan.mechanics.sphere import twists_at
from pushplan.planners.problem.controls import drive_twists
from pushplan.scenario.model import Scenario
from pushplan.sets.boundary.peaks import margin_peaks
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray
from pushplan.util.names import AUTO

MOST_MARGIN = 0.05
"""What `auto` asks for where the chain can have it.

With it 89 % of plans survive nine perturbations (frictions, loads, places), without it 39 %, for 0.4 % more way.
"""

MARGIN_SHARE = 0.5
"""What `auto` asks for at most, as a share of the largest margin there is."""

HALVINGS = 5
"""So many times a margin is halved where no path is found with it."""


BELOW = 0.05
"""So much lower than the best twist that was looked at may be where the climb to the largest margin begins.

Over 134 random chains of up to 20 boxes a bound of 0.02 lost nothing either; half of the time is saved.
"""


def margins_to_try(scenario: Scenario, stable: StableSet) -> tuple[float, ...]:
    """Return the margins to plan with, one after the other until there is a path; a stated number is the only one."""
    stated = scenario.stability.margin
    if stated != AUTO:
        return (stated,)
    most = automatic_margin(stable, scenario.chain.pusher.drive)
    return tuple(most * 0.5**k for k in range(HALVINGS + 1))


def automatic_margin(stable: StableSet, drive: Drive) -> float:
    """Return the smaller of `MOST_MARGIN` and `MARGIN_SHARE` of the largest there is; 0 where nothing is stable."""
    return min(MOST_MARGIN, MARGIN_SHARE * _best_margin(stable, drive, MOST_MARGIN / MARGIN_SHARE))


def _best_margin(stable: StableSet, drive: Drive, enough: float) -> float:
    """Return the largest margin, or one that is at least `enough`."""
    found = float(stable.margin(most_stable_twist(stable, drive)[None])[0])
    if drive.axle is not None:
        return max(0.0, found)
    return found if found >= enough else max(found, _highest_peak(stable, found - BELOW))


def _highest_peak(stable: StableSet, least: float) -> float:
    """Return the largest margin, 0 where nothing is stable, climbing from samples with more than `least` only."""

    def margin(twists: FloatArray, floor: float) -> FloatArray:
        floor = max(floor, least)
        found = stable.margin_values(twists, floor)
        return np.where(found > floor, found, -1.0)

    return float(margin_peaks(margin, stable.chain.characteristic_length)[1].max(initial=0.0))


def most_stable_twist(stable: StableSet, drive: Drive) -> FloatArray:
    """Return the twist (3,) with the largest margin of those that are looked at, which the drive can make."""
    if drive.axle is not None:
        twists = drive_twists(stable, drive)
    else:
        # Forward pushes: a contact cannot pull.
        longitudes, latitudes = (np.linspace(-0.5, 0.5, count + 2)[1:-1] * np.pi for count in (48, 25))
        length = stable.chain.characteristic_length
        twists = twists_at(longitudes[:, None], latitudes[None, :], length).reshape(-1, 3)
    return np.asarray(twists[np.argmax(stable.margin(twists))])
