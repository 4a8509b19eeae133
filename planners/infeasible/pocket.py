"""Proof that start or goal is boxed in: no stable pushes, however combined, lead far from the one, or into the other.

The cells that a step may reach are an outer approximation (see `pocket_kernel`): where they come to an end, so does
every path. With p the body's middle, its velocity in the body frame is (1, a, kappa) times that ahead; over all
stable twists, (a, kappa) has a convex hull. In a step of travel h ahead the mean of (a, kappa) stays in that hull,
from which bounds on the displacement follow for each turn.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import shapely

from pushplan.geometry import se2
from pushplan.planners.collision.separation import Scene
from pushplan.planners.infeasible.pocket_kernel import CLOSED, MET, ORIGIN, Steps, spread
from pushplan.planners.problem.controls import control_segments, segment_ends
from pushplan.planners.problem.problem import Problem
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray, IntArray
from pushplan.util.names import CLEARANCE_ROOM

Level = tuple[int, int, int]

LEVELS: tuple[Level, ...] = ((8, 8, 8), (16, 14, 16), (32, 24, 32), (4, 8, 40))
"""Cells to the radius of the body, most cells to a step, and cells of heading to a radian.

Many headings, on the last one, tell turns apart that are wide against the body.
"""

LOOKS = (8_000, 60_000, 200_000)
"""Cells looked at before a level is left; the next of these only after all levels."""


class Pocket(NamedTuple):
    """Where one is boxed in: the pose is the goal or the start, and (m) how far away the body's middle can be."""

    is_goal: bool
    radius: float


def find_pocket(scenario: Scenario, stable: StableSet, problem: Problem) -> Iterator[Pocket | None]:
    """Look for proof which end is boxed in, at more cells from step to step; yield it, or None, after each step.

    Args:
        scenario: The problem.
        stable: The set that limits the pushes.
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


def _pocket(
    scene: Scene, ends: FloatArray, left: dict[tuple[Level, int], Steps], looks: int
) -> Pocket | None:
    """Spread from both ends (2, 3) on every level left, dropping those on which one leads to the other."""
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
    """Twists (k, 3) on the boundary of the stable set, of what the drive can do of it."""
    drive = scenario.chain.pusher.drive
    if drive.axle is not None:
        return segment_ends(problem.segments)
    return segment_ends(control_segments(stable, drive, scenario.required_margin, 4_096))


def push_hull(twists: FloatArray, middle: FloatArray) -> shapely.Polygon:
    """Return the hull of (a, kappa), kappa in 1/m, of twists (k, 3); an empty one if one does not move ahead.

    Args:
        twists: In the chain frame.
        middle: (2,) of the body, chain frame, m.
    """
    ahead, aside = twists[:, 0] - twists[:, 2] * middle[1], twists[:, 1] + twists[:, 2] * middle[0]
    # Twists that hardly move the middle ahead, by a thousandth of their largest part, make a hull too wide to prove
    # anything.
    if not (ahead > 1e-3 * np.abs(twists).max(axis=1)).all():
        return shapely.Polygon()
    points = np.stack([aside / ahead, twists[:, 2] / ahead], axis=1)
    size = np.maximum(np.ptp(points, axis=0), 1e-3)
    # Larger by 0.5 % of its extent, so that twists between meridians lie in it, too.
    hull = shapely.convex_hull(shapely.MultiPoint(points / size)).buffer(5e-3, join_style="mitre")
    return shapely.transform(hull, lambda corners: corners * size)


def make_steps(scene: Scene, hull: shapely.Polygon, level: Level, clearance: float, back: bool) -> Steps:
    """Return the cells and steps of a level.

    Args:
        scene: The body.
        hull: Of (a, kappa); see `push_hull`.
        level: One of `LEVELS`.
        clearance: That the body has to keep, m.
        back: Whether steps lead back in time.
    """
    radius, sign = float(scene.body_bound[2]), -1.0 if back else 1.0
    side = radius / level[0]
    headings = math.ceil(2.0 * math.pi * level[2])
    angle = 2.0 * math.pi / headings
    amin, kmin, amax, kmax = hull.bounds
    lean, bend = max(abs(amin), abs(amax)), max(abs(kmin), abs(kmax))
    # So short that steps turn by 0.6 rad at most, but for 6 cells: shorter ones blur what can be reached.
    travel = max(6, min(level[1], 0.6 / (bend * side))) * side
    turned = 0.5 * angle + travel * bend  # from the heading of the cell's middle
    most = min(turned, 0.5 * math.pi)
    ahead = travel * np.array(
        [math.cos(min(turned, math.pi)) - lean * math.sin(most), 1.0 + lean * math.sin(most)]
    )
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


def reached(
    scene: Scene, begin: FloatArray, other: FloatArray, steps: Steps, room: int
) -> tuple[int, IntArray]:
    """Spread from one pose (3,) towards another; see `spread`.

    Args:
        scene: The body and what it must not touch.
        begin: (3,) chain frame where it begins, world.
        other: (3,) chain frame near which it ends.
        steps: See `make_steps`.
        room: Slots of the table of cells, a power of two; half as many cells are looked at.

    Returns:
        (end, cells): how it ended; (n, 3) column, row and heading of the cells found.
    """
    middle = scene.body_bound[:2]
    ends = [np.append(se2.transform_points(pose, middle), pose[2]) for pose in (begin, other)]
    cells = np.empty((room // 2, 3), dtype=np.int64)
    outcome, count = spread(scene, ends[0], steps, ends[1], np.zeros(room, dtype=np.int64), cells)
    return int(outcome), cells[:count]
