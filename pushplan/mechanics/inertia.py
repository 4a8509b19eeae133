"""Mass properties of the objects: what Newton and Euler need of them beside the floor's friction."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pushplan.compiled import compiled
from pushplan.geometry.polygon import area_moments
from pushplan.geometry.se2 import transform_points
from pushplan.mechanics.chain import Chain, PushedObject
from pushplan.util.arrays import FloatArray, IntArray


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


def inertia_per_object(table: InertiaTable, twists: FloatArray, rates: FloatArray) -> FloatArray:
    """Return the wrench (m, n, 3) that each object's inertia asks for, about the chain frame's origin.

    By Newton and Euler (m a(c), I domega/dt + c x m a(c)) with the acceleration of the centre of mass

        a(c) = dv/dt + domega/dt J c + omega J (v + omega J c).

    Args:
        table: Mass properties.
        twists: (m, 3) body twists V in the chain frame.
        rates: (m, 3) their time derivatives dV/dt.
    """
    return _inertia_per_object(*table, twists, rates)


@compiled
def _inertia_per_object(
    mass: FloatArray, center: FloatArray, moment: FloatArray, twists: FloatArray, rates: FloatArray
) -> FloatArray:
    out = np.empty((len(twists), len(mass), 3))
    for i in range(len(twists)):
        (vx, vy, omega), (dvx, dvy, domega) = twists[i], rates[i]
        for k in range(len(mass)):
            x, y = center[k]
            fx = mass[k] * (dvx - domega * y - omega * vy - omega * omega * x)
            fy = mass[k] * (dvy + domega * x + omega * vx - omega * omega * y)
            out[i, k] = fx, fy, moment[k] * domega + x * fy - y * fx
    return out


@compiled
def sum_over_carried(per_object: FloatArray, pushers: IntArray) -> None:
    """Add to what each object has (m, n, 3) that of all objects that its contact carries.

    Args:
        per_object: Changed in place.
        pushers: (n,) the object that pushes each one, -1 for the plate.
    """
    for i in range(len(per_object)):
        for k in range(len(pushers) - 1, -1, -1):
            if pushers[k] >= 0:
                for j in range(3):
                    per_object[i, pushers[k], j] += per_object[i, k, j]
