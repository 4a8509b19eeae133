"""One step of a world: the plate moves by a given twist, and every object moves as balance and contacts demand."""

from __future__ import annotations

import math

from pushplan.basics.arrays import FloatArray
from pushplan.compiled import no_refcount
from pushplan.sim.slip.floor_kernel import floor_terms
from pushplan.sim.slip.lemke_kernel import RAY, reweighted
from pushplan.sim.slip.newton_kernel import balance_residual, newton
from pushplan.sim.slip.packed import PackedWorld, Work
from pushplan.sim.slip.state import COARSE, CONVERGED, CROWDED, FALLBACK, JAMMED, State
from pushplan.sim.slip.touching_kernel import find_manifolds, place_corners

SMOOTHING = 1e-3
"""eps over the size of a step: from 1e-4 to 1e-2 pushes come out the same."""
REACH = 2.5
"""Gap over the size of a step up to which contacts are looked at."""
WANTED, ACCEPTED = 1e-7, 1e-4
"""Residual over the sum of mu N that a step iterates to, and up to which it counts as solved."""
_SHIFTS = 5
"""Times that the first step's load shift is worked out from the friction that depends on it."""
JUMP = 0.1
"""Change of an object's motion, over the plate's, that a contact which did not close cannot explain."""


@no_refcount
def step(packed: PackedWorld, work: Work, state: State, twist: FloatArray) -> tuple[float, int, int, int]:
    """Move the plate by a body twist times time (3,) and the objects with it; forces and modes stay in `work`.

    After a jam, or where there are too many manifolds, nothing has moved.

    Returns:
        Residual over the sum of mu N, how it ended, number of manifolds, and 1 if another branch was taken.
    """
    n = len(packed.loads)
    size = math.sqrt(twist[0] ** 2 + twist[1] ** 2 + (packed.length * twist[2]) ** 2)
    if not size > 0.0:
        return 0.0, CONVERGED, 0, 0
    _place(packed, work, state)
    _command(work, state, twist, packed.length)
    if state.steps[0] == 0:
        _begin_drag(packed, work, state, size)
    place_corners(packed, work)
    count = find_manifolds(packed, work, REACH * size)
    if count < 0:
        return 0.0, CROWDED, 0, 0
    force = 0.0
    for i in range(n):
        force += packed.loads[i, 0]
    _clip_gaps(work, count, size)
    _warm_start(work, state, count, size, force, packed.length)
    residual, end = _solved(packed, work, state, count, size, force)
    if end == JAMMED:
        return residual / force, JAMMED, count, 0
    switched = _switched(work, state, count, size, packed.length, twist)
    _remember(work, state, count, size, packed.length, twist)
    for i in range(n + 1):
        _move(state.poses, n, i, work.twists[i], packed.length)
    return residual / force, end, count, switched


@no_refcount
def _solved(
    packed: PackedWorld, work: Work, state: State, count: int, size: float, force: float
) -> tuple[float, int]:
    """Solve the step; return the residual and how it ended."""
    eps, stiffness = SMOOTHING * size, force / size
    residual = newton(packed, work, count, eps, stiffness, WANTED * force)
    if residual < math.inf:
        return residual, CONVERGED
    end = RAY
    for attempt in range(2):  # a ray from one guess of K may be none from another
        _predict(work, state, size, packed.length, attempt == 1)
        end = reweighted(packed, work, count, eps, force, size, 0.1 * ACCEPTED * force)
        if end != RAY:
            break
    if end == RAY:
        return math.inf, JAMMED
    return _polished(packed, work, count, eps, stiffness, force)


@no_refcount
def copy_rows(source: FloatArray, target: FloatArray, rows: int) -> None:
    """Copy the first rows (., 3); assigning slices would need an array on the heap."""
    for i in range(rows):
        for j in range(3):
            target[i, j] = source[i, j]


@no_refcount
def _polished(
    packed: PackedWorld, work: Work, count: int, eps: float, stiffness: float, force: float
) -> tuple[float, int]:
    """Let Newton's method start from the fallback's solution, which stays where that fails."""
    n = len(packed.loads)
    before = balance_residual(work, count)
    copy_rows(work.twists, work.kept_twists, n)
    copy_rows(work.forces, work.kept_forces, count)
    residual = newton(packed, work, count, eps, stiffness, WANTED * force)
    if residual < math.inf:
        return residual, FALLBACK
    copy_rows(work.kept_twists, work.twists, n)
    copy_rows(work.kept_forces, work.forces, count)
    return before, FALLBACK if before <= ACCEPTED * force else COARSE


