"""Groups of objects that the plate can hold, and pushes and transits among the other objects.

All poses are of the plate frame. It is the contact frame of every load here, because the plate pushes at the middle
of a face.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from pushplan.core.collision import SLACK, Scene, Shapes, sweep_is_free
from pushplan.core.driving import Surroundings, Wheels
from pushplan.core.problem import connect, reach
from pushplan.core.pushes import PackedMode, approaches_are_free, find_push, settles
from pushplan.core.transit import find_transit, shortened
from pushplan.errors import ChainError, EmptyStableSetError, PlanningError, TippingError
from pushplan.geometry import se2
from pushplan.geometry.convex import bounding_circle, convex_pieces, flatten
from pushplan.mechanics.faces import FacePair, Place, face_pairs
from pushplan.mechanics.support import UniformSupport
from pushplan.planners.controls import margins_to_try
from pushplan.planners.multi.contact_modes import ContactMode
from pushplan.planners.multi.room import AHEAD, NO_WALLS, packed_mode, reaches, wheels_of
from pushplan.planners.problem import Posing, obstacles_of, sampling_box, walls_of
from pushplan.planners.scene import scene_of, standing_shapes
from pushplan.plans.load import Load, Member, row_load
from pushplan.plans.path import PushPath
from pushplan.plans.segment import Poses, Segment
from pushplan.plans.settings import PlanSettings
from pushplan.scenario.model import Scenario
from pushplan.sets.force_limited_set import too_heavy_ahead
from pushplan.util.arrays import FloatArray
from pushplan.util.names import TRANSIT_CLEARANCE

SHORT = 0.02
"""Distance (m) before the next object at which a close begins."""

MARGIN = 0.08
"""Upper limit of the first margin to plan with.

Three boxes with pose errors of 3 mm and 2 deg and friction errors of 20 % end up to 9.4 mm off their places with
0.05, and up to 5.1 mm off with 0.08 and 0.12 (32 runs each). A car that holds two boxes drives a fifth farther with
0.12.
"""

FINE = 128
"""Meridians of a hand's stable set. A quarter of the usual number takes a quarter of the time for many hands."""

VIAS = 200
"""Number of intermediate poses for a push of two steering paths, tried if no single path is free."""

TRIED = 8
"""Number of these that are checked for collisions, cheapest first."""

EFFORT = 300
"""Maximum number of poses drawn in the search for a transit."""

Standing = tuple[tuple[str, bytes], ...]
"""Cache key: names and poses of all objects at rest."""


@dataclass(frozen=True, eq=False)
class Hand:
    """A group of objects that the plate holds.

    Attributes:
        mode: Contact mode of the held objects.
        packed: The mode in the core's form, for `margin`.
        margin: Margin to plan with.
        across: (3,) pose of the last object's front face; None if no face is opposite to the pushed one.
        body: Shapes of robot, plate and objects for the core, and their bounding circle.
        closes: Whether it can be pushed straight ahead, as a close requires.
    """

    mode: ContactMode
    packed: PackedMode
    margin: float
    across: FloatArray | None
    body: tuple[Shapes, FloatArray]
    closes: bool


@dataclass(frozen=True, eq=False)
class Pushed:
    """A push between two poses of the plate.

    Attributes:
        cost: Cost, m; infinite if no push was found.
        arcs: (k, 4) twists and lengths.
    """

    cost: float
    arcs: FloatArray


@dataclass(frozen=True, eq=False)
class Move:
    """A segment of a plan in the form that the search uses.

    Attributes:
        kind: One of `names.SEGMENT_KINDS`.
        members: Held objects; empty in a transit.
        start: (3,) pose of the plate.
        arcs: (k, 4) twists and lengths.
        onto: Name of the object that a close ends at.
    """

    kind: str
    members: tuple[Member, ...]
    start: FloatArray
    arcs: FloatArray
    onto: str = ""

    @classmethod
    def straight(
        cls, kind: str, members: tuple[Member, ...], start: FloatArray, length: float, onto: str = ""
    ) -> Move:
        """Return a straight move ahead, or back if the length is negative."""
        arcs = np.append(np.sign(length) * AHEAD, abs(length))[None]
        return cls(kind, members, start, arcs, onto)

    @property
    def path(self) -> PushPath:
        """Path of the plate."""
        return PushPath.of_arcs(self.start, self.arcs)


