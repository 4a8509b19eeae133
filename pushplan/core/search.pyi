"""What grows trees of arcs, one class for each way."""

from pushplan.core.collision import Scene
from pushplan.core.problem import Problem
from pushplan.util.arrays import FloatArray, RandomState

class Tree:
    """A tree that another program drives, OMPL's planners, which say from where and along what it grows.

    An extension is (kept, cost, promise, x, y, theta): whether there is a new node that may be on a path below the
    bound; the cost of the whole path through it, infinite when all connections are blocked; the cost of the cheapest
    word to the other tree's root, blocked or not; and its pose.

    Args:
        problem: What to plan.
        root: (3,) pose.
        heading_length: Metres that a radian counts as in the choice of the other tree's nearest nodes.
        back: The tree grows against the direction of travel: its arcs lead to the root.
    """

    def __init__(self, problem: Problem, root: FloatArray, heading_length: float, back: bool = False) -> None: ...
    def take(self, problem: Problem) -> None:
        """Go on with another problem."""

    def clear(self, root: FloatArray) -> None:
        """Forget the tree but for its root."""

    def __len__(self) -> int: ...
    @property
    def nodes(self) -> FloatArray:
        """The tree, a copy (n, 9): pose, cost to the root, parent, arc between both (vx, vy, omega, length)."""

    @property
    def path(self) -> FloatArray | None:
        """The path (k, 4) that the last connection closed, from the start to the goal; None before the first one."""

    def extend(
        self,
        row: int,
        pose: tuple[float, float, float],
        controls: tuple[float, float, float],
        bound: float,
        other: Tree,
    ) -> tuple[bool, float, float, float, float, float]:
        """Grow by one arc from the pose of a row, and try to connect its end exactly to a tree that grows towards it.

        Args:
            row: Of the parent; what is kept becomes the last row. -1 where no arc led to the pose: nothing becomes a
                row then.
            pose: x, y and theta.
            controls: Which segment of the stable set, where on it, and the share of the longest arc, in [0, 1].
            bound: Cost that a whole path must stay below.
            other: The tree, whose root and two nearest nodes are tried.

        Returns:
            Whether it was kept, the cost of the whole path, that of the cheapest word, and the pose.

        Raises:
            ValueError: Where the row or a number is none, or both trees grow the same way.
        """

    def connect(self, row: int, pose: tuple[float, float, float], bound: float, other: Tree) -> tuple[float, float]:
        """Return the cost of a path through a row (-1: none) and any free word, and the cost of the cheapest word.

        The words are those to the root of the other tree.
        """

    def room_at(self, x: float, y: float, theta: float) -> float:
        """Return how far (m) the body is from everything at a pose, beyond the clearance; negative if too near.

        Distances above twice the clearance are not told apart.
        """

def branch(nodes: FloatArray, node: int) -> FloatArray:
    """Return the arcs (k, 4) from the root of a tree (n, 9) to a node."""

class Lattice:
    """Best-first search over a lattice of poses: one at a time, the next one takes over the memory.

    Args:
        problem: What to plan.
        start: (3,) pose.
        middle: (2 or more,) the body's point for which distances over the floor count, chain frame, m.
        grid: (3,) lower left corner of their cells and the side of these, m.
        to_start: (nx, ny) distance of a place from the start around the obstacles, m.
        to_goal: Likewise from the goal.
    """

    def __init__(
        self,
        problem: Problem,
        start: FloatArray,
        middle: FloatArray,
        grid: FloatArray,
        to_start: FloatArray,
        to_goal: FloatArray,
    ) -> None: ...
    def plant(self, back: bool, box: FloatArray, side: float, angle: float, arc: float, room: int) -> None:
        """Begin a search with the start alone.

        Args:
            back: Search from the goal back to the start instead.
            box: (4,) xmin, ymin, xmax, ymax that the cells cover, m.
            side: Of a cell, m.
            angle: Of a cell, rad.
            arc: Typical length of an arc, m of cost.
            room: For so many nodes, a power of two.
        """

    def expand(self, state: RandomState, bound: float, arcs: int) -> tuple[float, bool]:
        """Expand nodes, the most promising first, until arcs are tried or nothing promises less than the bound.

        Args:
            state: (1,) of the random generator.
            bound: Cost that a path must stay below, m; falls to that of each path that is found.
            arcs: To try; may be exceeded by three.

        Returns:
            The bound then, and whether the search is over.
        """

    @property
    def path(self) -> FloatArray | None:
        """The best path (k, 4), None while there is none."""

    @property
    def tried(self) -> int:
        """Arcs tried."""

    @property
    def nodes(self) -> FloatArray:
        """The nodes (n, 9), a copy; see `Tree.nodes`."""

def floor_distances(
    point: Scene, grid: FloatArray, columns: int, rows: int, least: float, start: FloatArray, goal: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the lengths (columns, rows) of ways to the start and to the goal, m.

    They lead through cells whose middles keep `least` from everything. Steps to or from other cells count as ways
    along all the floor: a gap that the cells miss is not closed, but looked at last.

    Args:
        point: A scene in which a point moves.
        grid: (3,) lower left corner of the cells and their side, m.
        columns: Number of cells along x.
        rows: Number of cells along y.
        least: Distance from everything, m.
        start: (2,) m.
        goal: (2,) m.
    """
