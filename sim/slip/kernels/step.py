"""One step of a world: the plate moves by a given twist, and every object moves as balance and contacts demand.

What sticks moves exactly as one body with the plate. Where anything slides or opens, motions are found anew at the
middle of the step and made from its start: the midpoint rule, of second order in the length of a step.
"""

from __future__ import annotations

import math

from pushplan.compiled import inner, no_refcount
from pushplan.sim.slip.kernels.floor import floor_terms
from pushplan.sim.slip.kernels.packed import PackedWorld, Work
from pushplan.sim.slip.kernels.placing import command, copy_rows, move, place, place_feet
from pushplan.sim.slip.kernels.solving import SMOOTHING, solve
from pushplan.sim.slip.kernels.state import CONVERGED, CROWDED, UNSOLVED, State
from pushplan.sim.slip.kernels.touching import find_manifolds, place_corners
from pushplan.sim.slip.kernels.warm_start import (
    closes,
    jumped,
    keep_drag,
    keep_forces,
    keep_motion,
    predict,
    recall_forces,
)
from pushplan.util.arrays import FloatArray

REACH = 2.5
"""Gap over the size of a step up to which contacts are looked at."""
_SHIFTS = 5
"""Times that the first step's load shift is worked out from the friction that depends on it."""


@no_refcount
def step(packed: PackedWorld, work: Work, state: State, twist: FloatArray) -> tuple[float, int, int, int]:
    """Move the plate by a body twist times time (3,) and the objects with it; forces and modes stay in `work`.

    Where there is no solution, or too many manifolds, nothing has moved.

    Returns:
        Residual over the sum of mu N, how it ended, number of manifolds, and 1 if a motion jumped.
    """
    n = len(packed.loads)
    # Displacement of the plate with its turn as a length: eps, reach and gaps are shares of it, so that a push is the
    # same in steps of any size.
    size = math.sqrt(twist[0] ** 2 + twist[1] ** 2 + (packed.length * twist[2]) ** 2)
    if not size > 0.0:
        return 0.0, CONVERGED, 0, 0
    copy_rows(state.poses, work.poses, n + 1)
    place(packed, work, state)
    command(work, state, twist, packed.length)
    if state.steps[0] == 0:
        _begin_drag(packed, work, state, size)
    predict(work, state, size, state.steps[0] == 0)
    force = _friction(packed)
    residual, end, count = _solve_here(packed, work, state, size, force, 1.0)
    if end >= UNSOLVED:
        return residual / force, end, max(count, 0), 0
    # Asked before the forces are kept: what is kept is the step before until then.
    closed = closes(work, count)
    keep_forces(work)
    # One rigid body moves exactly by the exponential of its twist; only where something slides or opens does the
    # middle of the step, of second order, come nearer.
    if not _all_stick(work, count):
        residual, end, count = _solve_midway(packed, work, state, size, force)
        if end >= UNSOLVED:
            return residual / force, end, max(count, 0), 0
        closed = closed or closes(work, count)
        keep_forces(work)
    switched = jumped(work, state, size, packed.length, twist, closed)
    keep_motion(work, state, size, packed.length, twist)
    for i in range(n + 1):
        move(state.poses, state.poses[n], i, work.twists[i], 1.0, packed.length)
    return residual / force, end, count, switched


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
