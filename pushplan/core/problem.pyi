"""Objectives, problems, and the steering paths that connect their poses."""

from pushplan.core.collision import Scene
from pushplan.util.arrays import FloatArray, RandomState

TRAVEL: int
MARGIN: int
REST_TO_REST: int
PASSING: int
"""Kinds of objectives."""
GAIN: float
"""What is better by less, in the unit of the objective (m or s), is taken for rounding; not tuned."""
TURN_WEIGHT: float
"""What a radian of turning costs beside a metre of travel, m."""
LEFT: int
STRAIGHT: int
RIGHT: int
"""Rows of a family: (3, 3) body twists scaled to a cost rate of 1; a row of zeros is a motion that is not used."""
TRIES: int
"""Words that are swept, at most, in the attempt to connect a new node."""

class Objective:
    """What paths are ranked by; the table holds, for twists scaled to a cost rate of 1, what the kind needs.

    Attributes:
        kind: `TRAVEL` (no table), `MARGIN` (rate), `REST_TO_REST` or `PASSING` (top speed, time
            from rest to it, s, and the power of its length with which the time of a shorter arc grows).
        per_arc: Value of an arc beside its length.
        lowest: Smallest value of a metre of arc.
        length: Characteristic length of the twist sphere, m.
        box: (4,) first and last longitude, first and last latitude of the table, rad.
        table: (n, n, 3) by longitude and latitude.
    """

    def __init__(
        self, kind: int, per_arc: float, lowest: float, length: float, box: FloatArray, table: FloatArray
    ) -> None: ...
    @property
    def kind(self) -> int: ...
    @property
    def per_arc(self) -> float: ...
    @property
    def lowest(self) -> float: ...
    @property
    def length(self) -> float: ...
    @property
    def box(self) -> FloatArray: ...
    @property
    def table(self) -> FloatArray: ...

class Problem:
    """What a search needs to know.

    Attributes:
        scene: The body and what it must not touch.
        segments: (k, 6) stable twists between two end twists: every positive combination of them is stable.
        families: (f, 3, 3) left, straight and right twists for exact connections.
        goal: (3,) pose of the chain frame in the world.
        longest: Longest arc sampled, m of cost.
        objective: What makes one path better than another.
    """

    def __init__(
        self,
        scene: Scene,
        segments: FloatArray,
        families: FloatArray,
        goal: FloatArray,
        longest: float,
        objective: Objective,
    ) -> None: ...
    @property
    def scene(self) -> Scene: ...
    @property
    def segments(self) -> FloatArray: ...
    @property
    def families(self) -> FloatArray: ...
    @property
    def goal(self) -> FloatArray: ...
    @property
    def longest(self) -> float: ...
    @property
    def objective(self) -> Objective: ...
    def with_goal(self, goal: FloatArray) -> Problem:
        """Return it with another goal (3,)."""

    def with_segments(self, segments: FloatArray) -> Problem:
        """Return it with other stable twists (k, 6)."""

    def with_objective(self, objective: Objective) -> Problem:
        """Return it with another objective."""

def remaining(pose: FloatArray, goal: FloatArray) -> float:
    """Return a lower bound on the cost from a pose (3,) to the goal: straight travel plus the smallest turn."""

def random(state: RandomState) -> float:
    """Draw a number in [0, 1) from the generator's state (1,) uint64 (splitmix64, Steele et al. 2014)."""

def find_words(family: FloatArray, start: FloatArray, goal: FloatArray) -> FloatArray:
    """Return cost, letters and lengths (n, 7) of every word of a family (3, 3) between two poses (3,)."""

def connect(
    scene: Scene, families: FloatArray, start: FloatArray, goal: FloatArray, bound: float = ..., tries: int = ...
) -> tuple[float, float, FloatArray | None]:
    """Find the cheapest free connection below a bound.

    Args:
        scene: The body and what it must not touch.
        families: (f, 3, 3) left, straight and right twists; f is at most 3.
        start: (3,) pose.
        goal: (3,) pose.
        bound: Only words cheaper than this are looked at; infinite if nothing is given.
        tries: So many words, cheapest first, are swept for collisions at most; all if nothing is given.

    Returns:
        (cost, promise, arcs): the connection's cost, infinite if there is none; the cheapest word's cost,
        free or not; and the connection's twists and lengths (3, 4), None if there is none.

    Raises:
        ValueError: On more families.
    """

def reach(scene: Scene, families: FloatArray, starts: FloatArray, goals: FloatArray, clearance: float) -> FloatArray:
    """Return the costs (n, m) of the cheapest free words from starts (n, 3) to goals (m, 3), inf where none is.

    Args:
        scene: One of `open_scene`; between two poses it keeps what the nearer of them leaves, see `Scene.with_gap`.
        families: (f, 3, 3) left, straight and right twists.
        starts: Poses of the chain frame.
        goals: Likewise.
        clearance: What start and goal must have at least, m.
    """

def arcs_at(problem: Problem, controls: FloatArray) -> FloatArray:
    """Return the arcs (k, 4), twists and lengths, of controls (k, 4): coordinates, and units that they go on for."""

def controls_of(problem: Problem, arcs: FloatArray) -> FloatArray:
    """Return controls (k, 4) of arcs (k, 4), with whole units; not finite where a twist is on no segment."""

def poses_along(scene: Scene, start: FloatArray, arcs: FloatArray) -> tuple[FloatArray, int]:
    """Return the poses (k + 1, 3) at the ends of arcs (k, 4), and how many arcs come before one that is not free."""
