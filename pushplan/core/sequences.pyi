"""The cheapest sequence of pushes through a graph of poses of the load."""

from pushplan.util.arrays import FloatArray, IntArray

def cheapest_sequence(
    pushes: FloatArray, changes: FloatArray, first: FloatArray, goals: int, most: int
) -> tuple[float, IntArray]:
    """Find the cheapest sequence of pushes from node 0 to one of nodes 1 to `goals`.

    By the number of pushes, cheapest first, as in the recursion of Bellman and Ford.

    Args:
        pushes: (m, v, v) cost of a push by mode from node to node.
        changes: (v, m, m) cost of a change at a node from mode to mode.
        first: (m,) cost of what comes before a first push.
        goals: How many nodes are goals.
        most: Pushes, at most.

    Returns:
        The cost, infinite where there is none, and (k, 3) mode, first and last node of each push.
    """