class Hands:
    """Factory of hands. Groups of objects that differ only in name share one hand.

    Args:
        scenario: Scenario with a row.
        settings: Complete settings.
        level: Level of the margins; 0 is the largest.
    """

    def __init__(self, scenario: Scenario, settings: PlanSettings, level: int = 0) -> None:
        self.scenario, self.settings, self.level = scenario, settings, level
        self.ways: dict[Member, FacePair] = {}
        self.forms: dict[Member, int] = {}
        self.why: dict[str, str] = {}
        self._modes: dict[tuple[int, ...], ContactMode | None] = {}
        self._hands: dict[tuple[int, ...], Hand | None] = {}
        self._loads: dict[tuple[Member, ...], Load] = {}
        self._sure: dict[tuple[int, ...], bool] = {}
        self.unsure: dict[str, None] = {}
        keys: dict[bytes, int] = {}
        for name in scenario.transport.row.of:
            obj = scenario.task.by_name[name].chain.objects[0]
            even = isinstance(obj.support, UniformSupport)  # outline and centre describe it fully
            load = obj.support.cells() if obj.support.known and not even else (obj.support.hull,)
            for way in face_pairs(obj.outline, scenario.transport.faces):
                key = b"".join(_form(scenario, name, way, load))
                self.ways[name, way.face] = way
                self.forms[name, way.face] = keys.setdefault(key, len(keys))

    def among(self, scenario: Scenario) -> Hands:
        """Return the hands for a scenario that differs only in its obstacles."""
        other = Hands(scenario, self.settings, self.level)
        other._modes, other._hands, other._sure = self._modes, self._hands, self._sure
        return other

    def lower(self) -> Hands:
        """Return the hands with the margins of the next level."""
        other = Hands(self.scenario, self.settings, self.level + 1)
        other._modes, other._loads, other._sure = self._modes, self._loads, self._sure
        other.unsure = self.unsure
        return other

    @property
    def levels(self) -> int:
        """Number of margins that can be tried."""
        return max((len(mode.margins) for mode in self._modes.values() if mode is not None), default=1)

    def least_margin(self, segments: tuple[Segment, ...]) -> float:
        """Return the smallest margin of the pushes in some segments, or of all hands if there are none."""
        kinds = {
            tuple(self.forms[link.object, link.face] for link in segment.load.links)
            for segment in segments
            if segment.load is not None
        }
        modes = [self._modes.get(kind) for kind in kinds or self._modes]
        return min((mode.margin(self.level) for mode in modes if mode is not None), default=0.0)

    def load(self, members: tuple[Member, ...]) -> Load:
        """Return the load of some members; cached."""
        if members not in self._loads:
            self._loads[members] = row_load(self.scenario, members)
        return self._loads[members]

    def hand(self, members: tuple[Member, ...]) -> Hand | None:
        """Return the hand of some members; None if they cannot be pushed together."""
        kind = tuple(self.forms[member] for member in members)
        if kind not in self._hands:
            self._hands[kind] = self._made(members, kind)
        return self._hands[kind]

    def held(self, members: tuple[Member, ...]) -> Hand:
        """Return the hand of members that a node holds.

        Raises:
            PlanningError: If they cannot be pushed together.
        """
        found = self.hand(members)
        if found is None:
            raise PlanningError(f"cannot push {', '.join(name for name, _ in members)} together")
        return found

    @property
    def holds_several(self) -> bool:
        """Whether some hand that was tried holds several objects."""
        return any(hand is not None for kind, hand in self._hands.items() if len(kind) > 1)

    def surely_closes(self, members: tuple[Member, ...]) -> bool:
        """Return whether the last member becomes flush with the others despite its pose error.

        If it does not, the hand counts as impossible from then on.
        """
        from pushplan.slip.closing import closes  # imports the slip simulator, which only rows need

        kind, hand = tuple(self.forms[member] for member in members), self.held(members)
        if kind not in self._sure:
            chain, other = self.load(members).chain, self.scenario.transport.row.friction[0]
            self._sure[kind] = closes(chain, SHORT, hand.packed.settle, other)
        if not self._sure[kind]:
            self._hands[kind] = None
            *held, last = (f"'{name}'" for name, _ in members)
            self.unsure[f"{last} may not become flush with {', '.join(held)}"] = None
        return self._sure[kind]

    def _made(self, members: tuple[Member, ...], kind: tuple[int, ...]) -> Hand | None:
        if kind not in self._modes:
            self._modes[kind] = self._mode(members)
        mode = self._modes[kind]
        if mode is None:
            return None
        margin = mode.margin(self.level)
        packed = packed_mode(mode, margin, self.scenario)
        if packed is None:
            why = too_heavy_ahead(mode.stable) or f"no straight push has a margin above {margin:.3g}"
            self.why.setdefault(members[0][0], why)
            return None
        across: FloatArray | None = np.zeros(3)
        for member in members:
            step = self.ways[member].across
            across = None if across is None or step is None else se2.compose(across, step)
        pieces = list(convex_pieces([body.outline for body in mode.load.chain.bodies]))
        body = flatten(pieces), bounding_circle(np.concatenate(pieces))
        return Hand(mode, packed, margin, across, body, bool(packed.settling[1] == 0.0))

    def _mode(self, members: tuple[Member, ...]) -> ContactMode | None:
        try:
            load = self.load(members)
            stable = load.stable_set(self.settings.set_name)
            margins = margins_to_try(load.problem, stable, MARGIN)
            place = Place((0,), load.face, 0.0, np.zeros(3), np.zeros(3))
            return ContactMode(place, load, stable, margins, np.zeros(3), Posing(meridians=FINE))
        except (ChainError, EmptyStableSetError, TippingError) as error:
            self.why.setdefault(members[0][0], str(error))
            return None


