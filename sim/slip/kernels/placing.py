"""Where bodies and feet are in a step, and how they move."""

from __future__ import annotations

import math

from pushplan.compiled import inner, no_refcount
from pushplan.sim.slip.kernels.packed import PackedWorld, Work
from pushplan.sim.slip.kernels.state import State
from pushplan.util.arrays import FloatArray


@inner
def copy_rows(source: FloatArray, target: FloatArray, rows: int) -> None:
    """Copy the first rows (., 3); assigning slices would need an array on the heap."""
    for i in range(rows):
        for j in range(3):
            target[i, j] = source[i, j]


@no_refcount
def place(packed: PackedWorld, work: Work, state: State) -> None:
    """Bring bodies and feet at `work.poses` to their places about the plate's reference point at the step's start."""
    n = len(packed.loads)
    # About the plate, not the world's origin: far from that, moments would lose digits.
    ox, oy = state.poses[n, 0], state.poses[n, 1]
    for i in range(n + 1):
        pose = work.poses[i]
        _set_place(work.place[i], pose[0] - ox, pose[1] - oy, math.cos(pose[2]), math.sin(pose[2]))
    _set_place(work.place[n + 1], -ox, -oy, 1.0, 0.0)
    for i in range(n):
        place_feet(packed, work, state, i)


@inner
def _set_place(row: FloatArray, x: float, y: float, cosine: float, sine: float) -> None:
    row[0], row[1], row[2], row[3] = x, y, cosine, sine


@inner
def place_feet(packed: PackedWorld, work: Work, state: State, i: int) -> None:
    """Place the feet of an object; a push above the floor shifts its load by h mu drag, as in the last step."""
    there, load = work.place[i], packed.loads[i]
    # Load N_j + k_j (p_j - c) . b with b = S^-1 (h mu drag): the support's stiffnesses k take the moment of a push at
    # height h.
    det = load[2] * load[4] - load[3] * load[3]
    fx, fy = load[1] * state.drag[i, 0], load[1] * state.drag[i, 1]
    bx = by = 0.0
    if load[1] > 0.0:
        bx, by = (load[4] * fx - load[3] * fy) / det, (load[2] * fy - load[3] * fx) / det
    for j in range(packed.first_foot[i], packed.first_foot[i + 1]):
        foot = packed.feet[j]
        shift = bx * (foot[0] - packed.center[i, 0]) + by * (foot[1] - packed.center[i, 1])
        work.feet[j, 0] = (there[0] + there[2] * foot[0] - there[3] * foot[1]) / packed.length
        work.feet[j, 1] = (there[1] + there[3] * foot[0] + there[2] * foot[1]) / packed.length
        work.feet[j, 2] = foot[2] + foot[3] * shift


@no_refcount
def command(work: Work, state: State, twist: FloatArray, length: float) -> None:
    """Set the displacement of the plate, and none of what stands still.

    A twist about a point that stands still, in the world's axes, is the same all through the step.
    """
    n = len(work.gradient)
    c, s, u = work.place[n, 2], work.place[n, 3], work.twists[n]
    u[0], u[1], u[2] = c * twist[0] - s * twist[1], s * twist[0] + c * twist[1], length * twist[2]
    work.twists[n + 1, :] = 0.0


@no_refcount
def move(
    poses: FloatArray, reference: FloatArray, i: int, u: FloatArray, share: float, length: float
) -> None:
    """Move body i by the exact exponential of a share of its twist about the reference point."""
    turn = share * u[2] / length
    half = 0.5 * turn
    # What the series leaves out, half^4 / 120, is below 1e-18 there.
    sinc = share * (1.0 - half * half / 6.0 if abs(half) < 1e-4 else math.sin(half) / half)
    c, s = math.cos(turn), math.sin(turn)
    vx = sinc * (math.cos(half) * u[0] - math.sin(half) * u[1])
    vy = sinc * (math.sin(half) * u[0] + math.cos(half) * u[1])
    ox, oy = reference[0], reference[1]
    dx, dy = poses[i, 0] - ox, poses[i, 1] - oy
    poses[i, 0], poses[i, 1] = ox + c * dx - s * dy + vx, oy + s * dx + c * dy + vy
    poses[i, 2] += turn
