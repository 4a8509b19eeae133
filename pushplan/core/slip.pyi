"""Quasi-static pushing in which contacts stick, slide, roll off an end, open and close again."""

from pushplan.util.arrays import FloatArray, IntArray

OPEN: int
STICK: int
SLIDE: int
ROLL: int
ROLL_SLIDE: int
"""What a contact does: nothing; both ends hold; both touch and slide; one end holds; one touches and slides."""

CONVERGED: int
FALLBACK: int
UNSOLVED: int
JAMMED: int
CROWDED: int
STALLED: int
"""How a step ended: by Newton's method; with the fallback's help; no motion was found that balances all forces; no
motion satisfies all contacts; more manifolds than there is room for; the plate would have to push with more force
than it has. After the last four nothing has moved."""

class World:
    """What does not change while bodies are pushed about.

    Bodies are counted: the n objects, then the pusher (n), then all that stands still (n + 1).
    """

    def __init__(
        self,
        *,
        feet: FloatArray,
        first_foot: IntArray,
        loads: FloatArray,
        center: FloatArray,
        corners: FloatArray,
        parts: IntArray,
        circles: FloatArray,
        pairs: IntArray,
        friction: FloatArray,
        length: float,
        order: IntArray,
    ) -> None:
        """Make a world of what its properties say.

        Raises:
            ValueError: When sizes do not fit, or a piece, pair or foot is of nothing that is there.
        """

    def with_loads(self, friction_loads: FloatArray, foot_loads: FloatArray, contact_frictions: FloatArray) -> World:
        """Return the world with other frictions and loads, weights the same.

        Args:
            friction_loads: (n,) sum of mu N of every object, N.
            foot_loads: (f,) mu N of every foot, N.
            contact_frictions: (k,) coefficients of the chain's contacts.

        Raises:
            ValueError: On other sizes.
        """

    @property
    def feet(self) -> FloatArray:
        """(f, 4) x, y in the object's frame (m), mu N (N), share in carrying a load that shifts."""

    @property
    def first_foot(self) -> IntArray:
        """(n + 1,) where the feet of each object begin."""

    @property
    def loads(self) -> FloatArray:
        """(n, 5) sum of mu N (N), h mu (m), second moments of the stiffness xx, xy, yy (m^2)."""

    @property
    def center(self) -> FloatArray:
        """(n, 2) stiffness centre in the object's frame, m."""

    @property
    def corners(self) -> FloatArray:
        """(v, 5) x, y (m) and outward normal of the edge that begins there, in the body's frame, and 1 or 0.

        0 where the edge is no piece of the outline but parts two convex pieces.
        """

    @property
    def parts(self) -> IntArray:
        """(p, 3) body, first corner, one past the last, of each convex piece; one corner is a disc."""

    @property
    def circles(self) -> FloatArray:
        """(p, 4) centre and radius (m) of a circle around each piece in the body's frame, rounding of its corners."""

    @property
    def pairs(self) -> IntArray:
        """(q, 3) pieces a and b that may touch, and the chain's contact whose bodies these are, or -1."""

    @property
    def friction(self) -> FloatArray:
        """(q,) coefficient between them."""

    @property
    def length(self) -> float:
        """Characteristic length L, m."""

    @property
    def order(self) -> IntArray:
        """(n,) the caller's number of every object: the order of poses and columns outside."""

    @property
    def room(self) -> int:
        """Manifolds that a step has room for: 16 an object and 16 more, or one for every pair."""

class Trace:
    """What m steps leave behind; columns are the caller's objects."""

    @property
    def poses(self) -> FloatArray:
        """(m, n, 3) of the objects after every step."""

    @property
    def modes(self) -> IntArray:
        """(m, n) of the chain's contacts, `OPEN` to `ROLL_SLIDE`."""

    @property
    def forces(self) -> FloatArray:
        """(m, n, 3) of the chain's contacts: normal force at the right and the left end, tangential force, N."""

    @property
    def wrenches(self) -> FloatArray:
        """(m, 3) with which the plate pushes on all that it touches, in its own frame: N, N, N m."""

    @property
    def others(self) -> IntArray:
        """(m, n) number of other active contacts of every object.

        With obstacles, walls, or bodies it was not stacked on.
        """

    @property
    def residual(self) -> FloatArray:
        """(m,) of the balance, over the sum of mu N of all objects."""

    @property
    def end(self) -> IntArray:
        """(m,) how every step ended, `CONVERGED` to `STALLED`."""

class Simulation:
    """Where everything is, and the last step's solution, with which the next one begins."""

    def __init__(self, world: World, object_poses: FloatArray, plate_pose: FloatArray) -> None:
        """Place everything, at rest and without contact forces.

        Args:
            world: What there is.
            object_poses: (n, 3) of the caller's objects, in the world.
            plate_pose: (3,) of the frame that the plate is moved in.

        Raises:
            ValueError: On other shapes.
        """

    @property
    def world(self) -> World:
        """What there is."""

    @property
    def object_poses(self) -> FloatArray:
        """(n, 3) of the caller's objects, in the world."""

    @property
    def plate_pose(self) -> FloatArray:
        """(3,) of the frame that the plate is moved in."""

    def march(self, twists: FloatArray, limit: float = ...) -> Trace:
        """Move the plate by body twists times time (m, 3), one after the other, and the objects with it.

        It ends early where there is no solution, more manifolds than there is room for, or the plate would have to
        push with more than `limit` (N; infinite unless it is given); the step that ended it is the last one in the
        trace. The interpreter's lock is let go meanwhile.

        Raises:
            ValueError: On another shape.
        """
