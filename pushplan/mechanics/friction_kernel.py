"""Support friction of points, polygons and affine pressures: the closed forms of the floor's wrench."""

from __future__ import annotations

import math

from pushplan.compiled import no_refcount
from pushplan.compiled.scratch import scratch
from pushplan.mechanics.packed import POINTS, UNIFORM, ComplexArray, in_reach, series_pair
from pushplan.util.arrays import FloatArray, IntArray


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


@no_refcount
def _uniform_sums(
    objects: FloatArray,
    parts: FloatArray,
    series: ComplexArray,
    links: IntArray,
    i: int,
    vx: float,
    vy: float,
    omega: float,
) -> tuple[float, float, float]:
    """Return the integral of v / |v| over a polygon and its moment; v and moments refer to the anchor."""
    radius = objects[i, 3]
    speed = math.sqrt(vx * vx + vy * vy)
    if in_reach(speed, omega, radius):
        plain, turned = series_pair(series, 5 * i, vx, vy, omega * radius)
        return plain.real, plain.imag, turned.imag
    cx, cy = -vy / omega, vx / omega
    gx, gy, q = uniform_integrals(parts, links[i, 1], links[i, 2], cx, cy)
    sign = math.copysign(1.0, omega)
    fx, fy = -sign * gy, sign * gx
    return fx, fy, sign * q + cx * fy - cy * fx


@no_refcount
def _polygon_sums(
    objects: FloatArray,
    parts: FloatArray,
    series: ComplexArray,
    links: IntArray,
    i: int,
    vx: float,
    vy: float,
    omega: float,
    force: FloatArray,
    matrix: FloatArray,
) -> None:
    """Fill `force` (3,) as `_uniform_sums` does, and `matrix` (3, 2) likewise for the pressures x and y."""
    radius = objects[i, 3]
    speed = math.sqrt(vx * vx + vy * vy)
    if in_reach(speed, omega, radius):
        plain, turned = series_pair(series, 5 * i, vx, vy, omega * radius)
        straight, turned_twice = series_pair(series, 5 * i + 2, vx, vy, omega * radius)
        _, even = series_pair(series, 5 * i + 3, vx, vy, omega * radius)
        force[0], force[1], force[2] = plain.real, plain.imag, turned.imag
        along_x, along_y = 0.5 * (straight + turned), -0.5j * (straight - turned)
        matrix[0, 0], matrix[1, 0], matrix[2, 0] = (
            along_x.real,
            along_x.imag,
            0.5 * (even + turned_twice).imag,
        )
        matrix[0, 1], matrix[1, 1], matrix[2, 1] = (
            along_y.real,
            along_y.imag,
            (-0.5j * (even - turned_twice)).imag,
        )
        return
    cx, cy = -vy / omega, vx / omega
    start, stop = links[i, 1], links[i, 2]
    gx, gy, q = uniform_integrals(parts, start, stop, cx, cy)
    gxx, gxy, gyy, qx, qy = affine_integrals(parts, start, stop, cx, cy)
    sign = math.copysign(1.0, omega)
    force[0], force[1] = -sign * gy, sign * gx
    force[2] = sign * q + cx * force[1] - cy * force[0]
    matrix[0, 0], matrix[0, 1] = -sign * (gxy + gy * cx), -sign * (gyy + gy * cy)
    matrix[1, 0], matrix[1, 1] = sign * (gxx + gx * cx), sign * (gxy + gx * cy)
    matrix[2, 0] = sign * (qx + q * cx) + cx * matrix[1, 0] - cy * matrix[0, 0]
    matrix[2, 1] = sign * (qy + q * cy) + cx * matrix[1, 1] - cy * matrix[0, 1]


