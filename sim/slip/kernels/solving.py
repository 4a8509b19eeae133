"""The contact forces and motions of one configuration: Newton's method, and the fallback where that fails."""

from __future__ import annotations

import math

from pushplan.compiled import no_refcount
from pushplan.sim.slip.kernels.lemke import RAY, reweighted
from pushplan.sim.slip.kernels.multipliers import balance_residual
from pushplan.sim.slip.kernels.newton import newton
from pushplan.sim.slip.kernels.packed import PackedWorld, Work
from pushplan.sim.slip.kernels.placing import copy_rows
from pushplan.sim.slip.kernels.state import CONVERGED, FALLBACK, JAMMED, UNSOLVED, State
from pushplan.sim.slip.kernels.warm_start import predict

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
