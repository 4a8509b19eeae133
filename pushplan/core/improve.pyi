"""Paths made shorter: by steering paths between their places, and by small changes of their twists and lengths."""

from pushplan.core.problem import Objective, Problem
from pushplan.util.arrays import FloatArray, RandomState

def objective_value(objective: Objective, path: FloatArray) -> float:
    """Return the value of a path (k, 4)."""

def merged(arcs: FloatArray) -> FloatArray:
    """Return a path (k, 4) without empty arcs and with neighbours of the same motion made one."""

def vary(problem: Problem, start: FloatArray, arcs: FloatArray, state: RandomState, attempts: int = 1) -> FloatArray:
    """Return a path (k, 4) after local changes: one arc changed and three closing it, each kept if it is cheaper.

    Args:
        problem: What to plan.
        start: (3,) pose at the path's beginning.
        arcs: (m, 4) twists and lengths of a path to the goal.
        state: (1,) state of the random generator.
        attempts: Changes to try.

    Raises:
        ValueError: On a path without arcs.
    """

def shorten(problem: Problem, start: FloatArray, arcs: FloatArray, state: RandomState, attempts: int) -> FloatArray:
    """Return the shortened path (k, 4) of twists and lengths.

    Args:
        problem: What to plan.
        start: (3,) pose at the path's beginning.
        arcs: (m, 4) the path.
        state: (1,) state of the random generator.
        attempts: Pairs of poses, or local changes, to try.
    """

def cut_short(problem: Problem, start: FloatArray, arcs: FloatArray, per_arc: float) -> FloatArray:
    """Return the path (k, 4) with pieces exchanged for free words that are shorter, or of fewer arcs.

    Args:
        problem: What to plan.
        start: (3,) pose at the path's beginning.
        arcs: (m, 4) twists and lengths.
        per_arc: What an arc counts beside its length, m.
    """