def _form(scenario: Scenario, name: str, way: FacePair, load: tuple[FloatArray, ...]) -> Iterator[bytes]:
    """Yield the data that identify an object and a pushed face, whatever the object's name."""
    body = scenario.task.by_name[name]
    obj, into = body.chain.objects[0], se2.inverse(way.entry)
    support = obj.support

    def placed(points: FloatArray, *columns: FloatArray) -> bytes:
        rows = np.column_stack([se2.transform_points(into, np.atleast_2d(points)), *columns])
        rows = np.round(rows, 7) + 0.0
        return rows[np.lexsort(rows.T)].tobytes()

    yield placed(obj.outline)
    yield type(support).__name__.encode() + placed(support.center)
    yield placed(*load)
    yield np.array([obj.mass, obj.floor_friction, body.chain.contacts[0].friction]).tobytes()
    yield body.chain.contact_heights.tobytes() + repr(obj.center_height).encode()
    if body.interval is not None:
        yield body.interval.mass.tobytes() + body.interval.floor_friction.tobytes()
        yield repr((dict(body.interval.fractions), dict(body.interval.pressures))).encode()


@dataclass(eq=False)
class Floor:
    """Collision scenes of the room for each set of objects at rest, and the pushes and transits in them.

    Args:
        scenario: Scenario with a row.
        seed: Seed of the random numbers.
    """

    scenario: Scenario
    seed: int
    wheels: Wheels = field(init=False)
    looked_at: int = 0

    def __post_init__(self) -> None:
        scenario = self.scenario
        alone = scenario.alone(scenario.loads[0].name)
        plate = se2.inverse(alone.chain.pusher.plate_pose)
        self._carried = [
            se2.transform_points(plate, part)
            for part in convex_pieces([body.outline for body in alone.chain.carried])
        ]
        drive = alone.chain.pusher.drive
        axle = None if drive.axle is None else se2.compose(plate, drive.axle)
        middle = bounding_circle(np.concatenate(self._carried))[:2]
        self.wheels = wheels_of(replace(drive, axle=axle), middle)
        polygons, self._discs = obstacles_of(scenario)
        self._fixed = list(convex_pieces(polygons))
        self._walls = np.array(walls_of(scenario), dtype=np.float64)
        self._outlines = {load.name: list(convex_pieces([load.chain.objects[0].outline])) for load in scenario.loads}
        self.box = sampling_box(alone)
        random = np.random.default_rng(self.seed)
        low, high = np.array(self.box[:2]), np.array(self.box[2:])
        places = random.uniform(low, high, size=(VIAS, 2))
        self._vias = np.column_stack([places, random.uniform(-np.pi, np.pi, VIAS)])
        clearance = scenario.clearance
        self._alone = scene_of(self._carried, self._fixed, self._discs, self._walls, clearance + SLACK, clearance)
        self._scenes: dict[Standing, Scene] = {}
        self._bodied: dict[tuple[Standing, int], Scene] = {}
        self._hands: dict[int, Hand] = {}
        self._reached: dict[int, bool] = {}
        self._berths: dict[str, Scene] = {}
        self._transits: dict[tuple[Standing, bytes, bytes], FloatArray | None] = {}

    def robot(self, standing: Poses) -> Scene:
        """Return the scene of the robot alone among objects at rest."""
        key = _key(standing)
        if key not in self._scenes:
            shapes = standing_shapes([*self._fixed, *self._rest(standing)], self._discs)
            self._scenes[key] = self._alone.with_obstacles(*shapes, self._walls)
        return self._scenes[key]

    def _rest(self, standing: Poses) -> Iterator[FloatArray]:
        for name, pose in standing.items():
            for piece in self._outlines[name]:
                yield se2.transform_points(pose, piece)

    def with_hand(self, hand: Hand, standing: Poses) -> Scene:
        """Return the scene of a hand among objects at rest."""
        key = (_key(standing), id(hand))
        if key not in self._bodied:
            self._hands[id(hand)] = hand  # kept alive, so that no other hand gets its id
            self._bodied[key] = self.robot(standing).with_body(*hand.body)
        return self._bodied[key]

    def push(self, hand: Hand, start: FloatArray, goal: FloatArray, standing: Poses) -> Pushed:
        """Return the cheapest collision-free push along one steering path."""
        self.looked_at += 1
        cost, arcs = find_push(self.with_hand(hand, standing), hand.packed, start, goal)
        return Pushed(cost, arcs)

    def push_by_way_of(self, hand: Hand, start: FloatArray, goal: FloatArray, standing: Poses) -> Pushed:
        """Return the cheapest collision-free push along two steering paths that meet at an intermediate pose."""
        self.looked_at += 1
        scene, packed = self.with_hand(hand, standing), hand.packed
        clearance = self.scenario.clearance
        none = Pushed(math.inf, np.zeros((0, 4)))
        if not sweep_is_free(scene, start, packed.settling, packed.settle):
            return none
        settled = se2.compose(start, packed.settling * packed.settle)
        first = reach(scene, packed.families, settled[None], self._vias, clearance)[0]
        near = np.flatnonzero(np.isfinite(first))
        if not len(near):
            return none
        second = reach(scene, packed.families, self._vias[near], goal[None], clearance)[:, 0]
        both = first[near] + second
        for k in np.argsort(both)[:TRIED]:
            if not math.isfinite(both[k]):
                break
            via = self._vias[near[k]]
            ways = [connect(scene, packed.families, *ends) for ends in ((settled, via), (via, goal))]
            if all(arcs is not None for _, _, arcs in ways):
                settle = np.append(packed.settling, packed.settle)[None]
                arcs = np.concatenate([settle, *(arcs for _, _, arcs in ways if arcs is not None)])
                return Pushed(packed.settle + sum(cost for cost, _, _ in ways), arcs)
        return none

    def settles(self, hand: Hand, at: FloatArray, standing: Poses) -> bool:
        """Return whether the settling push, which begins every push, is free."""
        return settles(self.with_hand(hand, standing), hand.packed, at)

    def closes(self, hand: Hand, start: FloatArray, length: float, standing: Poses) -> bool:
        """Return whether a straight push of a length (m) is free; `standing` lacks the object that it closes onto."""
        return sweep_is_free(self.with_hand(hand, standing), start, AHEAD, length)

    def approach(self, hand: Hand, at: FloatArray, standing: Poses, name: str, entry: FloatArray) -> bool:
        """Return whether the robot can approach a face of an object.

        The plate then is at pose `at` (3,). `entry` (3,) is the face's pose in the object's frame. `standing` does
        not include the object.
        """
        if not approaches_are_free(self.robot(standing), hand.packed, at[None], False)[0]:
            return False
        if id(hand) not in self._reached:
            self._hands[id(hand)] = hand
            self._reached[id(hand)] = reaches(self._beside(name, se2.inverse(entry)), hand.packed)
        return self._reached[id(hand)]

    def _beside(self, name: str, own: FloatArray) -> Scene:
        """Return the scene of the robot beside one object at a pose (3,)."""
        berth = max(self.scenario.clearance, TRANSIT_CLEARANCE)
        pieces = [se2.transform_points(own, piece) for piece in self._outlines[name]]
        beside = self._alone.with_obstacles(*standing_shapes(pieces, np.zeros((0, 3))), NO_WALLS)
        return beside.with_distances(berth + SLACK, berth)

    def retreats(self, hand: Hand, at: FloatArray, standing: Poses) -> bool:
        """Return whether the robot can back off after a push that ends with the plate at a pose (3,)."""
        return bool(approaches_are_free(self.robot(standing), hand.packed, at[None], True)[0])

    def transit(
        self, start: FloatArray, goal: FloatArray, standing: Poses, name: str, pose: FloatArray
    ) -> FloatArray | None:
        """Return the arcs (k, 4) of a transit to an object's approach; None if none was found."""
        key = (_key(standing), start.tobytes(), goal.tobytes())
        if key not in self._transits:
            self.looked_at += 1
            # A fresh random state makes each transit independent of earlier searches.
            state = np.array([self.seed], dtype=np.uint64)
            if name not in self._berths:
                self._berths[name] = self._beside(name, np.zeros(3))
            around = Surroundings(self.robot(standing), self._berths[name], pose)
            found = find_transit(around, self.wheels, start, goal, self.box, 1.0, state, EFFORT)
            if found is not None:
                found = shortened(around, self.wheels, start, found, state, 100)
            self._transits[key] = found
        return self._transits[key]


def _key(standing: Poses) -> Standing:
    return tuple((name, np.asarray(pose).tobytes()) for name, pose in standing.items())
