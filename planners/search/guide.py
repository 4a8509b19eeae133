"""Ways for a search to try: short ones around the obstacles, another one each time.

On a grid of the places where the chain's middle may be, short ways from start to goal are candidates for the
passages that a path takes. Each way is the cheapest under a random price of the floor: with a flat one always the
same, with a rough one through any passage that is not much longer. A way proves nothing; it says where to sample.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pushplan.arrays import FloatArray, RandomState
from pushplan.compiled import compiled, no_refcount
from pushplan.geometry import se2
from pushplan.planners.collision.scene import flatten
from pushplan.planners.collision.separation import Scene, separation
from pushplan.planners.problem.problem import Problem, random
from pushplan.planners.problem.steering import STRAIGHT

CELLS = 72
"""Cells of the grid along the longer side of the sampling box."""

PATCHES = 6
"""Patches of the random price along the longer side; between their corners it is interpolated."""

SWEEPS = 60
"""Passes over the grid, at most, in which distances become final."""

MOST_SPACE = 10.0
"""Distances above this are not looked at, m."""

BARE = 0.5
"""Share of the half width below which a place is blocked whatever the heading."""

WEAR = 0.3
"""Share by which the floor becomes more expensive where a way has passed."""

FADING = 0.9
"""What is left of that from one way to the next."""

_SPECK = 1e-7 * np.array([[-1.0, -1.0], [1.0, -1.0], [0.0, 1.0]])

Box = tuple[float, float, float, float]


class Guide(NamedTuple):
    """The grid.

    Attributes:
        space: (nx, ny) how far the middles of the cells are from obstacles and walls, m.
        corner: (2,) lower left corner of the grid, m.
        cell: Side of a cell, m.
        center: (2,) the body's middle in the chain frame, m.
        half_width: Half of the body's width across its straight push, m.
        start: (2,) the middle at the start, m.
        goal: (2,) the middle at the goal, m.
        worn: (nx, ny) how often ways passed here lately; it makes the floor expensive, and drives ways apart.
    """

    space: FloatArray
    corner: FloatArray
    cell: float
    center: FloatArray
    half_width: float
    start: FloatArray
    goal: FloatArray
    worn: FloatArray


def make_guide(problem: Problem, start: FloatArray, box: Box) -> Guide:
    """Return the grid of a problem.

    Args:
        problem: What to plan.
        start: (3,) pose of the chain frame.
        box: (xmin, ymin, xmax, ymax) that the grid covers.
    """
    scene = problem.scene
    cell = max(box[2] - box[0], box[3] - box[1]) / CELLS
    counts = [max(1, round((box[k + 2] - box[k]) / cell)) for k in (0, 1)]
    middle = middle_of(problem)
    center, heading = middle[:2], middle[2]
    across = scene.body.corners[:, :2] @ np.array([-math.sin(heading), math.cos(heading)])
    corner = np.array(box[:2], dtype=np.float64)
    point = scene._replace(body=flatten([_SPECK]), body_bound=np.array([0.0, 0.0, 2.0 * _SPECK[1, 0]]))
    space = spaces(point, corner, cell, counts[0], counts[1])
    begin, end = (se2.transform_points(pose, center) for pose in (start, problem.goal))
    return Guide(space, corner, cell, center, 0.5 * float(np.ptp(across)), begin, end, np.zeros_like(space))


def middle_of(problem: Problem) -> FloatArray:
    """Return the body's middle in the chain frame, and the direction of its straight push there (3,)."""
    push = problem.families[0, STRAIGHT]
    return np.append(problem.scene.body_bound[:2], math.atan2(push[1], push[0]))


@compiled
def spaces(point: Scene, corner: FloatArray, cell: float, nx: int, ny: int) -> FloatArray:
    """Return how far the middles of cells (nx, ny) are from everything, m, asking for a point as the body."""
    space = np.empty((nx, ny))
    for i in range(nx):
        for j in range(ny):
            x, y = corner[0] + (i + 0.5) * cell, corner[1] + (j + 0.5) * cell
            space[i, j] = separation(point, x, y, 0.0, MOST_SPACE)
    return space


@no_refcount
def _cell_of(guide: Guide, point: FloatArray) -> tuple[int, int]:
    """Return the cell of a point (2,), the nearest one if it is outside."""
    nx, ny = guide.space.shape
    i = int((point[0] - guide.corner[0]) / guide.cell)
    j = int((point[1] - guide.corner[1]) / guide.cell)
    return min(nx - 1, max(0, i)), min(ny - 1, max(0, j))