@no_refcount
def _place(packed: PackedWorld, work: Work, state: State) -> None:
    """Bring bodies and feet to their places about the plate's reference point."""
    n = len(packed.loads)
    ox, oy = state.poses[n, 0], state.poses[n, 1]
    for i in range(n + 1):
        place, pose = work.place[i], state.poses[i]
        place[0], place[1], place[2], place[3] = (
            pose[0] - ox,
            pose[1] - oy,
            math.cos(pose[2]),
            math.sin(pose[2]),
        )
    place = work.place[n + 1]
    place[0], place[1], place[2], place[3] = -ox, -oy, 1.0, 0.0
    for i in range(n):
        _place_feet(packed, work, state, i)


@no_refcount
def _place_feet(packed: PackedWorld, work: Work, state: State, i: int) -> None:
    """Place the feet of an object; a push above the floor shifts its load by h mu drag, as in the last step."""
    place, load = work.place[i], packed.loads[i]
    det = load[2] * load[4] - load[3] * load[3]
    fx, fy = load[1] * state.drag[i, 0], load[1] * state.drag[i, 1]
    bx = by = 0.0
    if load[1] > 0.0:
        bx, by = (load[4] * fx - load[3] * fy) / det, (load[2] * fy - load[3] * fx) / det
    for j in range(packed.first_foot[i], packed.first_foot[i + 1]):
        foot = packed.feet[j]
        shift = bx * (foot[0] - packed.center[i, 0]) + by * (foot[1] - packed.center[i, 1])
        work.feet[j, 0] = (place[0] + place[2] * foot[0] - place[3] * foot[1]) / packed.length
        work.feet[j, 1] = (place[1] + place[3] * foot[0] + place[2] * foot[1]) / packed.length
        work.feet[j, 2] = foot[2] + foot[3] * shift


@no_refcount
def _begin_drag(packed: PackedWorld, work: Work, state: State, size: float) -> None:
    """Find the friction forces, on which loads depend that a push above the floor shifts, of one rigid body."""
    _predict(work, state, size, packed.length, True)
    for _ in range(_SHIFTS):
        floor_terms(packed, work, SMOOTHING * size)
        _keep_drag(work, state)
        for i in range(len(packed.loads)):
            _place_feet(packed, work, state, i)


@no_refcount
def _command(work: Work, state: State, twist: FloatArray, length: float) -> None:
    """Set the displacement of the plate, and none of what stands still."""
    n = len(work.gradient)
    c, s, u = work.place[n, 2], work.place[n, 3], work.twists[n]
    u[0], u[1], u[2] = c * twist[0] - s * twist[1], s * twist[0] + c * twist[1], length * twist[2]
    work.twists[n + 1, :] = 0.0


@no_refcount
def _clip_gaps(work: Work, count: int, size: float) -> None:
    """Let bodies that overlap part by half a step at a time."""
    for c in range(count):
        for k in range(work.who[c, 3]):
            work.gaps[c, k] = max(work.gaps[c, k], -0.5 * size)


@no_refcount
def _warm_start(work: Work, state: State, count: int, size: float, force: float, length: float) -> None:
    """Begin with the last motion in the plate's axes and the last forces; at first with one rigid body."""
    fresh = state.steps[0] == 0
    _predict(work, state, size, length, fresh)
    for c in range(count):
        for k in range(3):
            work.modes[c, k] = -1
            work.forces[c, k] = 0.5 * force if fresh and k < 2 and work.gaps[c, 0] < 1e-6 * length else 0.0
    for q in range(len(work.found) - 1, -1, -1):
        if work.found[q] >= 0 and work.memory[q, 3] > 0.0:
            _recall(work.memory[q], work.forces[work.found[q]], work.who[work.found[q], 3])
    for c in range(count):
        if work.who[c, 3] == 1:
            work.forces[c, 1] = 0.0


