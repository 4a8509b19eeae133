"""Smallest turns of squares in a row under any pressure, by linear programs that share no code with the package."""

import numpy as np
import pytest
import shapely
from conftest import ChainMaker
from scipy.optimize import linprog

from pushplan.sets.named import stable_set
from pushplan.util.arrays import FloatArray

MU = 0.5
EXACT = {1: 0.81527, 2: 1.08427, 3: 1.32519, 4: 1.60345}
"""From the lower envelope in closed form, to 1e-5. The package takes off what its samples of an outline may
miss: its radii are never smaller, and at most 0.1 % larger."""


def least_row(n: int, cor: tuple[float, float], cells: int) -> float:
    """Return the least of all 4 n contact conditions, over all pressures on a grid under every square.

    Square i has its middle at (i + 1/2, 0), contact k is the edge x = k, and all turn counter-clockwise about `cor`.
    Each square weighs 1 / MU, so that the friction of a loaded point is its share of the load.
    """
    along = np.linspace(-0.5, 0.5, cells + 1)
    grid = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
    equations, right = np.vstack([grid.T, np.ones(len(grid))]), [0.0, 0.0, 1.0]
    lowest = np.inf
    for k in range(n):
        total = np.zeros(4)
        for i in range(k, n):
            x, y = grid[:, 0] + i + 0.5, grid[:, 1]
            speed = np.hypot(x - cor[0], y - cor[1])
            fx, fy = -(y - cor[1]) / speed, (x - cor[0]) / speed
            about_right = (x - k) * fy - (y + 0.5) * fx
            about_left = (x - k) * fy - (y - 0.5) * fx
            rows = (MU * fx - fy, MU * fx + fy, -about_right, about_left)
            for j, row in enumerate(rows):
                solution = linprog(row, A_eq=equations, b_eq=right, method="highs")
                assert solution.fun is not None, solution.message
                total[j] += solution.fun
        lowest = min(lowest, float(total.min()))
    return lowest


def tightest(make_chain: ChainMaker, n: int) -> FloatArray:
    """Return the stable COR (2,) nearest the line of the squares' middles."""
    chain = make_chain.boxes(n, (1.0, 1.0), contact_friction=MU, pusher_friction=MU)
    region = stable_set(chain, "robust").cor_region(+1, (-9.0, -9.0, 9.0, 9.0))
    corners = shapely.get_coordinates(region)
    return np.asarray(corners[corners[:, 1].argmin()])


@pytest.mark.parametrize("n", [1, 2, 4])
def test_smallest_turns_agree_with_linear_programs(make_chain: ChainMaker, n: int) -> None:
    """No pressure on a grid breaks a turn 0.1 % wider; 1 % tighter, some pressure on 21 x 21 points does."""
    x, radius = tightest(make_chain, n)
    assert EXACT[n] - 2e-5 < radius < 1.001 * EXACT[n]
    assert least_row(n, (x, 1.001 * radius), 20) > 0.0
    assert least_row(n, (x, 0.99 * radius), 20) < 0.0
