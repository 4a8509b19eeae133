"""One step of a world: the plate moves by a given twist, and every object moves as balance and contacts demand.

What sticks moves exactly as one body with the plate. Where anything slides or opens, motions are found anew at the
middle of the step and made from its start: the midpoint rule, of second order in the length of a step.
"""

from __future__ import annotations

import math

from pushplan.compiled import in_threads, inner, no_refcount
from pushplan.sim.slip.lemke import RAY, reweighted
from pushplan.sim.slip.newton import balance_residual, contact_wrench, floor_terms, newton
from pushplan.sim.slip.state import (
    CONVERGED,
    CROWDED,
    FALLBACK,
    JAMMED,
    OPEN,
    ROLL,
    ROLL_SLIDE,
    SLIDE,
    STICK,
    UNSOLVED,
    PackedWorld,
    State,
    Trace,
    Work,
)
from pushplan.sim.slip.touching import find_manifolds, place_corners
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


@inner
def predict(work: Work, state: State, size: float, rigid: bool) -> None:
    """Set U as in the last step, or that of one rigid body with the plate."""
    n = len(work.gradient)
    # In the plate's axes a steady push is the same from step to step, also where the plate turns.
    c, s = math.cos(state.poses[n, 2]), math.sin(state.poses[n, 2])
    for i in range(n):
        u, last = work.twists[i], state.twists[i]
        u[0], u[1], u[2] = (
            size * (c * last[0] - s * last[1]),
            size * (s * last[0] + c * last[1]),
            size * last[2],
        )
        if rigid:
            u[0], u[1], u[2] = work.twists[n, 0], work.twists[n, 1], work.twists[n, 2]


@inner
def recall_forces(work: Work, count: int, fresh: bool, force: float, length: float) -> None:
    """Begin with the last forces; at the very first with some on everything that touches."""
    for c in range(count):
        for k in range(3):
            work.modes[c, k] = -1
            # At the very first nothing is remembered: without a force all would be guessed open, and nothing move.
            work.forces[c, k] = 0.5 * force if fresh and k < 2 and work.gaps[c, 0] < 1e-6 * length else 0.0
    # Several pairs may share a manifold: the first pair's memory, under which it is looked up, is written last.
    for q in range(len(work.found) - 1, -1, -1):
        if work.found[q] >= 0 and work.memory[q, 3] > 0.0:
            _recall(work.memory[q], work.forces[work.found[q]], work.who[work.found[q], 3])
    for c in range(count):
        if work.who[c, 3] == 1:
            work.forces[c, 1] = 0.0


@inner
def _recall(memory: FloatArray, forces: FloatArray, points: int) -> None:
    """Begin with the forces of the last step, spread evenly where a manifold has another number of points now."""
    forces[0], forces[1], forces[2] = memory[0], memory[1], memory[2]
    if memory[3] != points:
        forces[0] = forces[1] = (memory[0] + memory[1]) / points


@inner
def keep_forces(work: Work) -> None:
    """Keep the forces of all pairs."""
    for q in range(len(work.found)):
        memory, m = work.memory[q], work.found[q]
        memory[3] = 0.0
        if m >= 0:
            memory[0], memory[1], memory[2] = work.forces[m, 0], work.forces[m, 1], work.forces[m, 2]
            memory[3] = work.who[m, 3]


@inner
def keep_motion(work: Work, state: State, size: float) -> None:
    """Keep the motion and the objects' friction forces."""
    n = len(work.gradient)
    c, s = math.cos(state.poses[n, 2]), math.sin(state.poses[n, 2])
    for i in range(n):
        u, last = work.twists[i], state.twists[i]
        last[0], last[1], last[2] = (c * u[0] + s * u[1]) / size, (c * u[1] - s * u[0]) / size, u[2] / size
    keep_drag(work, state)
    state.steps[0] += 1


@inner
def keep_drag(work: Work, state: State) -> None:
    """Keep every object's friction force, in its own axes, for the shift of its load."""
    for i in range(len(work.gradient)):
        g, c, s = work.gradient[i], work.place[i, 2], work.place[i, 3]
        state.drag[i, 0], state.drag[i, 1] = c * g[0] + s * g[1], c * g[1] - s * g[0]


SMOOTHING = 1e-3
"""eps over the size of a step: from 1e-4 to 1e-2 pushes come out the same."""
WANTED, ACCEPTED = 1e-7, 1e-4
"""Residual over the sum of mu N that a step iterates to, and up to which it counts as solved."""
_ATTEMPTS = (
    (0.0, 0.0, 1.0),
    (0.0, 0.0, 16.0),
    (0.0, 1.0, 1.0),
    (0.0, 4.0, 4.0),
    (1.0, 0.0, 1.0),
    (1.0, 0.0, 16.0),
)
"""Of the fallback: from the last motion (0) or that of one rigid body (1), with the least and the largest tau."""


