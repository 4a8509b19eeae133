"""The cheapest sequence of pushes through a graph of poses of the load, and the cheapest tour through loads."""

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

def cheapest_tours(ways: list[FloatArray], pushes: list[FloatArray]) -> FloatArray:
    """Return what the cheapest tours cost through each set of n loads (by bits) from each end of a push, (2^n, k).

    Each load is pushed once, by one of its contacts to one of its ends: those of all loads, one after another, are k.
    By the recursion of Held and Karp (1962).

    Args:
        ways: n times what the ways from all ends to the contacts of a load cost, (k, m).
        pushes: n times what its pushes cost by contact and end, each load alone being at its goal (0), or not brought
            there yet (1), (n, 2, m, e); the dearest of these counts.
    """
