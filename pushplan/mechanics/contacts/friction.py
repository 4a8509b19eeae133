"""Floor friction of one object: its wrench, its effective centre (ECOF) and its centre (COF)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pushplan.errors import UndefinedEcofError
from pushplan.geometry.se2 import transform_points
from pushplan.mechanics.chain import PushedObject
from pushplan.mechanics.contacts.contact_kernel import object_wrenches_of
from pushplan.mechanics.friction.packed import pack_object
from pushplan.mechanics.sphere import checked_twists, twists_about
from pushplan.util.arrays import FloatArray, frozen


def friction_wrench(obj: PushedObject, twists: ArrayLike, contact_height: float = 0.0) -> FloatArray:
    """Return the wrench (k, 3) of the floor friction on an object about the chain frame's origin: N, N, N m.

    Args:
        obj: The object; its load must be known.
        twists: (k, 3) body twists in the chain frame; only their directions matter.
        contact_height: Height of the contact forces above the floor, m; shifts the load.

    Raises:
        PushplanError: On twists that are zero, not finite or not (k, 3).
        SupportError: When the load is not known, or the push at that height could lift a part of the object.
    """
    packed = pack_object(obj, contact_height)
    return -object_wrenches_of(packed, checked_twists(twists))


def ecof(obj: PushedObject, cor: ArrayLike, sense: int = +1, contact_height: float = 0.0) -> FloatArray:
    """Return the effective centre of friction (2,): the point of friction's line of action nearest the COR.

    `ECOF - c = m_c (f_y, -f_x) / |f|^2` with the wrench (f, m_c) about the COR c (Harada et al. 2006,
    appendix).

    Args:
        obj: The object; its load must be known.
        cor: (2,) centre of rotation in the chain frame, m.
        sense: +1 or -1; matters only when a push height shifts the load.
        contact_height: See `friction_wrench`.

    Raises:
        UndefinedEcofError: When the friction force vanishes, as for a COR at the COF of a symmetric load.
        SupportError: As `friction_wrench`.
    """
    c = frozen(cor, (2,), "centre of rotation")
    fx, fy, moment = friction_wrench(obj, twists_about(c, sense)[None], contact_height)[0]
    about_cor = moment - (c[0] * fy - c[1] * fx)
    if np.hypot(fx, fy) <= 1e-12 * obj.friction_load:
        raise UndefinedEcofError(
            f"the friction force on {obj.name!r} vanishes for a rotation about ({c[0]:.6g}, {c[1]:.6g}), "
            f"so that it has no line of action; its COF is at ({cof(obj)[0]:.6g}, {cof(obj)[1]:.6g})"
        )
    return np.asarray(c + about_cor * np.array([fy, -fx]) / (fx * fx + fy * fy), dtype=np.float64)


def cof(obj: PushedObject) -> FloatArray:
    """Return the centre of friction (2,) in the chain frame, m; mu is even, so the centre of pressure."""
    return transform_points(obj.pose_chain, obj.support.center)