@no_refcount
def solve(
    packed: PackedWorld, work: Work, state: State, count: int, size: float, force: float
) -> tuple[float, int]:
    """Solve for the motions of all objects in a step; return the residual (N) and how it ended."""
    # eps goes with the step: an absolute one would make slow pushes viscous. r brings forces and displacements to one
    # size, so that neither decides modes alone.
    eps, stiffness = SMOOTHING * size, force / size
    residual = newton(packed, work, count, eps, stiffness, WANTED * force)
    if residual < math.inf:
        return residual, CONVERGED
    jam, left = True, math.inf
    for attempt in range(len(_ATTEMPTS)):
        rigid, least, most = _ATTEMPTS[attempt]
        predict(work, state, size, rigid == 1.0)
        if reweighted(packed, work, count, eps, force, size, WANTED * force, least, most) == RAY:
            # A ray from one beginning is not yet a jam: only if all of them end so.
            continue
        jam = False
        left = _polished(packed, work, count, eps, stiffness, force)
        if left <= ACCEPTED * force:
            return left, FALLBACK
    return left, JAMMED if jam else UNSOLVED


@no_refcount
def _polished(
    packed: PackedWorld, work: Work, count: int, eps: float, stiffness: float, force: float
) -> float:
    """Let Newton's method start from the fallback's solution, which stays where that fails; return the residual."""
    n = len(packed.loads)
    # Newton's method leaves U and forces anywhere when it fails.
    before = balance_residual(work, count)
    copy_rows(work.twists, work.kept_twists, n)
    copy_rows(work.forces, work.kept_forces, count)
    residual = newton(packed, work, count, eps, stiffness, WANTED * force)
    if residual < math.inf:
        return residual
    copy_rows(work.kept_twists, work.twists, n)
    copy_rows(work.kept_forces, work.forces, count)
    return before


REACH = 2.5
"""Gap over the size of a step up to which contacts are looked at."""
_SHIFTS = 5
"""Times that the first step's load shift is worked out from the friction that depends on it."""


@no_refcount
def step(packed: PackedWorld, work: Work, state: State, twist: FloatArray) -> tuple[float, int, int]:
    """Move the plate by a body twist times time (3,) and the objects with it; forces and modes stay in `work`.

    Where there is no solution, or too many manifolds, nothing has moved.

    Returns:
        Residual over the sum of mu N, how it ended, and the number of manifolds.
    """
    n = len(packed.loads)
    # Displacement of the plate with its turn as a length: eps, reach and gaps are shares of it, so that a push is the
    # same in steps of any size.
    size = math.sqrt(twist[0] ** 2 + twist[1] ** 2 + (packed.length * twist[2]) ** 2)
    if not size > 0.0:
        return 0.0, CONVERGED, 0
    copy_rows(state.poses, work.poses, n + 1)
    place(packed, work, state)
    command(work, state, twist, packed.length)
    if state.steps[0] == 0:
        _begin_drag(packed, work, state, size)
    predict(work, state, size, state.steps[0] == 0)
    force = _friction(packed)
    residual, end, count = _solve_here(packed, work, state, size, force, 1.0)
    if end >= UNSOLVED:
        return residual / force, end, max(count, 0)
    keep_forces(work)
    # One rigid body moves exactly by the exponential of its twist; only where something slides or opens does the
    # middle of the step, of second order, come nearer.
    if not _all_stick(work, count):
        residual, end, count = _solve_midway(packed, work, state, size, force)
        if end >= UNSOLVED:
            return residual / force, end, max(count, 0)
        keep_forces(work)
    keep_motion(work, state, size)
    for i in range(n + 1):
        move(state.poses, state.poses[n], i, work.twists[i], 1.0, packed.length)
    return residual / force, end, count


@no_refcount
def _friction(packed: PackedWorld) -> float:
    """Return the sum of mu N of all objects."""
    force = 0.0
    for i in range(len(packed.loads)):
        force += packed.loads[i, 0]
    return force


@inner
def _solve_here(
    packed: PackedWorld, work: Work, state: State, size: float, force: float, left: float
) -> tuple[float, int, int]:
    """Find contacts where bodies and feet are placed, and solve; return residual, end and number of manifolds.

    Args:
        packed: The world.
        work: U and the kept forces are where the solver begins.
        state: For the fallback's beginnings.
        size: Of the step, m.
        force: Sum of mu N, N.
        left: Share of the step in which gaps have to be closed.
    """
    place_corners(packed, work)
    count = find_manifolds(packed, work, REACH * size)
    if count < 0:
        return 0.0, CROWDED, count
    # A point must not pass its gap in what is left of the step; motions are for a whole one.
    for c in range(count):
        for k in range(work.who[c, 3]):  # what overlaps parts by half a step at a time
            work.gaps[c, k] = max(work.gaps[c, k] / left, -0.5 * size)
    recall_forces(work, count, state.steps[0] == 0 and left == 1.0, force, packed.length)
    residual, end = solve(packed, work, state, count, size, force)
    return residual, end, count


