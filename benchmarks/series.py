"""Easy rooms in series: snakes, mazes, offices and walls with gaps, for two boxes of 8 x 14 cm.

Most passages are wide; what makes them hard is how many follow one another. Some gaps and a corridor leave the plate
millimetres on each side. The same arguments give the same scene.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from pushplan.scenario.file import scenario_from_document
from pushplan.scenario.model import Scenario

Wall = tuple[float, float, float, float]
"""xmin, ymin, xmax, ymax, m."""

THICK = 0.05
"""Of a wall, m."""


def snake(lanes: int = 8, width: float = 1.6, length: float = 6.0, gap: float = 1.0) -> Scenario:
    """Return lanes side by side, joined by gaps at alternate ends; the goal of an even number is on the left."""
    walls = []
    for k in range(1, lanes):
        begin, y = 0.0 if k % 2 else gap, k * width
        walls.append((begin, y - THICK / 2, begin + length - gap, y + THICK / 2))
    end = [0.7, (lanes - 0.5) * width, np.pi]
    return _scenario(f"snake-{lanes}", walls, (length, lanes * width), [0.7, width / 2, 0.0], end)


def maze(side: int, seed: int, cell: float = 1.0, chain: dict[str, Any] | None = None) -> Scenario:
    """Return a maze of square cells that a depth-first walk has joined to a tree, for any chain."""
    rng = np.random.Generator(np.random.PCG64([23, side, seed]))
    seen, stack, opened = {(0, 0)}, [(0, 0)], set()
    while stack:
        here = stack[-1]
        free = [there for there in _neighbours(here, side) if there not in seen]
        if not free:
            stack.pop()
            continue
        there = free[int(rng.integers(len(free)))]
        opened.add(frozenset((here, there)))
        seen.add(there)
        stack.append(there)
    walls = [
        _between(here, there, cell, 0.0, 0.0)
        for here, there in _pairs(side)
        if frozenset((here, there)) not in opened
    ]
    goal = (side - 1, side - 1)
    start_turn = 0.0 if frozenset(((0, 0), (1, 0))) in opened else np.pi / 2
    goal_turn = 0.0 if frozenset((goal, (side - 2, side - 1))) in opened else np.pi / 2
    return _scenario(
        f"maze-{side}-{seed}",
        walls,
        (side * cell, side * cell),
        [0.5 * cell, 0.5 * cell, start_turn],
        [(side - 0.5) * cell, (side - 0.5) * cell, goal_turn],
        chain,
    )


def office(side: int, seed: int, room: float = 3.0, door: float = 1.0, closed: float = 0.3) -> Scenario:
    """Return square rooms, most of them with doors somewhere in their walls; there need not be a passage."""
    rng = np.random.Generator(np.random.PCG64([29, side, seed]))
    walls: list[Wall] = []
    for here, there in _pairs(side):
        if rng.random() < closed:
            walls.append(_between(here, there, room, 0.0, 0.0))
            continue
        at = rng.uniform(0.2, room - door - 0.2)
        walls.append(_between(here, there, room, 0.0, room - at))
        walls.append(_between(here, there, room, at + door, 0.0))
    far = (side - 0.5) * room
    return _scenario(
        f"office-{side}-{seed}", walls, (side * room, side * room), [room / 2, room / 2, 0.0], [far, far, 0.0]
    )


def gaps(name: str, clearance: float, ends: list[tuple[float, float, float]], *stated: Any) -> Scenario:
    """Return a room with walls across, each with a gap that leaves a clearance (m) on both sides of the plate.

    Args:
        name: Beginning of the scenario's name.
        clearance: m.
        ends: Begin and end of each wall along x, and the middle of its gap, m.
        stated: Size of the room, start and goal.
    """
    half, (_, height) = PLATE / 2 + clearance, stated[0]
    walls = [wall for x, end, y in ends for wall in ((x, 0.0, end, y - half), (x, y + half, end, height))]
    return _scenario(f"{name}-{1e3 * clearance:g}mm", walls, *stated)


def scenes() -> Iterator[Scenario]:
    """Yield the rooms of the benchmark tables."""
    yield snake(8)
    for side in (8, 10):
        for seed in range(1, 4):
            yield maze(side, seed)
    yield office(10, 1)
    for clearance in (0.01, 0.003):
        three = [(3.0, 3.1, 2.2), (6.0, 6.1, 3.8), (9.0, 9.1, 2.6)]
        yield gaps("three-walls", clearance, three, (12.0, 6.0), [1.0, 3.0, 0.0], [11.0, 3.0, 0.0])
        yield gaps("gap", clearance, [(2.0, 2.1, 2.0)], (4.0, 4.0), [0.6, 1.2, 0.0], [3.4, 2.8, 0.0])
        yield gaps("corridor", clearance, [(2.0, 5.0, 2.0)], (7.0, 4.0), [0.6, 1.2, 0.0], [6.4, 2.8, 0.0])


PLATE = 0.20
"""Width of the plate, m."""


def _neighbours(cell: tuple[int, int], side: int) -> list[tuple[int, int]]:
    i, j = cell
    around = ((i + 1, j), (i, j + 1), (i - 1, j), (i, j - 1))
    return [(a, b) for a, b in around if 0 <= a < side and 0 <= b < side]


def _pairs(side: int) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Return cells with a common side, the left or lower one first."""
    cells = [(i, j) for i in range(side) for j in range(side)]
    return [(cell, there) for cell in cells for there in _neighbours(cell, side) if there > cell]


def _between(here: tuple[int, int], there: tuple[int, int], cell: float, low: float, high: float) -> Wall:
    """Return the wall between two cells, the second right of or above the first, shortened at both ends."""
    i, j = here
    if there[0] > i:
        x = (i + 1) * cell
        return x - THICK / 2, j * cell + low, x + THICK / 2, (j + 1) * cell - high
    y = (j + 1) * cell
    return i * cell + low, y - THICK / 2, (i + 1) * cell - high, y + THICK / 2


def _scenario(
    name: str,
    walls: list[Wall],
    room: tuple[float, float],
    start: list[float],
    goal: list[float],
    chain: dict[str, Any] | None = None,
) -> Scenario:
    box = {"shape": {"box": [0.08, 0.14]}, "mass": 1.0}
    two_boxes = {
        "floor": {"friction": 0.3},
        "objects": [{"name": "near", **box}, {"name": "far", **box}],
        "contacts": {"friction": 0.5},
        "pusher": {"width": PLATE, "friction": 0.5},
    }
    document: dict[str, Any] = {
        "format": "pushplan/1",
        "name": name,
        **(chain or two_boxes),
        "start": [float(value) for value in start],
        "goal": {"pose": [float(value) for value in goal]},
        "workspace": {"x": [0.0, room[0]], "y": [0.0, room[1]]},
        "obstacles": [
            {"polygon": [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]}
            for x0, y0, x1, y1 in (tuple(float(value) for value in wall) for wall in walls)
        ],
    }
    return scenario_from_document(document)
