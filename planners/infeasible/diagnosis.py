"""Diagnosis of a failed search: proven reasons, possible reasons and the progress of the search.

The diagnosis runs during a search without a path, so that a hopeless search ends early, and after it. Texts say
"cannot" for proven reasons and "perhaps" for all others.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from pushplan.core.problem import Problem
from pushplan.geometry import se2
from pushplan.mechanics.chain import as_one
from pushplan.planners.controls import straight_pushes
from pushplan.planners.infeasible.pockets import boxed_in_faults
from pushplan.planners.infeasible.turning import turning_faults
from pushplan.planners.infeasible.ways import Disc, between, grown, largest_disc, reached, room
from pushplan.plans.diagnosis import Diagnosis
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import CircleObstacle, PolygonObstacle
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray
from pushplan.util.names import CLEARANCE_ROOM

FIRST_STEP = 0.1
"""Time without a path before the first step of the diagnosis, s."""

PATIENCE = 80.0
"""Ratio of search time to the time of all earlier steps at which the next step begins.

A step can take about ten times as long as all earlier ones. So the steps take at most about an eighth of a search.
"""

GROWTH = {"passage": 1.0, "pockets": 10.0}
"""Expected ratio of a step's time to that of the step before, by stage."""

A_CORNER = 1.2e-4
"""Maximum time that a corner of an obstacle adds to the first step, s."""


class InfeasibilityMonitor:
    """Stepwise diagnosis of a search without a path. The shortest steps come first, until one proves infeasibility.

    Args:
        scenario: The problem.
        stable: Stable set of the search.
        pose: Returns the compiled problem. It is called at the first step, because most searches need none.
        limit: Time limit of the search, s. No step begins that would probably exceed it.

    Attributes:
        reasons: Reasons found so far, proven or not.
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
        """The proven reasons."""
        return tuple(item for item in self.reasons if item.proven)

    def settled(self, seconds: float) -> bool:
        """Take the next step if it is due. Return whether it is proven that no path exists.

        Args:
            seconds: Time of the search so far, s.
        """
        if seconds >= self._due and not self.proven and self._expected <= self._limit - seconds:
            self._take_step()
        return bool(self.proven)

    def take_all_steps(self, seconds: float = math.inf) -> None:
        """Take all steps that fit into a time (s), or until a proof and the passage's width are found."""
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
        replaced = [(item.cause, item.proven) for item in found]
        self.reasons = [item for item in self.reasons if (item.cause, item.proven) not in replaced] + found


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
    """Return the proven reasons for a failed search, or all possible ones without a proof.

    Args:
        monitor: Diagnosis of the search.
        extensions: Number of arcs propagated.
        error: Distance (m, rad) from the goal to the nearest pose of the search.
        seconds: Time left for the diagnosis, s.
    """
    monitor.take_all_steps(seconds)
    return monitor.proven or (*monitor.reasons, _just_time(extensions, error, bool(monitor.reasons)))


def _just_time(extensions: int, error: tuple[float, float], guessed: bool) -> Diagnosis:
    first = "a path may still exist" if guessed else "no reason was found"
    if extensions:
        near = f"{error[0]:.3g} m and {math.degrees(error[1]):.3g} deg of the goal"
        text = f"{first}: {extensions} extensions came within {near}; more time or another seed may help"
    else:
        text = f"{first}: preparing the search took all of the time; more time may help"
    numbers = {"extensions": float(extensions), "position": error[0], "angle": error[1]}
    return Diagnosis("time", text, False, numbers)


# --- the widest passage between start and goal ----------------------------------------------------------------------

# A disc that fits into the chain moves with it. So no motion joins start and goal if obstacles and walls, grown by
# the disc's radius and the clearance, separate the disc's centre at the start from that at the goal.

RESOLUTION = 1e-5
"""Accuracy of passage widths, m."""


