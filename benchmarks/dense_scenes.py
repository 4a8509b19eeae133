"""Dense scenes with several passages, in which planners can stay in a wrong one; reproducible by number.

Three kinds in turn: a chain that is exactly a Dubins car with a turning radius of 0.5 m among fifteen polygons;
random chains and drives among up to forty obstacles; and random chains in rooms with walls across, each with two or
three gaps of different width at random places.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely
import yaml

from pushplan.bench.random_problems import GeneratorError, random_chain, random_polygon, scenario_yaml
from pushplan.bench.schema import ProblemParameters
from pushplan.geometry.se2 import rotate, transform_points
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray

Document = dict[str, Any]

SIDE = 4.0
CLEARANCE = 0.02
OBSTACLES = {"car": (15, 15), "clutter": (20, 40), "walls": (0, 8)}
SIZES = {"car": (0.3, 0.7), "clutter": (0.15, 0.5), "walls": (0.1, 0.3)}
CHAINS = ProblemParameters(objects=(1, 4), drives=("omnidirectional", "differential", "car"), turning_radius=0.5)
LEAST_WAY = 2.0
"""Distance of start and goal, m."""

_SHARED = yaml.safe_load((Path(__file__).parent / "passages" / "dense-a.yaml").read_text())
CAR: Document = {section: _SHARED[section] for section in ("floor", "objects", "contacts", "pusher")}
"""Chain and drive of the shared scenes: heavy objects that rest on their rear edges leave the drive as the limit."""

NUMBERS = (
    48, 51, 59, 61, 72, 73, 77, 78, 79, 80, 81, 84, 87, 89, 91, 96, 99, 102, 104, 108, 110, 111, 112, 115, 116, 121,
    122, 123, 125, 126, 127, 132, 133, 134, 135, 139, 141, 142, 143, 145, 146, 149, 151, 152,
)  # fmt: skip
"""Scenes from 44 on with a path more than a tenth above the cost of the straight way; those before were tuned on."""


def scene(number: int) -> Document:
    """Return the document of a scene; it need not have a path.

    Raises: GeneratorError: If start and goal find no place.
    """
    rng = np.random.Generator(np.random.PCG64([17, number]))
    kind = [*OBSTACLES][number % len(OBSTACLES)]
    sections = CAR if kind == "car" else random_chain(rng, CHAINS)[0]
    shapes = _walls(rng) if kind == "walls" else []
    count = int(rng.integers(OBSTACLES[kind][0], OBSTACLES[kind][1] + 1))
    shapes += [_polygon(rng, SIZES[kind]) for _ in range(count)]
    body = _body(sections)
    start, goal, kept = _ends(rng, body, shapes if kind == "walls" else [])
    free = shapely.union_all(kept).buffer(CLEARANCE)
    shapes = [shape for shape in shapes if not shapely.Polygon(shape).intersects(free)]
    return {
        "name": f"{kind}-{number}",
        **sections,
        "start": start.tolist(),
        "goal": {"pose": goal.tolist()},
        "workspace": {"x": [0.0, SIDE], "y": [0.0, SIDE]},
        "clearance": 0.002,
        "obstacles": [{"polygon": np.round(shape, 5).tolist()} for shape in shapes],
        "stability": {"margin": 0.0 if kind == "car" else "auto"},
        "planner": {"cost": "travel", "arc_price": 0.0},
    }


def scenes(numbers: Sequence[int]) -> Iterator[Scenario]:
    """Yield the scenes with some numbers."""
    for number in numbers:
        yield scenario_from_text(scenario_yaml(scene(number)), f"scene {number}")


def _body(sections: Document) -> FloatArray:
    """Return the corners of all moving bodies in the chain frame."""
    whole = {**sections, "start": [0, 0, 0], "goal": {"pose": [9, 0, 0]}}
    chain = scenario_from_text(scenario_yaml(whole), "chain").chain
    return np.concatenate([moving.outline for moving in chain.bodies])


def _polygon(rng: np.random.Generator, sizes: tuple[float, float]) -> FloatArray:
    length, width = rng.uniform(*sizes, 2)
    shape = rotate(rng.uniform(-np.pi, np.pi), random_polygon(rng, length, width))
    return np.asarray(shape + rng.uniform(0.0, SIDE, 2))


def _walls(rng: np.random.Generator) -> list[FloatArray]:
    """Return the pieces of two or three parallel walls, each with two or three gaps."""
    pieces, count, axis = [], int(rng.integers(2, 4)), int(rng.integers(0, 2))
    for at in np.linspace(0.0, SIDE, count + 2)[1:-1] + rng.uniform(-0.15, 0.15, count):
        gaps = np.sort(rng.uniform(0.3, SIDE - 0.3, int(rng.integers(2, 4))))
        edges, thick = [0.0], rng.uniform(0.05, 0.15)
        for gap in gaps:
            half = 0.5 * rng.uniform(0.3, 0.5)
            edges += [max(gap - half, edges[-1]), gap + half]
        edges.append(max(SIDE, edges[-1]))
        for low, high in zip(edges[::2], edges[1::2], strict=True):
            if high - low > 0.02:
                corners = np.array([[at, low], [at + thick, low], [at + thick, high], [at, high]])
                pieces.append(corners if axis == 0 else corners[::-1, ::-1])
    return pieces


def _ends(
    rng: np.random.Generator, body: FloatArray, walls: list[FloatArray]
) -> tuple[FloatArray, FloatArray, list[Any]]:
    """Draw start and goal clear of the walls, and their cover, with free distance before the start and behind the
    goal.
    """
    inside = shapely.box(0.0, 0.0, SIDE, SIDE).buffer(-CLEARANCE)
    blocked = shapely.union_all([shapely.Polygon(wall) for wall in walls]).buffer(CLEARANCE)
    for _ in range(2_000):
        start, goal = (np.round([*rng.uniform(0.0, SIDE, 2), rng.uniform(-np.pi, np.pi)], 4) for _ in "sg")
        if np.hypot(*(goal - start)[:2]) < LEAST_WAY:
            continue
        kept = [_covered(body, start, 0.3), _covered(body, goal, -0.3)]
        if all(area.within(inside) and not area.intersects(blocked) for area in kept):
            return start, goal, kept
    raise GeneratorError("start and goal find no place")


def _covered(body: FloatArray, pose: FloatArray, ahead: float) -> Any:
    moved = transform_points(pose, body + np.array([ahead, 0.0]))
    return shapely.MultiPoint(np.concatenate([transform_points(pose, body), moved])).convex_hull
