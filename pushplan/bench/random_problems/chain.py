"""Random chains that can be pushed: straight ahead and around centres on both sides."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from pushplan.bench.random_problems.parameters import GeneratorError, ProblemParameters, Range
from pushplan.bench.random_problems.scenario_yaml import scenario_yaml
from pushplan.bench.random_problems.shapes import FlushShape, random_box, random_flush_polygon, rounded
from pushplan.mechanics.chain import Chain
from pushplan.scenario.file import scenario_from_text
from pushplan.sets.named import stable_set
from pushplan.util.arrays import FloatArray

DRAWS = 10
"""Chains that are drawn for one with the turns that are asked for."""

LADDER = 2.0 ** (np.arange(13) / 2.0)
"""Radii that are tried, as multiples of the one asked for."""

LEAST_MARGIN = 0.01
"""Margin of the straight push and of the turns."""

SHIFT = 0.2
"""Farthest that contact partners are off each other's middle, as a share of the shorter edge."""

Sections = dict[str, Any]
"""The sections of a scenario file, floor, objects, contacts and pusher, as plain data."""


def random_chain(rng: np.random.Generator, parameters: ProblemParameters) -> tuple[Sections, Chain, float]:
    """Draw chains of one number of objects and one drive until one turns as tightly as asked for.

    When none of `DRAWS` chains does, the one that turns most tightly is taken: long chains before wheels cannot
    turn as tightly as short ones.

    Returns:
        The sections of a scenario file that state the chain, the chain, and how tightly it turns, m.

    Raises:
        GeneratorError: When none of the chains can be pushed straight ahead and around to both sides.
    """
    count = int(rng.integers(parameters.objects[0], parameters.objects[1] + 1))
    drive = _drive(rng, parameters)
    drawn: list[tuple[float, Sections, Chain]] = []
    for _ in range(DRAWS):
        sections = _draw(rng, parameters, count, drive)
        chain = scenario_from_text(scenario_yaml({**sections, "goal": {"pose": [1.0, 0.0, 0.0]}})).chain
        drawn.append((tightest_turn(chain, parameters.turning_radius), sections, chain))
        if drawn[-1][0] <= parameters.turning_radius:
            break
    radius, sections, chain = min(drawn, key=lambda found: found[0])
    if radius == np.inf:
        raise GeneratorError(
            f"none of {DRAWS} random chains can be pushed ahead and around to its left and right; allowed: more "
            "friction at the contacts, fewer objects, a larger turning_radius"
        )
    return sections, chain, radius


def tightest_turn(chain: Chain, radius: float) -> float:
    """Return the first of `LADDER` times `radius` at which turns to both sides are stable, or infinity.

    A radius is here the distance of the turn's centre from the chain frame's x axis, m. The centre lies on the
    axle's line of a pusher with wheels. A chain that cannot be pushed straight ahead has no such turn.
    """
    stable, drive = stable_set(chain, "ecof"), chain.pusher.drive
    if stable.margin([[1.0, 0.0, 0.0]])[0] <= LEAST_MARGIN:
        return np.inf
    x = np.linspace(-1.0, 1.0, 41) * chain.characteristic_length if drive.axle is None else drive.axle[:1]
    for distance in radius * LADDER:
        turns = np.concatenate([_twists(x, side * distance) for side in (1.0, -1.0)])
        if (stable.margin(turns).reshape(2, -1).max(axis=1) > LEAST_MARGIN).all():
            return float(distance)
    return np.inf


def _twists(x: FloatArray, y: float) -> FloatArray:
    """Return the forward twists (k, 3) about the centres (x, y): (vx, vy) = omega (y, -x)."""
    omega = np.sign(y)
    return np.stack([np.full(len(x), omega * y), -omega * x, np.full(len(x), omega)], axis=1)


def _draw(rng: np.random.Generator, parameters: ProblemParameters, count: int, drive: Sections) -> Sections:
    shapes = [_shape(rng, parameters) for _ in range(count)]
    plate = rounded((shapes[0].rear[1] - shapes[0].rear[0]) * rng.uniform(0.9, 1.4))
    fronts = [(-0.5 * plate, 0.5 * plate), *(shape.front for shape in shapes)]
    names = [f"object{i + 1}" for i in range(count)]
    objects = [
        _object(rng, parameters, name, shape, front)
        for name, shape, front in zip(names, shapes, fronts, strict=False)
    ]
    between = [
        {"objects": [first, second], "friction": rounded(rng.uniform(*parameters.contact_friction))}
        for first, second in pairwise(names)
    ]
    return {
        "floor": {"friction": rounded(rng.uniform(*parameters.floor_friction))},
        "objects": objects,
        **({"contacts": {"between": between}} if between else {}),
        "pusher": {"width": plate, "friction": rounded(rng.uniform(*parameters.pusher_friction)), **drive},
    }


def _shape(rng: np.random.Generator, parameters: ProblemParameters) -> FlushShape:
    kind = rng.choice(parameters.shapes)
    return random_box(rng, parameters.size) if kind == "box" else random_flush_polygon(rng, parameters.size)


def _object(
    rng: np.random.Generator, parameters: ProblemParameters, name: str, shape: FlushShape, front: Range
) -> Sections:
    support = str(rng.choice(parameters.supports))
    return {
        "name": name,
        "shape": shape.stated,
        "mass": rounded(rng.uniform(*parameters.mass)),
        "offset": _offset(rng, front, shape.rear),
        **({"support": _feet(rng, shape.outline)} if support == "feet" else {}),
    }


def _offset(rng: np.random.Generator, front: Range, rear: Range) -> float:
    """Return the y at which an object stands roughly in the middle of the front edge before it."""
    shorter = min(front[1] - front[0], rear[1] - rear[0])
    middle = 0.5 * (front[0] + front[1] - rear[0] - rear[1])
    return rounded(middle + rng.uniform(-SHIFT, SHIFT) * shorter)


def _feet(rng: np.random.Generator, outline: FloatArray) -> Sections:
    """Return a foot near each corner, with loads."""
    loads = np.round(rng.dirichlet(np.full(len(outline), 8.0)), 6)
    loads[0] = round(1.0 - float(loads[1:].sum()), 6)
    spots = np.round(0.85 * outline + 0.15 * outline.mean(axis=0), 4)
    return {"feet": [[*spot, load] for spot, load in zip(spots.tolist(), loads.tolist(), strict=True)]}


def _drive(rng: np.random.Generator, parameters: ProblemParameters) -> Sections:
    kind = str(rng.choice(parameters.drives))
    axle = {"axle": [rounded(-rng.uniform(0.1, 0.3)), 0.0, 0.0]}
    radius = {"min_radius": rounded(parameters.turning_radius * rng.uniform(0.2, 0.8))}
    drive = {"differential": {"differential": axle}, "car": {"car": {**axle, **radius}}}
    return {"drive": drive[kind]} if kind in drive else {}