@inner
def _solve_midway(
    packed: PackedWorld, work: Work, state: State, size: float, force: float
) -> tuple[float, int, int]:
    """Solve with everything in the middle of the step; where that fails, at its start again."""
    n = len(packed.loads)
    for i in range(n + 1):
        move(work.poses, state.poses[n], i, work.twists[i], 0.5, packed.length)
    place(packed, work, state)
    # In the middle of a step that closes a contact there may be no solution though there is one at its start.
    residual, end, count = _solve_here(packed, work, state, size, force, 0.5)
    if end < UNSOLVED:
        return residual, end, count
    copy_rows(state.poses, work.poses, n + 1)
    place(packed, work, state)
    predict(work, state, size, state.steps[0] == 0)
    return _solve_here(packed, work, state, size, force, 1.0)


@inner
def _all_stick(work: Work, count: int) -> bool:
    """Tell whether every contact that presses sticks at both ends."""
    for c in range(count):
        modes = work.modes[c]
        two = work.who[c, 3] == 2
        pressed = modes[0] + (modes[1] if two else 0)
        if pressed > 0 and (pressed < 2 or modes[2] != 1):
            return False
    return True


@inner
def _begin_drag(packed: PackedWorld, work: Work, state: State, size: float) -> None:
    """Find the friction forces, on which loads depend that a push above the floor shifts, of one rigid body."""
    predict(work, state, size, True)
    # A fixed point: friction shifts the load, which changes friction. Later steps take the drag of the one before.
    for _ in range(_SHIFTS):
        floor_terms(packed, work, SMOOTHING * size)
        keep_drag(work, state)
        for i in range(len(packed.loads)):
            place_feet(packed, work, state, i)


@in_threads
def march(packed: PackedWorld, work: Work, state: State, twists: FloatArray, trace: Trace) -> int:
    """Move the plate by body twists times time (m, 3), one after the other; return how many steps were made.

    It ends early where there is no solution, or more manifolds than `work` has room for; the step that ended it
    is the last one in `trace`.
    """
    n = len(packed.loads)
    for m in range(len(twists)):
        residual, end, count = step(packed, work, state, twists[m])
        trace.residual[m], trace.end[m] = residual, end
        copy_rows(state.poses, trace.poses[m], n)
        if end in (UNSOLVED, JAMMED, CROWDED):
            return m + 1
        _note_contacts(packed, work, count, trace, m)
        _note_wrench(packed, work, count, trace.wrenches[m])
    return len(twists)


@inner
def _note_contacts(packed: PackedWorld, work: Work, count: int, trace: Trace, m: int) -> None:
    """Write down what the contacts do in step m."""
    n = len(packed.loads)
    for c in range(count):
        mode = _mode_of(work, c)
        contact = packed.pairs[work.who[c, 2], 2]
        if contact >= 0:
            trace.modes[m, contact] = mode
            for k in range(3):
                trace.forces[m, contact, k] = work.forces[c, k]
        # No contact of the chain: only that an object touches something is told, of both if both are objects.
        elif mode != OPEN:
            for side in range(2):
                if work.who[c, side] < n:
                    trace.others[m, work.who[c, side]] += 1


@inner
def _note_wrench(packed: PackedWorld, work: Work, count: int, out: FloatArray) -> None:
    """Write down the wrench with which the plate pushes, in its own frame where the step was solved.

    The step knows it in the world's axes, about the plate's reference point at the step's start.
    """
    n = len(packed.loads)
    fx = fy = torque = 0.0
    for c in range(count):
        if work.who[c, 0] == n:
            x, y, w = contact_wrench(work, c)
            fx, fy, torque = fx + x, fy + y, torque + packed.length * w
    # Turned by the plate's heading into its axes, and the moment from the point O to the place of the plate.
    there = work.place[n]
    out[0], out[1] = there[2] * fx + there[3] * fy, there[2] * fy - there[3] * fx
    out[2] = torque - (there[0] * fy - there[1] * fx)


@inner
def _mode_of(work: Work, c: int) -> int:
    ends = work.modes[c, 0] + (work.modes[c, 1] if work.who[c, 3] == 2 else 0)
    if ends == 0:
        return OPEN
    if work.modes[c, 2] == 1:
        return STICK if ends == 2 else ROLL
    return SLIDE if ends == 2 else ROLL_SLIDE
