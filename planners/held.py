"""Growing the tree from Python: the problem is handed over to compiled code once, not at each of the short calls.

Numba takes a tuple of arrays apart at every call, which takes 4 us for a problem; a reference to one takes 0.1 us.
It also looks up, at every call, the code for the arguments' types, which takes nearly 1 us for a reference: `grower`
does that once.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import typeof, types
from numba.core import config
from numba.experimental import structref

from pushplan.arrays import FloatArray
from pushplan.compiled import compiled, lean
from pushplan.planners.search import TRIES, Problem, extend
from pushplan.planners.steering import MAX_WORDS, connect


@structref.register
class _HeldType(types.StructRef):
    """Numba's type of what is held."""

    def preprocess_fields(self, fields: Any) -> Any:
        """Return the fields, their types freed from particular values."""
        return tuple((name, types.unliteral(kind)) for name, kind in fields)  # type: ignore[no-untyped-call]


class Held(structref.StructRefProxy):
    """A problem and a tree inside compiled code; made by `hold`."""

    problem: Problem
    nodes: FloatArray
    word: FloatArray


structref.define_proxy(Held, _HeldType, ["problem", "nodes", "word"])  # type: ignore[no-untyped-call]


class _HeldInPython(NamedTuple):
    """Stands in for `Held` where nothing is compiled."""

    problem: Problem
    nodes: FloatArray
    word: FloatArray


@compiled
def hold(problem: Problem, nodes: FloatArray, word: FloatArray) -> Held:
    """Return a reference for `grow_held`.

    Args:
        problem: What to plan.
        nodes: (capacity, NODE) the tree.
        word: (3, 4) where connections are written, as twists and lengths.
    """
    return Held(problem, nodes, word)  # type: ignore[no-untyped-call]


if config.DISABLE_JIT:  # type: ignore[attr-defined]  # for debuggers and coverage; there numba's reference would call itself for ever
    hold = _HeldInPython  # type: ignore[assignment]


@compiled
def grow_held(
    held: Held, count: int, parent: int, u0: float, u1: float, u2: float, bound: float
) -> tuple[bool, float, float, float, float]:
    """Grow the tree by one arc and try the exact connection from its end to the goal, in one compiled call.

    Args:
        held: The problem; the tree, whose row `count` is filled, unless `parent` is negative: then it is the root
            already; and where the connection goes.
        count: See `search.extend`.
        parent: See `search.extend`; negative to connect from the root alone.
        u0: The first of the controls, see `search.extend`.
        u1: The second one.
        u2: The third one.
        bound: Cost that a whole path must stay below.

    Returns:
        (kept, cost, x, y, theta): whether there is a new node; the cost of the whole path through it, infinite when
        the connection is blocked; and its pose.
    """
    return _grow(held.problem, held.nodes, held.word, count, parent, (u0, u1, u2), bound)


@lean
def _grow(
    problem: Problem,
    nodes: FloatArray,
    word: FloatArray,
    count: int,
    parent: int,
    controls: tuple[float, float, float],
    bound: float,
) -> tuple[bool, float, float, float, float]:
    """Do what `grow_held` promises."""
    if parent >= 0 and not extend(problem, nodes, count, parent, controls, bound):
        return False, np.inf, 0.0, 0.0, 0.0
    node = nodes[count]
    so_far = node[3]
    tries = MAX_WORDS if parent < 0 else TRIES
    limit = bound - so_far
    cost, promise = connect(problem.scene, problem.families, node[:3], problem.goal, limit, tries, word)
    return so_far + promise < bound or promise == np.inf, so_far + cost, node[0], node[1], node[2]


Grower = Callable[[Held, int, int, float, float, float, float], tuple[bool, float, float, float, float]]


def grower(held: Held) -> Grower:
    """Return `grow_held` for references like this one, without numba's look-up of types at every call."""
    if config.DISABLE_JIT:  # type: ignore[attr-defined]
        return grow_held
    kinds = (typeof(held), types.int64, types.int64, *[types.float64] * 4)  # type: ignore[no-untyped-call]
    grow_held.compile(kinds)  # or loads it
    return grow_held.get_overload(kinds)
