"""Mass properties of the objects: what Newton and Euler need of them beside the floor's friction."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pushplan.geometry.polygon import area_moments
from pushplan.geometry.se2 import transform_points
from pushplan.mechanics.chain import Chain, PushedObject
from pushplan.util.arrays import FloatArray


class Inertia(NamedTuple):
    """Mass (kg), centre of mass (2,) in the chain frame (m) and moment of inertia about it (kg m^2)."""

    mass: float
    center: FloatArray
    moment: float


def inertia_of(obj: PushedObject) -> Inertia:
    """Return the mass properties of an object of even density over its outline.

    The centre of mass is the centre of the load at rest. Where a support model puts it off the outline's
    centroid, the moment of inertia is that of the outline shifted to this centre.
    """
    moments = area_moments(obj.outline)
    center = transform_points(obj.pose_chain, obj.support.center)
    return Inertia(obj.mass, center, obj.mass * float(np.trace(moments.second)) / moments.area)


class InertiaTable(NamedTuple):
    """The objects of a chain: masses (n,), centres (n, 2) in the chain frame, moments of inertia (n,)."""

    mass: FloatArray
    center: FloatArray
    moment: FloatArray


def inertia_table(chain: Chain) -> InertiaTable:
    """Return the mass properties of all objects of a chain."""
    parts = [inertia_of(obj) for obj in chain.objects]
    return InertiaTable(
        np.array([part.mass for part in parts]),
        np.array([part.center for part in parts]),
        np.array([part.moment for part in parts]),
    )