@no_refcount
def _point_sums(
    objects: FloatArray,
    parts: FloatArray,
    series: ComplexArray,
    links: IntArray,
    i: int,
    vx: float,
    vy: float,
    omega: float,
    force: FloatArray,
    matrix: FloatArray,
) -> None:
    """Fill `force` (3,) and `matrix` (3, 2) by exact sums over points; a point at the COR adds nothing."""
    force[:] = 0.0
    matrix[:] = 0.0
    still = 1e-14 * (math.sqrt(vx * vx + vy * vy) + math.fabs(omega) * objects[i, 3])
    for e in range(links[i, 1], links[i, 2]):
        x, y = parts[e, 0], parts[e, 1]
        ux, uy = vx - omega * y, vy + omega * x
        speed = math.sqrt(ux * ux + uy * uy)
        if speed <= still:
            continue
        ux, uy = ux / speed, uy / speed
        moment = x * uy - y * ux
        load, stiffness = parts[e, 2], parts[e, 3]
        force[0] += load * ux
        force[1] += load * uy
        force[2] += load * moment
        matrix[0, 0] += stiffness * ux * x
        matrix[0, 1] += stiffness * ux * y
        matrix[1, 0] += stiffness * uy * x
        matrix[1, 1] += stiffness * uy * y
        matrix[2, 0] += stiffness * moment * x
        matrix[2, 1] += stiffness * moment * y


@no_refcount
def _shifted(row: FloatArray, force: FloatArray, matrix: FloatArray) -> None:
    """Add to `force` what the load's shift by the push height changes (see the module's formula)."""
    h = row[7]
    xx, xy = row[8] - h * matrix[0, 0], row[9] - h * matrix[0, 1]
    yx, yy = row[9] - h * matrix[1, 0], row[10] - h * matrix[1, 1]
    det = xx * yy - xy * yx
    bx = h * (force[0] * yy - force[1] * xy) / det
    by = h * (xx * force[1] - yx * force[0]) / det
    for j in range(3):
        force[j] += matrix[j, 0] * bx + matrix[j, 1] * by


@no_refcount
def _general_sums(
    objects: FloatArray,
    parts: FloatArray,
    series: ComplexArray,
    links: IntArray,
    i: int,
    vx: float,
    vy: float,
    omega: float,
) -> tuple[float, float, float]:
    """Return what `_uniform_sums` does, for the whole load of an object with any support and push height."""
    row = objects[i]
    force, matrix = scratch(1, 3)[0], scratch(3, 2)
    if links[i, 0] == POINTS:
        _point_sums(objects, parts, series, links, i, vx, vy, omega, force, matrix)
    else:
        _polygon_sums(objects, parts, series, links, i, vx, vy, omega, force, matrix)
        for j in range(3):
            force[j] = row[4] * force[j] + row[5] * matrix[j, 0] + row[6] * matrix[j, 1]
    if row[7] > 0.0:
        _shifted(row, force, matrix)
    return force[0], force[1], force[2]


@no_refcount
def carried_wrench(
    objects: FloatArray,
    parts: FloatArray,
    series: ComplexArray,
    links: IntArray,
    i: int,
    vx: float,
    vy: float,
    omega: float,
) -> tuple[float, float, float]:
    """Return the wrench that moves object i at a twist against the floor: minus the floor friction's wrench.

    The first four arguments are those of a `PackedChain`: taking them out of the tuple once saves time.

    Args:
        objects: Of the packed chain.
        parts: Of the packed chain.
        series: Of the packed chain.
        links: Of the packed chain.
        i: Index of the object.
        vx: Velocity of the frame's origin, like `vy` and `omega` in any common unit; not all zero.
        vy: See `vx`.
        omega: Angular velocity.

    Returns:
        f_x, f_y (N) and the moment about the origin (N m).
    """
    load, ax, ay = objects[i, 0], objects[i, 1], objects[i, 2]
    ux, uy = vx - omega * ay, vy + omega * ax
    if links[i, 0] == UNIFORM:
        fx, fy, m = _uniform_sums(objects, parts, series, links, i, ux, uy, omega)
        load *= objects[i, 4]
    else:
        fx, fy, m = _general_sums(objects, parts, series, links, i, ux, uy, omega)
    fx, fy, m = load * fx, load * fy, load * m
    return fx, fy, m + ax * fy - ay * fx
