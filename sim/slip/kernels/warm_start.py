"""What one step hands on to the next: the last motion and forces, with which the solver begins."""

from __future__ import annotations

import math

from pushplan.compiled import inner, no_refcount
from pushplan.sim.slip.kernels.packed import Work
from pushplan.sim.slip.kernels.state import State
from pushplan.util.arrays import FloatArray

JUMP, SUDDEN = 0.25, 4.0
"""Change of an object's motion, over the plate's, from which on it counts as a jump, if it also is so many times the
change of the step before: sliding and rolling alone change motions steadily."""
_SAME_COMMAND = 0.01
"""Change of the plate's motion, over its size, up to which it goes on as before."""


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
def keep_motion(work: Work, state: State, size: float, length: float, twist: FloatArray) -> None:
    """Keep the motion and the objects' friction forces."""
    n = len(work.gradient)
    c, s = math.cos(state.poses[n, 2]), math.sin(state.poses[n, 2])
    for i in range(n):
        u, last = work.twists[i], state.twists[i]
        last[0], last[1], last[2] = (c * u[0] + s * u[1]) / size, (c * u[1] - s * u[0]) / size, u[2] / size
    state.command[0], state.command[1] = twist[0] / size, twist[1] / size
    state.command[2] = length * twist[2] / size
    keep_drag(work, state)
    state.steps[0] += 1


@inner
def keep_drag(work: Work, state: State) -> None:
    """Keep every object's friction force, in its own axes, for the shift of its load."""
    for i in range(len(work.gradient)):
        g, c, s = work.gradient[i], work.place[i, 2], work.place[i, 3]
        state.drag[i, 0], state.drag[i, 1] = c * g[0] + s * g[1], c * g[1] - s * g[0]


@inner
def closes(work: Work, count: int) -> bool:
    """Tell whether a point presses that did not in what is kept."""
    for m in range(count):
        memory = work.memory[work.who[m, 2]]
        for k in range(work.who[m, 3]):
            if work.modes[m, k] == 1 and (memory[3] != work.who[m, 3] or memory[k] == 0.0):
                return True
    return False


@no_refcount
def jumped(work: Work, state: State, size: float, length: float, twist: FloatArray, closed: bool) -> int:
    """Tell whether a motion jumped against the last one although the plate goes on and no contact closed."""
    change, before = _change(work, state, size), state.change[0]
    state.change[0] = change
    # The first two steps have no change to compare with; a contact that closes may change motions at once.
    if closed or state.steps[0] < 2 or change < max(JUMP, SUDDEN * before):
        return 0
    turned = abs(twist[0] / size - state.command[0]) + abs(twist[1] / size - state.command[1])
    return 1 if turned + abs(length * twist[2] / size - state.command[2]) <= _SAME_COMMAND else 0


@no_refcount
def _change(work: Work, state: State, size: float) -> float:
    """Return by how much the objects' motion in the plate's axes differs from the last one, over the plate's."""
    n, worst = len(work.gradient), 0.0
    c, s = math.cos(state.poses[n, 2]), math.sin(state.poses[n, 2])
    for i in range(n):
        u, last = work.twists[i], state.twists[i]
        x, y = (c * u[0] + s * u[1]) / size - last[0], (c * u[1] - s * u[0]) / size - last[1]
        worst = max(worst, math.sqrt(x * x + y * y + (u[2] / size - last[2]) ** 2))
    return worst
