"""Many steps of a world in a row."""

from __future__ import annotations

from pushplan.compiled import in_threads, inner
from pushplan.sim.slip.kernels.multipliers import contact_wrench
from pushplan.sim.slip.kernels.packed import PackedWorld, Work
from pushplan.sim.slip.kernels.placing import copy_rows
from pushplan.sim.slip.kernels.state import (
    CROWDED,
    JAMMED,
    OPEN,
    ROLL,
    ROLL_SLIDE,
    SLIDE,
    STICK,
    UNSOLVED,
    State,
    Trace,
)
from pushplan.sim.slip.kernels.step import step
from pushplan.util.arrays import FloatArray


@in_threads
def march(packed: PackedWorld, work: Work, state: State, twists: FloatArray, trace: Trace) -> int:
    """Move the plate by body twists times time (m, 3), one after the other; return how many steps were made.

    It ends early where there is no solution, or more manifolds than `work` has room for; the step that ended it
    is the last one in `trace`.
    """
    n = len(packed.loads)
    for m in range(len(twists)):
        residual, end, count, switched = step(packed, work, state, twists[m])
        trace.residual[m], trace.end[m], trace.switched[m] = residual, end, switched
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
