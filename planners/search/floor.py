"""How far places on the floor are from the goal around the obstacles: the way of the body's middle on a grid."""

from __future__ import annotations

import math

import numpy as np

from pushplan.compiled import compiled, no_refcount
from pushplan.geometry import se2
from pushplan.planners.collision.scene import flatten
from pushplan.planners.collision.separation import Scene, separation
from pushplan.planners.problem.problem import Box, Problem
from pushplan.planners.problem.steering import STRAIGHT
from pushplan.util.arrays import FloatArray

_SPECK = 1e-7 * np.array([[-1.0, -1.0], [1.0, -1.0], [0.0, 1.0]])


def middle_of(problem: Problem) -> FloatArray:
    """Return the body's middle in the chain frame, and the direction of its straight push there (3,)."""
    push = problem.families[0, STRAIGHT]
    return np.append(problem.scene.body_bound[:2], math.atan2(push[1], push[0]))


def distances_to(pose: FloatArray, problem: Problem, box: Box) -> tuple[FloatArray, FloatArray]:
    """Return distances (nx, ny) of the body's middle from where a pose has it, m, infinite where there is no way.

    Args:
        pose: (3,) of the chain frame.
        problem: What to plan.
        box: (xmin, ymin, xmax, ymax) that the grid covers.

    Returns:
        The distances; and the lower left corner of the grid and the side of its cells (3,), m.
    """
    scene = problem.scene
    cell = max(box[2] - box[0], box[3] - box[1]) / 72
    nx, ny = (max(1, round((box[k + 2] - box[k]) / cell)) for k in (0, 1))
    middle = middle_of(problem)
    across = scene.body.corners[:, :2] @ np.array([-math.sin(middle[2]), math.cos(middle[2])])
    least = 0.25 * float(np.ptp(across))  # nearer than half of the half width, blocked whatever the heading
    point = scene._replace(body=flatten([_SPECK]), body_bound=np.array([0.0, 0.0, 2.0 * _SPECK[1, 0]]))
    grid = np.array([box[0], box[1], cell])
    there = se2.transform_points(pose, middle[:2])
    return distances(point, grid, nx, ny, least, there), grid


@compiled
def distances(
    point: Scene, grid: FloatArray, nx: int, ny: int, least: float, there: FloatArray
) -> FloatArray:
    """Return the lengths (nx, ny) of ways to a place (2,) through cells that keep `least` from everything, m."""
    cell = grid[2]
    free = np.empty((nx, ny), dtype=np.bool_)
    for i in range(nx):
        for j in range(ny):
            x, y = grid[0] + (i + 0.5) * cell, grid[1] + (j + 0.5) * cell
            # Half a diagonal is added, so that a cell counts as free when any place in it is.
            free[i, j] = separation(point, x, y, 0.0, least) + 0.71 * cell >= least
    away = np.full((nx, ny), np.inf)
    i0 = min(nx - 1, max(0, int((there[0] - grid[0]) / cell)))
    j0 = min(ny - 1, max(0, int((there[1] - grid[1]) / cell)))
    away[i0, j0] = 0.0
    quiet = 0
    for sweep in range(60):
        changed = False
        for a in range(nx):
            i = a if sweep % 2 == 0 else nx - 1 - a
            for b in range(ny):
                j = b if sweep // 2 % 2 == 0 else ny - 1 - b
                if free[i, j] and _is_nearer(away, i, j, cell):
                    changed = True
        quiet = 0 if changed else quiet + 1
        # Sweeps go in four orders in turn; when none of them changed anything, distances are final.
        if quiet == 4:
            break
    return away


@no_refcount
def _is_nearer(away: FloatArray, i: int, j: int, cell: float) -> bool:
    """Lower a cell's distance to what its neighbours allow; return whether that changed it."""
    nx, ny = away.shape
    best = away[i, j]
    for di in range(-1, 2):
        for dj in range(-1, 2):
            a, b = i + di, j + dj
            if 0 <= a < nx and 0 <= b < ny:
                # Octile distances: steps to the side cost a cell, diagonal ones sqrt(2) cells.
                best = min(best, away[a, b] + cell * (1.0 if di * dj == 0 else math.sqrt(2.0)))
    changed = bool(best < away[i, j])
    away[i, j] = best
    return changed
