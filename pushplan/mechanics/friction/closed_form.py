"""Closed-form friction of a polygon that turns about a point: uniform and affine pressure.

With r = x - c for the COR c, and for every edge of the counter-clockwise polygon its outward unit normal n,
unit tangent t, signed distance d = n . r and coordinate s = t . r, the divergence theorem and the rule for
homogeneous functions turn the area integrals into edge integrals of rho = sqrt(s^2 + d^2):

    integral of r / |r|     = sum n I,                 I = 1/2 [s rho] + 1/2 d^2 Lambda
    integral of |r|         = 1/3 sum d I
    integral of r r^T / |r| = 1/3 sum d (d^2 Lambda n n^T + d [rho] (n t^T + t n^T) + (I - d^2 Lambda) t t^T)
    integral of |r| r       = 1/4 sum d (d I n + 1/3 [rho^3] t)

Lambda = [asinh(s / |d|)] = log((rho_1 + rho_2 + l) / (rho_1 + rho_2 - l)) on an edge of length l.
"""

from __future__ import annotations

import math

from pushplan.compiled import no_refcount
from pushplan.util.arrays import FloatArray

EDGE_COLUMNS = 5
"""Columns of an edge: t_x, t_y, n . p, t . p and length, p being its first vertex about the anchor point."""


@no_refcount
def edge_log(d: float, length: float, rho_sum: float) -> float:
    """Return d^2 Lambda, 0 on the line of the edge; no cancellation for edges that are far away."""
    gap = rho_sum - length
    if gap <= 0.0:
        return 0.0
    q = length / rho_sum
    if q < 0.1:
        q2 = q * q
        tail = q2 * (1 / 7 + q2 * (1 / 9 + q2 * (1 / 11 + q2 * (1 / 13 + q2 / 15))))
        return d * d * 2.0 * q * (1.0 + q2 * (1 / 3 + q2 * (1 / 5 + tail)))
    return d * d * math.log((rho_sum + length) / gap)


@no_refcount
def uniform_integrals(
    edges: FloatArray, start: int, stop: int, cx: float, cy: float
) -> tuple[float, float, float]:
    """Return the integrals of r / |r| (two numbers) and of |r| over a polygon."""
    gx = gy = q = 0.0
    d = edges[start, 2] - (edges[start, 1] * cx - edges[start, 0] * cy)
    s = edges[start, 3] - (edges[start, 0] * cx + edges[start, 1] * cy)
    rho = math.sqrt(s * s + d * d)
    for e in range(start, stop):
        tx, ty, length = edges[e, 0], edges[e, 1], edges[e, 4]
        d = edges[e, 2] - (ty * cx - tx * cy)
        s = edges[e, 3] - (tx * cx + ty * cy)
        end = s + length
        rho_end = math.sqrt(end * end + d * d)
        integral = 0.5 * (end * rho_end - s * rho + edge_log(d, length, rho + rho_end))
        gx += ty * integral
        gy -= tx * integral
        q += d * integral
        rho = rho_end
    return gx, gy, q / 3.0


@no_refcount
def affine_integrals(
    edges: FloatArray, start: int, stop: int, cx: float, cy: float
) -> tuple[float, float, float, float, float]:
    """Return the integrals of r r^T / |r| (xx, xy, yy) and of |r| r (x, y) over a polygon."""
    gxx = gxy = gyy = qx = qy = 0.0
    for e in range(start, stop):
        tx, ty, length = edges[e, 0], edges[e, 1], edges[e, 4]
        nx, ny = ty, -tx
        d = edges[e, 2] - (ty * cx - tx * cy)
        s = edges[e, 3] - (tx * cx + ty * cy)
        end = s + length
        rho, rho_end = math.sqrt(s * s + d * d), math.sqrt(end * end + d * d)
        step = length * (s + end) / (rho + rho_end)
        logarithm = edge_log(d, length, rho + rho_end)
        integral = 0.5 * (end * rho_end - s * rho + logarithm)
        nn, nt, tt = d * logarithm, d * d * step, d * (integral - logarithm)
        gxx += nx * nx * nn + 2.0 * nx * tx * nt + tx * tx * tt
        gxy += nx * ny * nn + (nx * ty + ny * tx) * nt + tx * ty * tt
        gyy += ny * ny * nn + 2.0 * ny * ty * nt + ty * ty * tt
        along = d * step * (rho * rho + rho * rho_end + rho_end * rho_end) / 3.0
        qx += d * d * integral * nx + along * tx
        qy += d * d * integral * ny + along * ty
    return gxx / 3.0, gxy / 3.0, gyy / 3.0, qx / 4.0, qy / 4.0
