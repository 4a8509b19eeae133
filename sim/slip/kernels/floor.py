"""Floor friction of every object as the gradient of a dissipation, with its secant and its curvature.

    D(U) = sum_j mu N_j r_j,   r_j = sqrt(|v_j|^2 + eps^2),   v_j = J_j U = (v_x - w y_j, v_y + w x_j)
    g = sum (mu N / r) J^T v = K U,   K = sum (mu N / r) J^T J,   H = K - sum (mu N / r^3) (J^T v) (J^T v)^T

K is at least H everywhere, so a step with K never makes D larger (majorise and minimise).
"""

from __future__ import annotations

import math

from pushplan.compiled import inner
from pushplan.sim.slip.kernels.packed import PackedWorld, Work
from pushplan.util.arrays import FloatArray


@inner
def floor_terms(packed: PackedWorld, work: Work, eps: float) -> None:
    """Fill gradient, secant and curvature at the twists U."""
    for i in range(len(packed.loads)):
        _terms_of(
            work.feet,
            packed.first_foot[i],
            packed.first_foot[i + 1],
            work.twists[i],
            eps,
            work.gradient[i],
            work.secant[i],
            work.curvature[i],
        )


@inner
def _terms_of(
    feet: FloatArray,
    first: int,
    last: int,
    twist: FloatArray,
    eps: float,
    g: FloatArray,
    secant: FloatArray,
    curvature: FloatArray,
) -> None:
    vx, vy, w = twist[0], twist[1], twist[2]
    kxx = kxw = kyw = kww = 0.0
    hxx = hxy = hxw = hyy = hyw = hww = 0.0
    for j in range(first, last):
        x, y = feet[j, 0], feet[j, 1]
        ux, uy = vx - w * y, vy + w * x
        # 1 / r, and c = mu N / r.
        inverse = 1.0 / math.sqrt(ux * ux + uy * uy + eps * eps)
        c = feet[j, 2] * inverse
        kxx += c
        kxw -= c * y
        kyw += c * x
        kww += c * (x * x + y * y)
        ux, uy = ux * inverse, uy * inverse
        # Last component of J^T v / r.
        turning = x * uy - y * ux
        hxx += c * ux * ux
        hxy += c * ux * uy
        hxw += c * ux * turning
        hyy += c * uy * uy
        hyw += c * uy * turning
        hww += c * turning * turning
    g[0], g[1] = kxx * vx + kxw * w, kxx * vy + kyw * w
    g[2] = kxw * vx + kyw * vy + kww * w
    secant[0], secant[1], secant[2], secant[3], secant[4], secant[5] = kxx, 0.0, kxw, kxx, kyw, kww
    curvature[0], curvature[1], curvature[2] = kxx - hxx, -hxy, kxw - hxw
    curvature[3], curvature[4], curvature[5] = kxx - hyy, kyw - hyw, kww - hww


@inner
def invert_symmetric(a: FloatArray, out: FloatArray) -> None:
    """Fill `out` (6,) with the inverse of a positive definite matrix (6,), as xx, xy, xw, yy, yw, ww."""
    xx, xy, xw, yy, yw, ww = a[0], a[1], a[2], a[3], a[4], a[5]
    cxx, cxy, cxw = yy * ww - yw * yw, xw * yw - xy * ww, xy * yw - xw * yy
    scale = 1.0 / (xx * cxx + xy * cxy + xw * cxw)
    out[0], out[1], out[2] = cxx * scale, cxy * scale, cxw * scale
    out[3] = (xx * ww - xw * xw) * scale
    out[4] = (xy * xw - xx * yw) * scale
    out[5] = (xx * yy - xy * xy) * scale