def passage_faults(scenario: Scenario, headings: FloatArray) -> Iterator[list[Diagnosis]]:
    """Yield the diagnosis that the passage from start to goal is too narrow, proven or possible, if it is.

    A proof is first yielded without the passage's width, which takes longer to compute. An empty list is yielded
    after each check of the free space. A check takes 0.1 ms for each obstacle.

    Args:
        scenario: The problem.
        headings: (k, 2) directions of straight pushes, chain frame.
    """
    disc, passages = largest_disc(scenario.chain.bodies), Passages(scenario)
    needed = disc.radius + scenario.clearance - CLEARANCE_ROOM
    start, goal = (disc.at(pose) for pose in (scenario.start, scenario.goal.pose_chain))

    def joined(radius: float, within: float = WITHIN) -> bool:
        return passages.join(radius, start, [goal], within)

    if not joined(needed):
        between = passages.between(needed, start, [goal], WITHIN)
        yield [replace(_proven(2.0 * disc.radius, 2.0 * needed, None), blocking=between)]
        found = [0.0]
        for widest in _widest(joined, 0.0, needed):
            found.append(widest)
            yield []
        yield [replace(_proven(2.0 * disc.radius, 2.0 * needed, 2.0 * found[-1]), blocking=between)]
        return
    yield []
    swept, reach = _swept_width(scenario, headings), _reach(scenario)
    wanted = 0.5 * swept + scenario.clearance
    if wanted <= needed or joined(wanted, reach):
        return
    yield []
    found = [needed]
    for widest in _widest(lambda r: joined(r, reach), needed, wanted):
        found.append(widest)
        yield []
    guess = _guess(swept, 2.0 * wanted, 2.0 * found[-1])
    yield [replace(guess, blocking=passages.between(wanted, start, [goal], reach))]


class Passages:
    """Connected free regions for the centres of discs among the fixed obstacles of a scenario, kept by radius."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._parts: dict[float, NDArray[np.object_]] = {}

    def _near(self, radius: float, ends: Sequence[shapely.Point], within: float) -> NDArray[np.bool_]:
        """Return which regions (r,) are within a distance (m) of any of the ends."""
        if radius not in self._parts:
            self._parts[radius] = shapely.get_parts(room(self._scenario, radius))
        parts = self._parts[radius]
        return np.asarray(np.any([shapely.distance(parts, end) <= within for end in ends], axis=0))

    def join(self, radius: float, start: shapely.Point, ends: Sequence[shapely.Point], within: float) -> bool:
        """Return whether a disc with a radius (m) can move from a start to any of the ends, or near them."""
        return bool((self._near(radius, [start], within) & self._near(radius, ends, within)).any())

    def between(
        self, radius: float, start: shapely.Point, ends: Sequence[shapely.Point], within: float
    ) -> tuple[int, ...]:
        """Return the obstacles that separate a start from all ends: those that bound the regions of both."""
        free = room(self._scenario, radius)
        other = shapely.union_all([reached(free, end, within) for end in ends])
        return between(grown(self._scenario.obstacles, radius), reached(free, start, within), other)

    def fault(
        self,
        who: str,
        disc: Disc,
        start: shapely.Point,
        ends: Sequence[shapely.Point],
        within: float = 1e-6,
        where: str = "from start to goal",
    ) -> Diagnosis | None:
        """Return the proof that a body cannot pass to any of the ends that have room for its disc; None without one.

        Args:
            who: Name of the body in the text.
            disc: A disc inside it.
            start: Centre of the disc at the start.
            ends: Centres of the disc at the ends.
            within: Distance from an end that suffices, m.
            where: Description of the way.
        """
        needed = disc.radius + self._scenario.clearance - CLEARANCE_ROOM
        ends = [end for end in ends if self._near(needed, [end], within).any()]
        if not ends or self.join(needed, start, ends, within):
            return None
        *_, widest = _widest(lambda radius: self.join(radius, start, ends, within), 0.0, needed)
        fault = _proven(2.0 * disc.radius, 2.0 * needed, 2.0 * widest, who, where)
        return replace(fault, blocking=self.between(needed, start, ends, within))


def _widest(joined: Callable[[float], bool], low: float, high: float) -> Iterator[float]:
    """Yield ever better estimates of the largest radius that is `joined`, by bisection to half the resolution.

    The lower end is joined (or 0), the upper end is not.
    """
    while high - low > 0.5 * RESOLUTION:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if joined(middle) else (low, middle)
        yield 0.5 * (low + high)


def _swept_width(scenario: Scenario, headings: FloatArray) -> float:
    """Return the smallest width (m) of the chain across its straight pushes, or across +x if there are none."""
    corners = shapely.get_coordinates(as_one(scenario.chain.bodies))
    across = corners @ np.stack([-headings[:, 1], headings[:, 0]]) if len(headings) else corners[:, 1:]
    return float(np.ptp(across, axis=0).min())


def _reach(scenario: Scenario) -> float:
    """Return the diameter (m) of a circle around the chain."""
    return 2.0 * float(shapely.minimum_bounding_radius(as_one(scenario.chain.bodies)))


def _proven(
    width: float, needed: float, passage: float | None, who: str = "the chain", where: str = "from start to goal"
) -> Diagnosis:
    """Return the proven diagnosis, without the passage's width if it is unknown."""
    chain = f"{who} needs at least {_mm(needed)} (a disc of {_mm(width)} that fits into it, plus clearance)"
    if passage is None:
        text = f"{who} cannot pass: no passage {where} is wide enough, and {chain}"
        return Diagnosis("gap", text, True, {"disc": width, "needed": needed})
    numbers = {"passage": passage, "disc": width, "needed": needed}
    if passage < RESOLUTION:
        text = f"{who} cannot pass: obstacles and walls close every way {where}"
        return Diagnosis("gap", text, True, numbers)
    text = f"{who} cannot pass: the widest passage {where} is {_mm(passage)} wide, and {chain}"
    return Diagnosis("gap", text, True, numbers)


