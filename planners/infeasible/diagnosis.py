"""Why no path is found: what is proven, what may be the reason, and how far the search came.

It is looked into while a search goes on without a path, so that one that cannot end well ends soon, and after it.
"Cannot" is said of what is proven, "perhaps" of everything else.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pushplan.core.problem import Problem
from pushplan.geometry import se2
from pushplan.mechanics.chain import as_one
from pushplan.planners.controls import straight_pushes
from pushplan.planners.infeasible.pockets import boxed_in_faults
from pushplan.planners.infeasible.turning import turning_faults
from pushplan.planners.infeasible.ways import between, grown, largest_disc, reached, room
from pushplan.plans.diagnosis import Diagnosis
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import CircleObstacle, PolygonObstacle
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray
from pushplan.util.names import CLEARANCE_ROOM

FIRST_STEP = 0.1
"""Seconds of a search without a path before the first step is taken."""

PATIENCE = 80.0
"""The next step is taken when the search has gone on for so many times as long as the steps before took together.

A step takes up to about ten times as long as those before it, so they take up to about an eighth of a search.
"""

GROWTH = {"passage": 1.0, "pockets": 10.0}
"""So many times as long as the one before may a step of each stage take."""

A_CORNER = 1.2e-4
"""What a corner of an obstacle adds to the first step, at most, s: it is grown, and joined with what it touches."""


class InfeasibilityMonitor:
    """What may keep a search from a path, found out in steps, short ones first, until one proves that there is none.

    Args:
        scenario: The problem.
        stable: The set that it was posed in.
        pose: Returns what is searched. It is asked for with the first step: most searches need none.
        limit: Seconds that a search may take: no step is taken that is likely to go on beyond.

    Attributes:
        reasons: What was found, proven or not.
    """

    def __init__(
        self, scenario: Scenario, stable: StableSet, pose: Callable[[], Problem], limit: float = math.inf
    ) -> None:
        self.reasons: list[Diagnosis] = []
        self._stages = {"passage": _passages(scenario, pose), "pockets": _turns_and_pockets(scenario, stable, pose)}
        self._limit, self._due, self._spent = limit, FIRST_STEP, 0.0
        self._expected = A_CORNER * sum(  # a round obstacle counts as 16 corners
            16 if isinstance(obstacle, CircleObstacle) else len(obstacle.outline) for obstacle in scenario.obstacles
        )

    @property
    def proven(self) -> tuple[Diagnosis, ...]:
        """The reasons for which there is no path."""
        return tuple(item for item in self.reasons if item.proven)

    def settled(self, seconds: float) -> bool:
        """Return whether there is no path, as far as is known; take the next step if the time has come.

        Args:
            seconds: That the search has taken.
        """
        if seconds >= self._due and not self.proven and self._expected <= self._limit - seconds:
            self._take_step()
        return bool(self.proven)

    def take_all_steps(self, seconds: float = math.inf) -> None:
        """Find out all that can be in so many seconds, or that there is no path, and how narrow its passage is."""
        until = time.perf_counter() + seconds
        while self._stages and self._expected <= until - time.perf_counter():
            if self.proven and "passage" not in self._stages:
                return
            self._take_step()

    def _take_step(self) -> None:
        """Take the next step, if there is one."""
        if not self._stages:
            self._due = math.inf
            return
        stage = next(iter(self._stages))
        began = time.perf_counter()
        found = next(self._stages[stage], None)
        took = time.perf_counter() - began
        self._spent += took
        self._due = max(FIRST_STEP, PATIENCE * self._spent)
        if found is None:
            del self._stages[stage]
            return
        self._expected = GROWTH[stage] * took
        known = [(item.cause, item.proven) for item in found]
        self.reasons = [item for item in self.reasons if (item.cause, item.proven) not in known] + found


def _passages(scenario: Scenario, pose: Callable[[], Problem]) -> Iterator[list[Diagnosis]]:
    yield from passage_faults(scenario, straight_pushes(pose().segments))


def _turns_and_pockets(
    scenario: Scenario, stable: StableSet, pose: Callable[[], Problem]
) -> Iterator[list[Diagnosis]]:
    problem = pose()
    yield turning_faults(scenario, stable, problem.segments)
    yield from boxed_in_faults(scenario, stable, problem)


def diagnose(
    monitor: InfeasibilityMonitor, extensions: int, error: tuple[float, float], seconds: float = math.inf
) -> tuple[Diagnosis, ...]:
    """Return what kept a search from finding a path: the proven reasons, or all that may be one.

    Args:
        monitor: What may have kept it.
        extensions: Arcs that were propagated.
        error: How far (m, rad) from the goal the nearest pose was that the search reached.
        seconds: What finding out may still take.
    """
    monitor.take_all_steps(seconds)
    return monitor.proven or (*monitor.reasons, _just_time(extensions, error, bool(monitor.reasons)))


def _just_time(extensions: int, error: tuple[float, float], guessed: bool) -> Diagnosis:
    first = "nothing proves that there is no way" if guessed else "nothing shows that there is no way"
    if extensions:
        near = f"{error[0]:.3g} m and {math.degrees(error[1]):.3g} deg of the goal"
        text = f"{first}: {extensions} extensions came within {near}, and more time or another seed may help"
    else:
        text = f"{first}: all of the time went by in preparing the search, and more of it may help"
    numbers = {"extensions": float(extensions), "position": error[0], "angle": error[1]}
    return Diagnosis("time", text, False, numbers)


# --- the widest passage between start and goal ----------------------------------------------------------------------

# A disc that fits into the chain goes wherever the chain goes. So where obstacles and walls, grown by its radius and
# the clearance, part its centre at the start from its centre at the goal, no motion whatever joins the two.

RESOLUTION = 1e-5
"""Widths are found to this accuracy, m."""


def passage_faults(scenario: Scenario, headings: FloatArray) -> Iterator[list[Diagnosis]]:
    """Yield, at last, that the passage between start and goal is too narrow, proven or perhaps, or nothing.

    What is proven is yielded first without the passage's width, which takes longer. Between two looks at the free
    space, each of which takes a tenth of a millisecond for each obstacle, nothing is yielded.

    Args:
        scenario: The problem.
        headings: (k, 2) directions, in the chain frame, in which the chain can be pushed straight.
    """
    disc = largest_disc(scenario.chain.bodies)
    needed = disc.radius + scenario.clearance - CLEARANCE_ROOM
    ends = [disc.at(pose) for pose in (scenario.start, scenario.goal.pose_chain)]

    def joined(radius: float, within: float = 1e-6) -> bool:  # m: ends may lie on the edge of a region
        near = [shapely.distance(shapely.get_parts(room(scenario, radius)), end) <= within for end in ends]
        return bool((near[0] & near[1]).any())

    if not joined(needed):
        between = _between(scenario, needed, ends, 1e-6)
        yield [replace(_proven(2.0 * disc.radius, 2.0 * needed, None), blocking=between)]
        widest = yield from _widest(joined, 0.0, needed)
        yield [replace(_proven(2.0 * disc.radius, 2.0 * needed, 2.0 * widest), blocking=between)]
        return
    yield []
    swept, reach = _swept_width(scenario, headings), _reach(scenario)
    wanted = 0.5 * swept + scenario.clearance
    if wanted <= needed or joined(wanted, reach):
        return
    yield []
    widest = yield from _widest(lambda r: joined(r, reach), needed, wanted)
    guess = _guess(swept, 2.0 * wanted, 2.0 * widest)
    yield [replace(guess, blocking=_between(scenario, wanted, ends, reach))]


def _between(scenario: Scenario, radius: float, ends: Sequence[shapely.Point], within: float) -> tuple[int, ...]:
    """Return the obstacles that part two ends: they bound what a disc can reach from either."""
    free = room(scenario, radius)
    one, other = (reached(free, end, within) for end in ends)
    return between(grown(scenario.obstacles, radius), one, other)


def _widest(joined: Callable[[float], bool], low: float, high: float) -> Generator[list[Diagnosis], None, float]:
    """Find the largest radius that is `joined`, between one that is (or 0) and one that is not.

    To half the resolution; nothing is yielded after each look.
    """
    while high - low > 0.5 * RESOLUTION:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if joined(middle) else (low, middle)
        yield []
    return 0.5 * (low + high)


def _swept_width(scenario: Scenario, headings: FloatArray) -> float:
    """Smallest width (m) of the chain across its straight pushes, or across +x where there is none."""
    corners = shapely.get_coordinates(as_one(scenario.chain.bodies))
    across = corners @ np.stack([-headings[:, 1], headings[:, 0]]) if len(headings) else corners[:, 1:]
    return float(np.ptp(across, axis=0).min())


def _reach(scenario: Scenario) -> float:
    """Size of the chain: the diameter of a circle around it, m."""
    return 2.0 * float(shapely.minimum_bounding_radius(as_one(scenario.chain.bodies)))


def _proven(width: float, needed: float, passage: float | None) -> Diagnosis:
    """Return what is proven; without the passage's width where that is not known."""
    chain = f"the chain, into which a disc of {_mm(width)} fits, needs at least {_mm(needed)} with its clearance"
    if passage is None:
        text = f"the chain cannot pass: no passage from start to goal is wide enough, and {chain}"
        return Diagnosis("gap", text, True, {"disc": width, "needed": needed})
    numbers = {"passage": passage, "disc": width, "needed": needed}
    if passage < RESOLUTION:
        text = "obstacles and walls separate the start from the goal: no passage joins them"
        return Diagnosis("gap", text, True, numbers)
    text = f"the chain cannot pass: the widest passage from start to goal is {_mm(passage)} wide, and {chain}"
    return Diagnosis("gap", text, True, numbers)


