"""Proofs, on a grid of poses, that no push leads away from the start or to the goal."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import shapely

from pushplan.core.collision import Scene, sweep_is_free
from pushplan.core.infeasible import CLOSED, MET, ORIGIN, Steps, spread
from pushplan.core.problem import Problem
from pushplan.geometry import se2
from pushplan.mechanics.chain import area_at
from pushplan.planners.controls import control_segments, segment_ends
from pushplan.planners.infeasible.turning import tightest_turn
from pushplan.planners.infeasible.ways import near_to
from pushplan.plans.diagnosis import Diagnosis
from pushplan.plans.path import cost_rate
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray, IntArray
from pushplan.util.names import CLEARANCE_ROOM

Level = tuple[int, int, int]

LEVELS: tuple[Level, ...] = ((8, 8, 8), (16, 14, 16), (32, 24, 32), (4, 8, 40))
"""Grid levels: (cells per body radius, maximum cells per step, heading cells per radian).

The many headings of the last level resolve turns that are wide compared with the body.
"""

LOOKS = (8_000, 60_000, 200_000)
"""Maximum numbers of cells on a level. A larger number is used only after all levels were tried."""


SHORTEST_TRY = 1e-3
"""Length of the shortest push that is tried without a proof, m."""


class Pocket(NamedTuple):
    """A pocket around the goal or the start, with the maximum distance (m) of the body's middle from it."""

    is_goal: bool
    radius: float


def find_pocket(scenario: Scenario, stable: StableSet, problem: Problem) -> Iterator[Pocket | None]:
    """Yield, after each step, a proof that start or goal is boxed in, or None. Steps use more and more cells.

    Args:
        scenario: The problem.
        stable: Stable set of the pushes.
        problem: The same problem compiled.
    """
    hull = push_hull(_extreme_twists(scenario, stable, problem), problem.scene.body_bound[:2])
    if hull.is_empty:
        return
    left = {
        (level, end): make_steps(problem.scene, hull, level, scenario.clearance, back=end == 1)
        for level in LEVELS
        for end in (0, 1)
    }
    ends = np.array([scenario.start, scenario.goal.pose_chain])
    for looks in LOOKS:
        yield _pocket(problem.scene, ends, left, looks)


def _pocket(scene: Scene, ends: FloatArray, left: dict[tuple[Level, int], Steps], looks: int) -> Pocket | None:
    """Spread from both ends (2, 3) on every remaining level. Drop the levels on which the ends meet."""
    room = 1 << math.ceil(math.log2(2 * looks))
    for (level, end), steps in [*left.items()]:
        outcome, cells = reached(scene, ends[end], ends[1 - end], steps, room)
        if outcome == CLOSED:
            away = steps.side * np.hypot(*(cells[:, :2] - ORIGIN).T).max()
            return Pocket(end == 1, float(away + steps.side + steps.longest))
        if outcome == MET:
            del left[level, end]
    return None


def _extreme_twists(scenario: Scenario, stable: StableSet, problem: Problem) -> FloatArray:
    """Return twists (k, 3) on the boundary of the stable set that the drive can make."""
    drive = scenario.chain.pusher.drive
    if drive.axle is not None:
        return segment_ends(problem.segments)
    return segment_ends(control_segments(stable, drive, scenario.required_margin, 4_096))


def push_hull(twists: FloatArray, middle: FloatArray) -> shapely.Polygon:
    """Return the hull of (slope a, curvature kappa in 1/m) of twists (k, 3); empty if one does not move ahead.

    Args:
        twists: (k, 3) twists in the chain frame.
        middle: (2,) middle of the body, chain frame, m.
    """
    ahead, aside = twists[:, 0] - twists[:, 2] * middle[1], twists[:, 1] + twists[:, 2] * middle[0]
    # Twists that hardly move the middle ahead (a thousandth of their largest component) make the hull too wide for a
    # proof.
    if not (ahead > 1e-3 * np.abs(twists).max(axis=1)).all():
        return shapely.Polygon()
    points = np.stack([aside / ahead, twists[:, 2] / ahead], axis=1)
    size = np.maximum(np.ptp(points, axis=0), 1e-3)
    # Grow it by 0.5 % of its extent, so that it includes the twists between meridians.
    hull = shapely.convex_hull(shapely.MultiPoint(points / size)).buffer(5e-3, join_style="mitre")
    return shapely.transform(hull, lambda corners: corners * size)


