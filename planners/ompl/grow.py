"""Tree growth that OMPL planners drive: one compiled call an extension, its state kept in a handle."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba import typeof, types
from numba.experimental import structref

from pushplan.compiled import compiled, no_refcount
from pushplan.compiled.private import COMPILES, entry_point
from pushplan.planners.collision.separation import separation
from pushplan.planners.problem.problem import TRIES, Problem, extend
from pushplan.planners.problem.steering import MAX_WORDS, connect
from pushplan.util.arrays import FloatArray


@structref.register
class _HandleType(types.StructRef):
    """Numba's type of a handle."""

    def preprocess_fields(self, fields: Any) -> Any:
        """Return the fields, their types freed from particular values."""
        return tuple((name, types.unliteral(kind)) for name, kind in fields)  # type: ignore[no-untyped-call]


class Handle(structref.StructRefProxy):
    """A problem and a tree inside compiled code; made by `make_handle`."""

    problem: Problem
    nodes: FloatArray
    word: FloatArray


structref.define_proxy(Handle, _HandleType, ["problem", "nodes", "word"])  # type: ignore[no-untyped-call]


class _HandleInPython(NamedTuple):
    """Stands in for `Handle` where nothing is compiled."""

    problem: Problem
    nodes: FloatArray
    word: FloatArray


@compiled
def make_handle(problem: Problem, nodes: FloatArray, word: FloatArray) -> Handle:
    """Return a reference for `grow`.

    Args:
        problem: What to plan.
        nodes: (capacity, NODE) the tree.
        word: (3, 4) where connections are written, as twists and lengths.
    """
    return Handle(problem, nodes, word)  # type: ignore[no-untyped-call]


if not COMPILES:  # for debuggers and coverage; there numba's reference would call itself for ever
    make_handle = _HandleInPython  # type: ignore[assignment]


@compiled
def grow(
    handle: Handle, count: int, parent: int, u0: float, u1: float, u2: float, bound: float
) -> tuple[bool, float, float, float, float, float]:
    """Grow the tree by one arc and try the exact connection from its end to the goal, in one compiled call.

    Args:
        handle: The problem; the tree, whose row `count` is filled, unless `parent` is negative: then it is already;
            and where the connection goes.
        count: See `search.extend`.
        parent: See `search.extend`; negative to connect from the row alone, by any word.
        u0: The first of the controls, see `search.extend`.
        u1: The second one.
        u2: The third one.
        bound: Cost that a whole path must stay below.

    Returns:
        (kept, cost, promise, x, y, theta): whether there is a new node that may be on a path below the bound; the
        cost of the whole path through it, infinite when the connection is blocked; the cost of the cheapest word from
        it, blocked or not; and its pose.
    """
    return _grow(handle.problem, handle.nodes, handle.word, count, parent, (u0, u1, u2), bound)


@compiled
def room_at(handle: Handle, x: float, y: float, theta: float) -> float:
    """Return how far (m) the body is from everything at a pose, beyond the clearance; negative where it is too near.

    Distances above twice the clearance are not told apart.
    """
    scene = handle.problem.scene
    return separation(scene, x, y, theta, 2.0 * scene.clearance) - scene.clearance


@no_refcount
def _grow(
    problem: Problem,
    nodes: FloatArray,
    word: FloatArray,
    count: int,
    parent: int,
    controls: tuple[float, float, float],
    bound: float,
) -> tuple[bool, float, float, float, float, float]:
    """Do what `grow` promises."""
    if parent >= 0 and not extend(problem, nodes, count, parent, controls, bound):
        return False, np.inf, np.inf, 0.0, 0.0, 0.0
    node = nodes[count]
    so_far = node[3]
    tries = MAX_WORDS if parent < 0 else TRIES
    limit = bound - so_far
    cost, promise = connect(problem.scene, problem.families, node[:3], problem.goal, limit, tries, word)
    kept = so_far + promise < bound or promise == np.inf
    return kept, so_far + cost, promise, node[0], node[1], node[2]


Grow = Callable[
    [Handle, int, int, float, float, float, float], tuple[bool, float, float, float, float, float]
]
RoomAt = Callable[[Handle, float, float, float], float]


def ready(handle: Handle) -> tuple[Grow, RoomAt]:
    """Return `grow` and `room_at` for references like this one, without numba's look-up of types at every call."""
    if not COMPILES:
        return grow, room_at
    return _ready(typeof(handle))  # type: ignore[no-untyped-call]


@cache
def _ready(kind: Any) -> tuple[Grow, RoomAt]:
    """Return both functions for a type of reference."""
    whole, real = types.int64, types.float64
    return (
        entry_point(grow, (kind, whole, whole, real, real, real, real)),
        entry_point(room_at, (kind, real, real, real)),
    )