def _guess(swept: float, needed: float, passage: float) -> Diagnosis:
    numbers = {"passage": passage, "swept": swept, "needed": needed}
    text = (
        f"perhaps the passage is too narrow: the widest one from start to goal is about {_mm(passage)} wide, and the "
        f"chain is {_mm(swept)} wide across its straight pushes, {_mm(needed)} with its clearance"
    )
    return Diagnosis("gap", text, False, numbers)


def _mm(length: float) -> str:
    return f"{1e3 * length:.4g} mm"


# --- what the robot cannot come up to -------------------------------------------------------------------------------

# Nothing moves before the robot has come up to something. So where obstacles, walls and all objects as they stand,
# grown by the radius of a disc that fits into the robot, part it from every face that it may push, it is boxed in.
# And an object from all faces of which obstacles and walls alone part it stays where it is, whatever else is moved.

WITHIN = 1e-6
"""Places may be so far (m) outside of a region: they lie on its edge."""


def beyond_reach(
    scenario: Scenario,
    outlines: Mapping[str, Sequence[FloatArray]],
    faces: Mapping[str, FloatArray],
    needed: Sequence[str] = (),
) -> dict[str, Diagnosis]:
    """Return proofs that the robot reaches no object, by "", or not one that has to be moved, by its name.

    Args:
        scenario: Of one of the objects alone, with the robot's start and all that is fixed.
        outlines: (v, 2) of the parts of each object, in the world.
        faces: (k, 3) poses of the plate before each face that it may come up to, by object; in the world.
        needed: Names of the objects that have to be moved.
    """
    disc = largest_disc(scenario.chain.carried)
    into = se2.inverse(scenario.chain.pusher.plate_pose)
    start = disc.at(se2.compose(scenario.plate_start, into))
    radius = disc.radius + scenario.clearance - CLEARANCE_ROOM
    free = room(scenario, radius)
    alone = reached(free, start, WITHIN)
    standing = [PolygonObstacle(outline) for parts in outlines.values() for outline in parts]
    # What the robot starts close to does not keep it there: it backs off.
    covered = [shape for shape in grown(standing, disc.radius) if not shape.intersects(start)]
    open_floor = shapely.difference(free, shapely.union_all(covered))
    among = reached(open_floor, start, WITHIN)
    if among.is_empty:
        return {}
    inside = se2.compose(into, [*disc.center, 0.0])
    places = {name: se2.compose(poses, inside)[:, :2] for name, poses in faces.items()}
    centers = {name: [*np.asarray(shapely.points(xy))] for name, xy in places.items()}
    if not any(_any_in(among, points) for points in centers.values()):
        every = [point for points in centers.values() for point in points]
        text = "the robot is boxed in: it has no way to any face of an object that it may push"
        if not _any_in(open_floor, every):
            text = "the robot has no room before any face of an object that it may push"
        return {"": Diagnosis("boxed in", text, True, blocking=_parting(scenario, radius, free, among, every))}
    found = {}
    for name in needed:
        if not _any_in(alone, centers[name]):
            text = f"'{name}' cannot be reached: walls and obstacles leave the robot no way to any of its faces"
            parting = _parting(scenario, radius, free, alone, centers[name])
            found[name] = Diagnosis("boxed in", text, True, blocking=parting)
    return found


def _any_in(region: BaseGeometry, points: Sequence[shapely.Point]) -> bool:
    return bool((shapely.distance(region, points) <= WITHIN).any())


def _parting(
    scenario: Scenario, radius: float, free: BaseGeometry, region: BaseGeometry, points: Sequence[shapely.Point]
) -> tuple[int, ...]:
    """Return the obstacles that, grown, bound a region and cover points beyond it, or bound where these are."""
    beyond = shapely.union_all([*points, *(reached(free, point, WITHIN) for point in points)])
    return between(grown(scenario.obstacles, radius), region, beyond)
