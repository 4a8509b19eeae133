"""Semismooth Newton for one step: force balance on the floor, exact Coulomb contacts at the current normals.

    g_i(U_i) = sum over contacts of +-(ln n + lt t)                                  balance of object i
    gap + n . (U_b - U_a) >= 0  _|_  ln >= 0                                         at every point
    |lt| <= mu sum ln, and lt = -mu sum ln sign(t . (U_b - U_a)) where it slips      for every manifold

Each round guesses from U and the multipliers which points press and which manifolds stick or slip, and solves the
linear system that is left, in the multipliers (Schur complement), with the matrix M_i = (1 - tau) H_i + tau K_i.
"""

from __future__ import annotations

import math

from pushplan.compiled import inner, no_refcount
from pushplan.compiled.scratch import scratch
from pushplan.sim.slip.kernels.floor import floor_terms, invert_symmetric
from pushplan.sim.slip.kernels.linear import solve_linear
from pushplan.sim.slip.kernels.multipliers import acts, balance_residual, relative_motion
from pushplan.sim.slip.kernels.packed import PackedWorld, Work

ROUNDS = 25
"""Rounds after which a step is left to the fallback."""
_PATIENCE = 6
"""Rounds after which tau moves from Newton's towards the majorising matrix when the residual does not halve."""
_EXACT = 100.0
"""How far constraints may be missed, in units of the residual that is wanted, times displacement over force."""
_CLOSED = 1e-12
"""Share of L up to which gaps are rounding."""
_SMALL = 1e-9
"""Of the trace of K, added to the diagonal of M."""


@inner
def newton(packed: PackedWorld, work: Work, count: int, eps: float, stiffness: float, wanted: float) -> float:
    """Solve a step from U and the multipliers in `work`; return the residual (N), infinite if it did not converge.

    Args:
        packed: The world.
        work: With manifolds; holds the result.
        count: Number of manifolds.
        eps: Displacement that smooths the floor's friction, m.
        stiffness: r, force over displacement by which both are compared, N/m.
        wanted: Residual to reach, N.
    """
    tau, before = 0.0, math.inf
    floor_terms(packed, work, eps)
    for rounds in range(ROUNDS):
        # In the first round forces are remembered ones, which no U belongs to yet: no residual tells anything then.
        changed = _set_modes(work, count, stiffness)
        residual = balance_residual(work, count) if rounds > 0 else math.inf
        if not changed and residual < wanted and stiffness * _violation(work, count) < _EXACT * wanted:
            _hold_together(work, count, packed.length)
            return residual
        if rounds > _PATIENCE:
            tau = min(1.0, tau + 0.5) if residual > 0.5 * before else max(0.0, tau - 0.25)
        before = residual
        link(work, count)
        matrices(work, tau)
        if not solve_linear(work, count):
            return math.inf
        floor_terms(packed, work, eps)
    return math.inf


@inner
def _set_modes(work: Work, count: int, stiffness: float) -> bool:
    """Guess every mode from forces and displacements; tell whether any changed."""
    changed = False
    for c in range(count):
        pressed = 0.0
        for k in range(work.who[c, 3]):
            ln = work.forces[c, k]
            # min(ln, r w) = 0 says ln >= 0 _|_ w >= 0 (w: the gap after the step); the smaller one is made 0.
            active = 1 if ln - stiffness * (work.gaps[c, k] + relative_motion(work, c, k)) > 0.0 else 0
            changed = changed or active != work.modes[c, k]
            work.modes[c, k] = active
            pressed += active * max(ln, 0.0)
        mode = _tangent_mode(work, c, pressed, stiffness)
        changed = changed or mode != work.modes[c, 2]
        work.modes[c, 2] = mode
    return changed


@inner
def _tangent_mode(work: Work, c: int, pressed: float, stiffness: float) -> int:
    if work.modes[c, 0] == 0 and (work.who[c, 3] == 1 or work.modes[c, 1] == 0):
        return 0
    # lt is the point of the friction interval that is nearest to lt - r ut: inside it sticks, at an end it slips.
    wish = work.forces[c, 2] - stiffness * relative_motion(work, c, 2)
    if abs(wish) <= work.frame[c, 4] * pressed:
        return 1
    return 2 if wish > 0.0 else -2


@inner
def _violation(work: Work, count: int) -> float:
    """Return by how much the motion misses what active normals and sticking tangents demand, m."""
    worst = 0.0
    for c in range(count):
        for k in range(3):
            if acts(work, c, k):
                gap = work.gaps[c, k] if k < 2 else 0.0
                worst = max(worst, abs(gap + relative_motion(work, c, k)))
    return worst


@inner
def _hold_together(work: Work, count: int, length: float) -> None:
    """Give bodies that stick at both ends of a closed contact the same motion to the last bit: no drift adds up.

    Pairs come in the order of the chain's contacts, so that a pushing object has its motion already.
    """
    for c in range(count):
        modes = work.modes[c]
        if work.who[c, 3] != 2 or modes[0] != 1 or modes[1] != 1 or modes[2] != 1:
            continue
        if abs(work.gaps[c, 0]) + abs(work.gaps[c, 1]) < _CLOSED * length and work.who[c, 1] < len(
            work.gradient
        ):
            for j in range(3):
                work.twists[work.who[c, 1], j] = work.twists[work.who[c, 0], j]


@no_refcount
def link(work: Work, count: int) -> None:
    """Mark the bodies that active contacts connect with the pusher: what moves the others is nothing."""
    pusher = len(work.linked) - 2
    work.linked[:] = 0
    work.linked[pusher] = 1
    # Each pass hands on at least one body farther; a chain of n objects needs n.
    for _ in range(pusher):
        for c in range(count):
            a, b = work.who[c, 0], work.who[c, 1]
            if work.modes[c, 2] != 0 and (work.linked[a] == 1 or work.linked[b] == 1):
                work.linked[a] = work.linked[b] = 1
        # What stands still hands no motion on: objects that touch the same wall are not linked by it.
        work.linked[pusher + 1] = 0


@inner
def matrices(work: Work, tau: float) -> None:
    """Fill the inverses of M; of K where nothing links an object with the pusher, which ends its motion at once."""
    m = scratch(1, 6)[0]
    for i in range(len(work.gradient)):
        part = tau if work.linked[i] == 1 else 1.0
        secant, curvature = work.secant[i], work.curvature[i]
        for j in range(6):
            m[j] = part * secant[j] + (1.0 - part) * curvature[j]
        # Friction is homogeneous of degree 1, so H U = 0: without a contact that fixes how far a body moves M has no
        # inverse.
        extra = _SMALL * (secant[0] + secant[3] + secant[5])
        m[0], m[3], m[5] = m[0] + extra, m[3] + extra, m[5] + extra
        invert_symmetric(m, work.inverse[i])
