"""What the plate can hold of objects that stand apart, and what pushes and transits among the rest cost.

Everything is in the plate frame, which is the contact frame of every load here: the plate pushes at the middle of a
face.
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
from pushplan.mechanics.faces import Place, Through, ways_through
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
"""A close begins so far (m) before the object that it ends at."""

MARGIN = 0.08
"""Margin to plan with first, where there are larger ones. With 0.05, three boxes that stand 3 mm and 2 deg off end up
to 9.4 mm off their places where frictions are 20 % off, with 0.08 and 0.12 up to 5.1 mm (32 runs each); a car that
holds two drives a fifth farther with 0.12."""

FINE = 128
"""Meridians of stable sets that twists are taken from: there may be many hands, and a quarter takes a quarter."""

VIAS = 200
"""Poses through which a push may lead in two words where no single one is free."""

TRIED = 8
"""So many of them are swept, cheapest first."""

EFFORT = 300
"""Poses drawn in search of a transit, at most."""

Standing = tuple[tuple[str, bytes], ...]
"""Names and poses of all objects that rest, as a key."""


@dataclass(frozen=True, eq=False)
class Hand:
    """Objects that the plate holds.

    Attributes:
        mode: How they are pushed.
        packed: The same for the core, with the margin that is planned with.
        margin: That one.
        across: (3,) pose of the front of the last object; None where it has no face opposite to the one pushed.
        body: Robot, plate and objects for the core, and a circle around them.
        closes: It can be pushed straight ahead, as it is where a contact closes.
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
        cost: m; infinite where none was found.
        arcs: (k, 4) twists and lengths.
    """

    cost: float
    arcs: FloatArray


@dataclass(frozen=True, eq=False)
class Move:
    """A segment of a plan, as the search has it.

    Attributes:
        kind: One of `names.SEGMENT_KINDS`.
        members: What is held; none in a transit.
        start: (3,) pose of the plate.
        arcs: (k, 4) twists and lengths.
        onto: What a close ends at.
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
        """Return a straight move ahead, or back where the length is negative."""
        arcs = np.append(np.sign(length) * AHEAD, abs(length))[None]
        return cls(kind, members, start, arcs, onto)

    @property
    def path(self) -> PushPath:
        """Of the plate."""
        return PushPath.of_arcs(self.start, self.arcs)


class Hands:
    """Makes hands, each kind once: objects that are the same are one kind, whatever they are called.

    Args:
        scenario: With a row.
        settings: Complete.
        level: Of the margins: 0 for the largest.
    """

    def __init__(self, scenario: Scenario, settings: PlanSettings, level: int = 0) -> None:
        self.scenario, self.settings, self.level = scenario, settings, level
        self.ways: dict[Member, Through] = {}
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
            even = isinstance(obj.support, UniformSupport)  # which its outline and its centre tell all of
            load = obj.support.cells() if obj.support.known and not even else (obj.support.hull,)
            for way in ways_through(obj.outline, scenario.transport.faces):
                key = b"".join(_form(scenario, name, way, load))
                self.ways[name, way.face] = way
                self.forms[name, way.face] = keys.setdefault(key, len(keys))

    def among(self, scenario: Scenario) -> Hands:
        """Return the same for a scenario that differs in what stands in the room."""
        other = Hands(scenario, self.settings, self.level)
        other._modes, other._hands, other._sure = self._modes, self._hands, self._sure
        return other

    def lower(self) -> Hands:
        """Return the same with the margins of the next level."""
        other = Hands(self.scenario, self.settings, self.level + 1)
        other._modes, other._loads, other._sure = self._modes, self._loads, self._sure
        other.unsure = self.unsure
        return other

    @property
    def levels(self) -> int:
        """How many margins can be tried, one after the other."""
        return max((len(mode.margins) for mode in self._modes.values() if mode is not None), default=1)

    def least_margin(self, segments: tuple[Segment, ...]) -> float:
        """Return the smallest margin to plan with: of the pushes of some segments, of all hands without any."""
        kinds = {
            tuple(self.forms[link.object, link.face] for link in segment.load.links)
            for segment in segments
            if segment.load is not None
        }
        modes = [self._modes.get(kind) for kind in kinds or self._modes]
        return min((mode.margin(self.level) for mode in modes if mode is not None), default=0.0)

    def load(self, members: tuple[Member, ...]) -> Load:
        """Return the load of some members; the same object for the same ones."""
        if members not in self._loads:
            self._loads[members] = row_load(self.scenario, members)
        return self._loads[members]

    def hand(self, members: tuple[Member, ...]) -> Hand | None:
        """Return the hand of some members; None where nothing pushes them, or the last is no face of a row."""
        kind = tuple(self.forms[member] for member in members)
        if kind not in self._hands:
            self._hands[kind] = self._made(members, kind)
        return self._hands[kind]

    def held(self, members: tuple[Member, ...]) -> Hand:
        """Return the hand of members that a node holds.

        Raises:
            PlanningError: If nothing pushes them.
        """
        found = self.hand(members)
        if found is None:
            raise PlanningError(f"nothing pushes {', '.join(name for name, _ in members)}")
        return found

    @property
    def holds_several(self) -> bool:
        """Whether some of what was looked at is a hand of several objects."""
        return any(hand is not None for kind, hand in self._hands.items() if len(kind) > 1)

    def surely_closes(self, members: tuple[Member, ...]) -> bool:
        """Tell whether the last of some members becomes flush with the others, though it may stand off.

        Where it does not, there is no such hand from then on.
        """
        from pushplan.slip.closing import closes  # and with it the slip simulator: for plans of rows alone

        kind, hand = tuple(self.forms[member] for member in members), self.held(members)
        if kind not in self._sure:
            chain, other = self.load(members).chain, self.scenario.transport.row.friction[0]
            self._sure[kind] = closes(chain, SHORT, hand.packed.settle, other)
        if not self._sure[kind]:
            self._hands[kind] = None
            *held, last = (f"'{name}'" for name, _ in members)
            self.unsure[f"{last} does not surely become flush with {', '.join(held)}"] = None
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