@no_refcount
def _recall(memory: FloatArray, forces: FloatArray, points: int) -> None:
    """Begin with the forces of the last step, spread evenly where a manifold has another number of points now."""
    forces[0], forces[1], forces[2] = memory[0], memory[1], memory[2]
    if memory[3] != points:
        forces[0] = forces[1] = (memory[0] + memory[1]) / points


@no_refcount
def _predict(work: Work, state: State, size: float, length: float, rigid: bool) -> None:
    """Set U as in the last step, or that of one rigid body with the plate."""
    n = len(work.gradient)
    c, s = work.place[n, 2], work.place[n, 3]
    for i in range(n):
        u, last = work.twists[i], state.twists[i]
        u[0], u[1], u[2] = (
            size * (c * last[0] - s * last[1]),
            size * (s * last[0] + c * last[1]),
            size * last[2],
        )
        if rigid:
            u[0], u[1], u[2] = work.twists[n, 0], work.twists[n, 1], work.twists[n, 2]


@no_refcount
def _remember(work: Work, state: State, count: int, size: float, length: float, twist: FloatArray) -> None:
    """Keep the solution for the next step's warm start."""
    n = len(work.gradient)
    c, s = work.place[n, 2], work.place[n, 3]
    for i in range(n):
        u, last = work.twists[i], state.twists[i]
        last[0], last[1], last[2] = (c * u[0] + s * u[1]) / size, (c * u[1] - s * u[0]) / size, u[2] / size
    state.command[0], state.command[1], state.command[2] = (
        twist[0] / size,
        twist[1] / size,
        length * twist[2] / size,
    )
    for q in range(len(work.found)):
        memory, m = work.memory[q], work.found[q]
        memory[3] = 0.0
        if m >= 0:
            memory[0], memory[1], memory[2] = work.forces[m, 0], work.forces[m, 1], work.forces[m, 2]
            memory[3] = work.who[m, 3]
    _keep_drag(work, state)
    state.steps[0] += 1


@no_refcount
def _keep_drag(work: Work, state: State) -> None:
    """Keep every object's friction force, in its own axes, for the shift of its load."""
    for i in range(len(work.gradient)):
        g, c, s = work.gradient[i], work.place[i, 2], work.place[i, 3]
        state.drag[i, 0], state.drag[i, 1] = c * g[0] + s * g[1], c * g[1] - s * g[0]


@no_refcount
def _switched(work: Work, state: State, count: int, size: float, length: float, twist: FloatArray) -> int:
    """Tell whether a motion jumped against the last one although the plate goes on and no contact closed."""
    if state.steps[0] == 0:
        return 0
    turned = abs(twist[0] / size - state.command[0]) + abs(twist[1] / size - state.command[1])
    if turned + abs(length * twist[2] / size - state.command[2]) > 0.1 * JUMP:
        return 0
    for m in range(count):
        memory = work.memory[work.who[m, 2]]
        for k in range(work.who[m, 3]):
            if work.modes[m, k] == 1 and (memory[3] != work.who[m, 3] or memory[k] == 0.0):
                return 0
    n = len(work.gradient)
    c, s = work.place[n, 2], work.place[n, 3]
    for i in range(n):
        u, last = work.twists[i], state.twists[i]
        x, y = (c * u[0] + s * u[1]) / size - last[0], (c * u[1] - s * u[0]) / size - last[1]
        if x * x + y * y + (u[2] / size - last[2]) ** 2 > JUMP * JUMP:
            return 1
    return 0


@no_refcount
def _move(poses: FloatArray, plate: int, i: int, u: FloatArray, length: float) -> None:
    """Move a body by the exact exponential of its twist about the plate's reference point; the plate comes last."""
    turn = u[2] / length
    half = 0.5 * turn
    sinc = 1.0 - half * half / 6.0 if abs(half) < 1e-4 else math.sin(half) / half
    c, s = math.cos(turn), math.sin(turn)
    vx = sinc * (math.cos(half) * u[0] - math.sin(half) * u[1])
    vy = sinc * (math.sin(half) * u[0] + math.cos(half) * u[1])
    ox, oy = poses[plate, 0], poses[plate, 1]
    dx, dy = poses[i, 0] - ox, poses[i, 1] - oy
    poses[i, 0], poses[i, 1] = ox + c * dx - s * dy + vx, oy + s * dx + c * dy + vy
    poses[i, 2] += turn