def make_steps(scene: Scene, hull: shapely.Polygon, level: Level, clearance: float, back: bool) -> Steps:
    """Return the cells and steps of a level.

    Args:
        scene: Scene with the body.
        hull: Hull of (a, kappa); see `push_hull`.
        level: One of `LEVELS`.
        clearance: Clearance of the body, m.
        back: Whether steps lead back in time.
    """
    radius, sign = float(scene.body_bound[2]), -1.0 if back else 1.0
    side = radius / level[0]
    headings = math.ceil(2.0 * math.pi * level[2])
    angle = 2.0 * math.pi / headings
    amin, kmin, amax, kmax = hull.bounds
    lean, bend = max(abs(amin), abs(amax)), max(abs(kmin), abs(kmax))
    # Steps turn by at most 0.6 rad but are at least 6 cells long: shorter ones blur the reachable set.
    travel = max(6, min(level[1], 0.6 / (bend * side))) * side
    turned = 0.5 * angle + travel * bend  # from the heading of the cell's middle
    most = min(turned, 0.5 * math.pi)
    ahead = travel * np.array([math.cos(min(turned, math.pi)) - lean * math.sin(most), 1.0 + lean * math.sin(most)])
    rates = sorted((sign * kmin * travel / angle, sign * kmax * travel / angle))
    first, last = math.ceil(rates[0] - 1.0), math.floor(rates[1] + 1.0)
    rest = travel**2 * (kmax - kmin) / 8.0 + travel * (turned**3 / 6.0 + lean * turned**2 / 2.0)
    aside = np.empty((last - first + 1, 2))
    for row, cells in enumerate(range(first, last + 1)):
        low, high = sorted((sign * (cells - 1) * angle / travel, sign * (cells + 1) * angle / travel))
        part = shapely.intersection(hull, shapely.box(amin - 1.0, low, amax + 1.0, high))
        if part.is_empty:
            aside[row] = 1.0, -1.0
            continue
        middle = 0.5 * cells * angle
        aside[row, 0] = travel * (part.bounds[0] + middle - 0.5 * angle) - rest
        aside[row, 1] = travel * (part.bounds[2] + middle + 0.5 * angle) + rest
    touching = clearance - CLEARANCE_ROOM - side * math.sqrt(0.5) - radius * 0.5 * angle
    longest = float(ahead[1]) + travel * (lean + turned)
    near, most = longest + 2.0 * side, travel * bend + angle
    return Steps(side, headings, sign, travel, longest, near, most, ahead, first, aside, touching)


def reached(scene: Scene, begin: FloatArray, other: FloatArray, steps: Steps, room: int) -> tuple[int, IntArray]:
    """Spread from one pose (3,) towards another; see `core.infeasible.spread`.

    Args:
        scene: Scene of the body and the obstacles.
        begin: (3,) start pose of the chain frame in the world.
        other: (3,) pose of the chain frame near which it ends.
        steps: See `make_steps`.
        room: Slots of the table of cells, a power of two. At most half as many cells are visited.

    Returns:
        (outcome, cells): outcome of the search; (n, 3) column, row and heading of the visited cells.
    """
    middle = scene.body_bound[:2]
    ends = [np.append(se2.transform_points(pose, middle), pose[2]) for pose in (begin, other)]
    return spread(scene, ends[0], steps, ends[1], room)


def boxed_in_faults(scenario: Scenario, stable: StableSet, problem: Problem) -> Iterator[list[Diagnosis]]:
    """Yield the proof of each step, if any, with longer and longer steps; finally yield the possible reasons.

    Args:
        scenario: The problem.
        stable: Stable set of the pushes.
        problem: The same problem compiled.
    """
    for pocket in find_pocket(scenario, stable, problem):
        yield [_proven(scenario, pocket, tightest_turn(scenario, stable, problem.segments))] if pocket else []
    yield _perhaps(scenario, problem)


def _proven(scenario: Scenario, pocket: Pocket, turn: str) -> Diagnosis:
    if pocket.is_goal:
        name, words = "goal", "it is boxed in, and all sequences of pushes into it begin"
    else:
        name, words = "start", "the start is boxed in, and all sequences of pushes end"
    text = f"the goal cannot be reached: {words} no farther than {pocket.radius:.3g} m from it "
    text += f"(middle of the chain){turn}"
    end = scenario.goal.pose_chain if pocket.is_goal else scenario.start
    around = _around(scenario, end, pocket.radius)
    return Diagnosis("boxed in", text, True, {f"radius_around_{name}": pocket.radius}, around)


def _around(scenario: Scenario, pose: FloatArray, reach: float) -> tuple[int, ...]:
    """Return the obstacles that the chain can reach from a pose (3,) within a distance (m)."""
    return near_to(scenario.obstacles, [area_at(scenario.chain.bodies, pose)], reach + scenario.clearance)


def _perhaps(scenario: Scenario, problem: Problem) -> list[Diagnosis]:
    found = []
    reach = float(problem.scene.body_bound[2])
    for name, pose, sign, words in (
        ("start", scenario.start, 1.0, "leads farther from the start than"),
        ("goal", scenario.goal.pose_chain, -1.0, "leads to the goal from farther away than"),
    ):
        free, tried = _longest_push(problem.scene, sign * _some_pushes(problem.segments), pose, reach)
        if free < reach:
            text = f"perhaps the {name} is boxed in: none of {tried} pushes tried {words} {1e3 * free:.3g} mm"
            around = _around(scenario, pose, 2.0 * free + SHORTEST_TRY)
            found.append(Diagnosis("boxed in", text, False, {f"free_from_{name}": free}, around))
    return found


def _some_pushes(segments: FloatArray) -> FloatArray:
    """Return at most 300 twists (k, 3) spread over the segments, scaled to a cost rate of 1."""
    rows = segments[np.linspace(0, len(segments) - 1, min(len(segments), 100)).astype(int)]
    twists = np.concatenate([rows[:, :3], 0.5 * (rows[:, :3] + rows[:, 3:]), rows[:, 3:]])
    return np.asarray(twists / cost_rate(twists)[:, None])


def _longest_push(scene: Scene, twists: FloatArray, pose: FloatArray, enough: float) -> tuple[float, int]:
    """Return the longest free push (m) from a pose, up to `enough`, and the number of pushes tried."""
    best = 0.0
    for tried, twist in enumerate(twists, 1):
        length = max(SHORTEST_TRY, 2.0 * best)
        while sweep_is_free(scene, pose, twist, length):
            best = length
            if best >= enough:
                return best, tried
            length *= 2.0
    return best, len(twists)