def _form(scenario: Scenario, name: str, way: Through, load: tuple[FloatArray, ...]) -> Iterator[bytes]:
    """Yield what makes an object, pushed through a face, the same as another, but for its name."""
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
    """What stands in the room, by what of it rests where; pushes and transits are looked for among it.

    Args:
        scenario: With a row.
        seed: Of the random numbers.
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
        """Return the robot alone among objects that rest."""
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
        """Return a hand among objects that rest."""
        key = (_key(standing), id(hand))
        if key not in self._bodied:
            self._hands[id(hand)] = hand  # kept, so that its id stays its own
            self._bodied[key] = self.robot(standing).with_body(*hand.body)
        return self._bodied[key]

    def push(self, hand: Hand, start: FloatArray, goal: FloatArray, standing: Poses) -> Pushed:
        """Return the cheapest free push of one word."""
        self.looked_at += 1
        cost, arcs = find_push(self.with_hand(hand, standing), hand.packed, start, goal)
        return Pushed(cost, arcs)

    def push_by_way_of(self, hand: Hand, start: FloatArray, goal: FloatArray, standing: Poses) -> Pushed:
        """Return the cheapest free push of two words that lead through one of some poses."""
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
        """Tell whether the straight push that a push begins with is free."""
        return settles(self.with_hand(hand, standing), hand.packed, at)

    def closes(self, hand: Hand, start: FloatArray, length: float, standing: Poses) -> bool:
        """Tell whether a hand can be pushed straight ahead, as far as what it closes onto, which is left out."""
        return sweep_is_free(self.with_hand(hand, standing), start, AHEAD, length)

    def approach(self, hand: Hand, at: FloatArray, standing: Poses, name: str, entry: FloatArray) -> bool:
        """Tell whether the robot can come up to a face, at a pose (3,) in its object's frame.

        The plate is at a pose `at` (3,) then; the object does not stand among the others.
        """
        if not approaches_are_free(self.robot(standing), hand.packed, at[None], False)[0]:
            return False
        if id(hand) not in self._reached:
            self._hands[id(hand)] = hand
            self._reached[id(hand)] = reaches(self._beside(name, se2.inverse(entry)), hand.packed)
        return self._reached[id(hand)]

    def _beside(self, name: str, own: FloatArray) -> Scene:
        """Return the robot beside one object, which is at a pose (3,)."""
        berth = max(self.scenario.clearance, TRANSIT_CLEARANCE)
        pieces = [se2.transform_points(own, piece) for piece in self._outlines[name]]
        beside = self._alone.with_obstacles(*standing_shapes(pieces, np.zeros((0, 3))), NO_WALLS)
        return beside.with_distances(berth + SLACK, berth)

    def retreats(self, hand: Hand, at: FloatArray, standing: Poses) -> bool:
        """Tell whether the robot can back off from what it has pushed to where the plate is."""
        return bool(approaches_are_free(self.robot(standing), hand.packed, at[None], True)[0])

    def transit(
        self, start: FloatArray, goal: FloatArray, standing: Poses, name: str, pose: FloatArray
    ) -> FloatArray | None:
        """Return the arcs (k, 4) of the robot alone to where it comes up to an object; None where none was found."""
        key = (_key(standing), start.tobytes(), goal.tobytes())
        if key not in self._transits:
            self.looked_at += 1
            # Drawn anew for each transit, which then does not depend on what was looked for before.
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
