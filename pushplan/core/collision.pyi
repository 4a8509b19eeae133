"""The chain against the obstacles: separation and swept arcs, and the scene they are asked in.

A swept arc is proven free by conservative advancement (Mirtich 1996): from a pose whose separation from
every obstacle is d, no point of the body can touch anything before it has travelled d.
"""

from pushplan.util.arrays import FloatArray, IntArray

SLACK: float
"""Distance beyond the clearance, m, that the poses looked at have, so that those between can be proven to keep it."""
ROUNDING: float
"""Start and goal may fail by rounding to have the distance they have, m."""
CLEARANCE_ROOM: float
"""What is proven between poses is less than the clearance by so much at most, m."""

class Shapes:
    """Convex polygons, flattened.

    Attributes:
        corners: (v, 4) counter-clockwise corners and the outward unit normal of the edge that begins there.
        starts: (q + 1,) index of each polygon's first corner.
        bounds: (q, 3) centre and radius of a circle around each polygon.
    """

    def __init__(self, corners: FloatArray, starts: IntArray, bounds: FloatArray) -> None: ...
    @property
    def corners(self) -> FloatArray: ...
    @property
    def starts(self) -> IntArray: ...
    @property
    def bounds(self) -> FloatArray: ...

class Scene:
    """What moves and what stands still.

    Attributes:
        body: Convex pieces of pusher and objects in the chain frame.
        body_bound: (3,) centre and radius of a circle around the body, chain frame.
        obstacles: Convex pieces of the polygonal obstacles, world frame.
        circles: (c, 3) centre and radius of the round obstacles, world frame.
        tree: (t, 9) boxes around groups of obstacles, a tree in preorder; see `standing_shapes`.
        walls: (4,) workspace (xmin, ymin, xmax, ymax); infinite where there is none.
        clearance: Distance (m) from everything at the poses that are looked at.
        kept: Distance (m), smaller, that is proven between these poses.
    """

    def __init__(
        self,
        body: Shapes,
        body_bound: FloatArray,
        obstacles: Shapes,
        circles: FloatArray,
        tree: FloatArray,
        walls: FloatArray,
        clearance: float,
        kept: float,
    ) -> None: ...
    @property
    def body(self) -> Shapes: ...
    @property
    def body_bound(self) -> FloatArray: ...
    @property
    def obstacles(self) -> Shapes: ...
    @property
    def circles(self) -> FloatArray: ...
    @property
    def tree(self) -> FloatArray: ...
    @property
    def walls(self) -> FloatArray: ...
    @property
    def clearance(self) -> float: ...
    @property
    def kept(self) -> float: ...
    def with_distances(self, clearance: float, kept: float) -> Scene:
        """Return a scene that keeps other distances, m."""

    def with_gap(self, gap: float, clearance: float) -> Scene:
        """Return a scene with the distances that can be kept where start and goal have the distance `gap`, m.

        The poses looked at keep that, or the clearance if that is more; those between keep the clearance, less
        `CLEARANCE_ROOM` at most where start and goal leave no room to prove it.
        """

    def with_body(self, body: Shapes, body_bound: FloatArray) -> Scene:
        """Return a scene in which something else moves."""

    def with_obstacles(self, obstacles: Shapes, circles: FloatArray, tree: FloatArray, walls: FloatArray) -> Scene:
        """Return a scene in which something else stands."""

def flatten(corners: FloatArray, starts: IntArray) -> Shapes:
    """Return convex polygons with edge normals and bounding circles.

    Args:
        corners: (v, 2) counter-clockwise, polygon after polygon.
        starts: (q + 1,) index of each polygon's first corner.
    """

def bulges(corners: FloatArray, starts: IntArray) -> tuple[FloatArray, IntArray]:
    """Return how far corners stand out of polygons, (v,), < 0 inwards, m, and which of these turn left, (q,), 0 or 1.

    Args:
        corners: (v, 2), polygon after polygon.
        starts: (q + 1,) index of each polygon's first corner.
    """

def standing_shapes(
    corners: FloatArray, starts: IntArray, circles: FloatArray
) -> tuple[Shapes, FloatArray, FloatArray]:
    """Return obstacles in the order of their tree.

    It is halved at the median along the longer side of the extent of the obstacles' centres.

    Args:
        corners: (v, 2) of convex polygons, counter-clockwise, polygon after polygon.
        starts: (q + 1,) index of each polygon's first corner.
        circles: (c, 3) centre and radius of round obstacles.

    Returns:
        The polygons; the circles (c, 3); and (t, 9) nodes in preorder: box, row of the next node that is not below
        it, and for leaves first and last + 1 of its polygons and of its circles, empty ranges for other nodes.
    """

def join_triangles(corners: FloatArray, origin: IntArray, twin: IntArray) -> tuple[IntArray, IntArray]:
    """Join triangles to convex pieces (Hertel and Mehlhorn 1983).

    Args:
        corners: (n, 2) points.
        origin: (3 t,) the point that each edge begins at, three edges a triangle.
        twin: (3 t,) the edge that runs along each the other way, or -1.

    Returns:
        The corners (k,) of convex pieces, piece after piece, and where each begins (p + 1,).
    """

def separations(scene: Scene, poses: FloatArray, enough: float) -> FloatArray:
    """Return lower bounds (m,) on the distance of the body at poses (m, 3) from everything, capped at `enough`, m."""

def sweep_is_free(scene: Scene, pose: FloatArray, twist: FloatArray, length: float) -> bool:
    """Return whether the body keeps clear of everything along an arc from a pose (3,): proven, never merely sampled.

    Every pose looked at has `scene.clearance`, every one between has `scene.kept` at least: a separation d at s
    covers all s' with |s' - s| <= (d - kept) / (top speed of the body). Intervals are looked at in the
    middle first, where a collision shows soonest. An arc that comes closer than `scene.clearance` may be refused.
    """
