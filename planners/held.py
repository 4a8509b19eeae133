"""A problem handed over to compiled code once, for calls from Python that are too short to hand it over each time.

Numba takes a tuple of arrays apart at every call, which takes 4 us for a problem; a reference to one takes 0.1 us.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba import types
from numba.core import config
from numba.experimental import structref

from pushplan.arrays import FloatArray
from pushplan.compiled import compiled
from pushplan.planners.search import Problem, grow


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
    """Grow the tree by one arc; see `search.grow`."""
    return grow(held.problem, nodes, count, parent, u0, u1, u2, bound, word)
