"""Growing the tree from Python: the problem is handed over to compiled code once, not at each of the short calls.

Numba takes a tuple of arrays apart at every call, which takes 4 us for a problem; a reference to one takes 0.1 us.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.core import config
from numba.experimental import structref

from pushplan.arrays import FloatArray
from pushplan.compiled import compiled
from pushplan.planners.search import TRIES, Problem, extend
from pushplan.planners.steering import MAX_WORDS, connect


@structref.register
class _HeldType(types.StructRef):
    """Numba's type of a problem that is held."""

    def preprocess_fields(self, fields: Any) -> Any:
        """Return the fields, their types freed from particular values."""
        return tuple((name, types.unliteral(kind)) for name, kind in fields)  # type: ignore[no-untyped-call]


class Held(structref.StructRefProxy):
    """A problem inside compiled code; made by `hold`."""

    problem: Problem


structref.define_proxy(Held, _HeldType, ["problem"])  # type: ignore[no-untyped-call]


class _HeldInPython(NamedTuple):
    """Stands in for `Held` where nothing is compiled."""

    problem: Problem


@compiled
def hold(problem: Problem) -> Held:
    """Return a reference to a problem for `grow_held`."""
    return Held(problem)  # type: ignore[no-untyped-call]


if config.DISABLE_JIT:  # type: ignore[attr-defined]  # for debuggers and coverage; there numba's reference would call itself for ever
    hold = _HeldInPython  # type: ignore[assignment]


@compiled
def grow_held(
    held: Held,
    nodes: FloatArray,
    count: int,
    parent: int,
    u0: float,
    u1: float,
    u2: float,
    bound: float,
    word: FloatArray,
) -> tuple[bool, float]:
    """Grow the tree by one arc and try the exact connection from its end to the goal, in one compiled call.

    Args:
        held: What to plan.
        nodes: The tree; row `count` is filled, unless `parent` is negative: then it is the root already.
        count: See `search.extend`.
        parent: See `search.extend`; negative to connect from the root alone.
        u0: See `search.extend`.
        u1: See `search.extend`.
        u2: See `search.extend`.
        bound: Cost that a whole path must stay below.
        word: (3, 4) filled with the connection's twists and lengths.

    Returns:
        (kept, cost): whether there is a new node; and the cost of the whole path through it, infinite when
        the connection is blocked.
    """
    problem = held.problem
    if parent >= 0 and not extend(problem, nodes, count, parent, u0, u1, u2, bound):
        return False, np.inf
    so_far = nodes[count, 3]
    tries = MAX_WORDS if parent < 0 else TRIES
    cost, promise = connect(
        problem.scene, problem.families, nodes[count, :3], problem.goal, bound - so_far, tries, word
    )
    return so_far + promise < bound or promise == np.inf, so_far + cost