def _guess(swept: float, needed: float, passage: float) -> Diagnosis:
    numbers = {"passage": passage, "swept": swept, "needed": needed}
    text = (
        f"perhaps the passage is too narrow: the widest one from start to goal is about {_mm(passage)} wide, and the "
        f"chain is {_mm(swept)} wide across its straight pushes, {_mm(needed)} including clearance"
    )
    return Diagnosis("gap", text, False, numbers)


def _mm(length: float) -> str:
    return f"{1e3 * length:.4g} mm"


# --- objects that the robot cannot reach ----------------------------------------------------------------------------

# No object moves before the robot reaches one. So the robot is boxed in if obstacles, walls and all objects at their
# current poses, grown by the radius of a disc inside the robot, separate it from every allowed face. An object can
# never be moved if obstacles and walls alone separate the robot from all its faces.

WITHIN = 1e-6
"""Distance (m) from a region up to which points count as inside, because they can lie on its edge."""


def beyond_reach(
    scenario: Scenario,
    outlines: Mapping[str, Sequence[FloatArray]],
    faces: Mapping[str, FloatArray],
    needed: Sequence[str] = (),
) -> dict[str, Diagnosis]:
    """Return proofs that the robot cannot reach a needed object, by name, or any object at all, by "".

    Args:
        scenario: Scenario of one object alone, with the robot's start and the fixed obstacles.
        outlines: (v, 2) outlines of each object's parts, world frame.
        faces: (k, 3) poses of the plate before each allowed face, by object, world frame.
        needed: Names of the objects that must be moved.
    """
    disc = largest_disc(scenario.chain.carried)
    into = se2.inverse(scenario.chain.pusher.plate_pose)
    start = disc.at(se2.compose(scenario.plate_start, into))
    radius = disc.radius + scenario.clearance - CLEARANCE_ROOM
    free = room(scenario, radius)
    alone = reached(free, start, WITHIN)
    standing = [PolygonObstacle(outline) for parts in outlines.values() for outline in parts]
    # An object close to the robot's start does not trap the robot, because it can back off.
    covered = [shape for shape in grown(standing, disc.radius) if not shape.intersects(start)]
    open_floor = shapely.difference(free, shapely.union_all(covered))
    among = reached(open_floor, start, WITHIN)
    if among.is_empty:
        return {}
    inside = se2.compose(into, [*disc.center, 0.0])
    places = {name: se2.compose(poses, inside)[:, :2] for name, poses in faces.items()}
    centers = {name: [*np.asarray(shapely.points(xy))] for name, xy in places.items()}
    passages = Passages(scenario)
    if not any(_any_in(among, points) for points in centers.values()):
        every = [point for points in centers.values() for point in points]
        narrow = passages.fault("the robot", disc, start, every, WITHIN, "to an allowed face of an object")
        why = "it cannot reach any allowed face of an object" if narrow is None else narrow.text
        text = f"the robot is boxed in: {why}"
        if not _any_in(open_floor, every):
            text = "the robot has no room before any allowed face of an object"
        return {"": Diagnosis("boxed in", text, True, blocking=_parting(scenario, radius, free, among, every))}
    found = {}
    for name in needed:
        if not _any_in(alone, centers[name]):
            narrow = passages.fault("the robot", disc, start, centers[name], WITHIN, "to its faces")
            why = "no face has room for the robot" if narrow is None else narrow.text
            parting = _parting(scenario, radius, free, alone, centers[name])
            found[name] = Diagnosis("boxed in", f"'{name}' cannot be reached: {why}", True, blocking=parting)
    return found


def _any_in(region: BaseGeometry, points: Sequence[shapely.Point]) -> bool:
    return bool((shapely.distance(region, points) <= WITHIN).any())


def _parting(
    scenario: Scenario, radius: float, free: BaseGeometry, region: BaseGeometry, points: Sequence[shapely.Point]
) -> tuple[int, ...]:
    """Return the obstacles that, once grown, separate a region from points outside it."""
    beyond = shapely.union_all([*points, *(reached(free, point, WITHIN) for point in points)])
    return between(grown(scenario.obstacles, radius), region, beyond)