@compiled
def _priced(guide: Guide, rough: float, tight: float, state: RandomState) -> FloatArray:
    """Return the price of a metre (nx, ny) in every cell: random, higher in tight places, infinite if blocked."""
    nx, ny = guide.space.shape
    side = max(nx, ny) / PATCHES
    knots = np.empty((PATCHES + 2, PATCHES + 2))
    for a in range(PATCHES + 2):
        for b in range(PATCHES + 2):
            knots[a, b] = math.exp(rough * random(state))
    prices = np.empty((nx, ny))
    for i in range(nx):
        for j in range(ny):
            a, b = int(i / side), int(j / side)
            u, v = i / side - a, j / side - b
            low = (1.0 - v) * knots[a, b] + v * knots[a, b + 1]
            high = (1.0 - v) * knots[a + 1, b] + v * knots[a + 1, b + 1]
            prices[i, j] = ((1.0 - u) * low + u * high) * (1.0 + WEAR * guide.worn[i, j])
            if guide.space[i, j] < tight:
                prices[i, j] *= 8.0
            if guide.space[i, j] + 0.71 * guide.cell < BARE * guide.half_width:
                prices[i, j] = np.inf
    return prices


@no_refcount
def _relaxed(prices: FloatArray, away: FloatArray, i: int, j: int) -> bool:
    """Lower a cell's price of the way to the goal by those of its neighbours; whether that changed it."""
    nx, ny = prices.shape
    best = away[i, j]
    for di in range(-1, 2):
        for dj in range(-1, 2):
            a, b = i + di, j + dj
            if 0 <= a < nx and 0 <= b < ny and away[a, b] < best:
                step = 1.0 if di * dj == 0 else math.sqrt(2.0)
                best = min(best, away[a, b] + 0.5 * step * (prices[i, j] + prices[a, b]))
    changed = bool(best < away[i, j])
    away[i, j] = best
    return changed


@compiled
def _prices_of_ways(prices: FloatArray, i0: int, j0: int) -> FloatArray:
    """Return what the cheapest way from every cell to one of them costs, by sweeps in alternating directions."""
    nx, ny = prices.shape
    away = np.full((nx, ny), np.inf)
    away[i0, j0] = 0.0
    quiet = 0
    for sweep in range(SWEEPS):
        changed = False
        for a in range(nx):
            i = a if sweep % 2 == 0 else nx - 1 - a
            for b in range(ny):
                j = b if sweep // 2 % 2 == 0 else ny - 1 - b
                if prices[i, j] < np.inf and _relaxed(prices, away, i, j):
                    changed = True
        quiet = 0 if changed else quiet + 1
        if quiet == 4:
            break
    return away


@no_refcount
def _wear(guide: Guide, way: FloatArray, n: int) -> None:
    """Note that a way passed through its cells and those next to them."""
    nx, ny = guide.worn.shape
    for i in range(nx):
        for j in range(ny):
            guide.worn[i, j] *= FADING
    for k in range(n):
        i, j = _cell_of(guide, way[k])
        for a in range(max(0, i - 1), min(nx, i + 2)):
            for b in range(max(0, j - 1), min(ny, j + 2)):
                guide.worn[a, b] += 1.0 / 3.0


@compiled
def find_way(guide: Guide, rough: float, tight: float, state: RandomState, way: FloatArray) -> int:
    """Fill `way` (capacity, 2) with a way of the body's middle from start to goal.

    Args:
        guide: The grid.
        rough: Logarithm of the largest ratio of prices of the floor.
        tight: Distance from obstacles (m) below which the floor is more expensive.
        state: (1,) of the random generator.
        way: Filled with points.

    Returns:
        How many; 0 when there is none.
    """
    prices = _priced(guide, rough, tight, state)
    i, j = _cell_of(guide, guide.start)
    i0, j0 = _cell_of(guide, guide.goal)
    prices[i, j], prices[i0, j0] = min(prices[i, j], 8.0), min(prices[i0, j0], 8.0)
    away = _prices_of_ways(prices, i0, j0)
    if away[i, j] == np.inf:
        return 0
    n = 0
    while n < way.shape[0]:
        way[n, 0] = guide.corner[0] + (i + 0.5) * guide.cell
        way[n, 1] = guide.corner[1] + (j + 0.5) * guide.cell
        n += 1
        if i == i0 and j == j0:
            _wear(guide, way, n)
            return n
        best, next_i, next_j = np.inf, i, j
        for a in range(max(0, i - 1), min(prices.shape[0], i + 2)):
            for b in range(max(0, j - 1), min(prices.shape[1], j + 2)):
                if (a != i or b != j) and away[a, b] < away[i, j]:
                    step = 1.0 if a == i or b == j else math.sqrt(2.0)
                    through = away[a, b] + 0.5 * step * (prices[i, j] + prices[a, b])
                    if through < best:
                        best, next_i, next_j = through, a, b
        i, j = next_i, next_j
    return 0
