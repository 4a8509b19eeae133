"""Whether measurements say that an object has left its place in the plan."""

from __future__ import annotations

import math

import numpy as np

from pushplan.mechanics.chain import Chain
from pushplan.sim.control.measured_chain import off_places
from pushplan.sim.control.settings import ControlSettings
from pushplan.sim.control.sightings import Sightings
from pushplan.util.arrays import FloatArray

SLOW, QUICK = 4.0, 5.0
"""Standard deviations of the mean of many measurements, and of two, by which an object has to be off."""


def departure(
    sightings: Sightings, chain: Chain, around: FloatArray, since: float, settings: ControlSettings
) -> str:
    """Return which object has left its place and by how much; empty if none has.

    Half of the measurements of a look tell of a slow departure, two of a quick one.

    Args:
        sightings: What was measured.
        chain: With the objects where they are to be.
        around: (n, 3) places about which angles are taken.
        since: Measurements from this time on count, s.
        settings: See there.
    """
    for last, sigmas in ((max(2, settings.looks // 2), SLOW), (2, QUICK)):
        places = sightings.places(around, last, since)
        if places is None:
            continue
        share = sigmas / math.sqrt(last)
        distance, angle = off_places(chain, places)
        excess = np.maximum(
            distance / max(settings.position_slack, share * settings.position_noise),
            angle / max(settings.angle_slack, share * settings.angle_noise),
        )
        i = int(np.argmax(excess))
        if excess[i] > 1.0:
            off = f"{1e3 * distance[i]:.1f} mm and {math.degrees(angle[i]):.1f} deg"
            return f"{chain.objects[i].name} is {off} off its place in the plan"
    return ""
