"""The worst case over all pressures, against linear programs, enumeration and the pressures themselves."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
import shapely.affinity
from conftest import ChainMaker
from scipy.optimize import linprog

import pushplan.core.uncertain as uncertain
from pushplan.geometry.polygon import convex_hull
from pushplan.geometry.se2 import inverse, transform_points
from pushplan.mechanics.chain import GRAVITY, Chain, Contact, PushedObject, Pusher
from pushplan.mechanics.heights import LoadArea, load_areas
from pushplan.mechanics.sphere import twists_at
from pushplan.mechanics.support import FeetSupport, Support, UnknownSupport
from pushplan.mechanics.uncertain import pack_centred
from pushplan.sets.named import stable_set
from pushplan.sets.unknown_load_sets import RobustSet
from pushplan.util.arrays import FloatArray


def placed_on(area: LoadArea, rng: np.random.Generator) -> Chain:
    """Return one object with a load area and unit friction load, pushed through a random contact."""
    support: Support = FeetSupport(area.points, None, area.center)
    if area.solid:
        support = UnknownSupport(area.points, area.center)
    obj = PushedObject("object", area.points, 1.0 / GRAVITY, 1.0, support, np.zeros(3))
    right, left = rng.normal(size=(2, 2))
    pusher = Pusher(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]), 0.5, area.shift)
    return Chain((obj,), (Contact(right, left, float(rng.uniform(0.1, 0.8)), 0, -1),), pusher)


def least_by_program(area: LoadArea, twist: FloatArray, row: FloatArray, count: int) -> tuple[float, FloatArray]:
    """Return the least over loads on `count` points of every edge, on points inside, and at the COR.

    And the places (p, 2) and parts of what does it, (p, 3).
    """
    corners = area.points
    places = [corners]
    if area.solid:
        along = np.linspace(0.0, 1.0, count, endpoint=False)[:, None]
        edges = zip(corners, np.roll(corners, -1, axis=0), strict=True)
        places = [p + along * (q - p) for p, q in edges]
        places.append(np.random.default_rng(0).dirichlet(np.ones(len(corners)), size=2 * count) @ corners)
    x = np.concatenate(places)
    v = twist[:2] + twist[2] * np.stack([-x[:, 1], x[:, 0]], axis=1)
    u = v / np.linalg.norm(v, axis=1, keepdims=True)
    cor = np.array([-twist[1], twist[0]]) / twist[2]
    if area.solid and shapely.Polygon(corners).contains(shapely.Point(cor)):
        angle = np.linspace(0.0, 2.0 * np.pi, 720)
        x = np.concatenate([x, np.tile(cor, (720, 1))])
        u = np.concatenate([u, np.stack([np.cos(angle), np.sin(angle)], axis=1)])
    q = u @ row[:2] + row[2] * (x[:, 0] * u[:, 1] - x[:, 1] * u[:, 0])
    equations = np.vstack([(x - area.shift * u).T, np.ones(len(x))])
    solution = linprog(q, A_eq=equations, b_eq=[*area.center, 1.0], method="highs")
    assert solution.x is not None, solution.message
    return float(q @ solution.x), np.column_stack([x, solution.x])[solution.x > 1e-9]


def random_area(rng: np.random.Generator, solid: bool, high: bool) -> LoadArea:
    corners = convex_hull(rng.normal(size=(int(rng.integers(3, 9)), 2)) * [1.0, rng.choice([0.2, 1.0])])
    center = rng.dirichlet(np.full(len(corners), 2.0)) @ corners
    room = shapely.Polygon(corners).exterior.distance(shapely.Point(center))
    return LoadArea(corners, solid, center, float(rng.uniform(0.0, 0.9)) * room if high else 0.0)


def random_twist(rng: np.random.Generator, area: LoadArea) -> FloatArray:
    """Return a twist; one in four is about a COR under the object."""
    twist = rng.normal(size=3) * [1.0, 1.0, rng.choice([0.1, 1.0, 5.0])]
    if rng.uniform() < 0.25:
        cor = rng.dirichlet(np.ones(len(area.points))) @ area.points
        twist = np.array([cor[1], -cor[0], 1.0]) * rng.choice([-1.0, 1.0])
    return np.asarray(twist)


@pytest.mark.parametrize("high", [False, True])
@pytest.mark.parametrize("solid", [False, True])
def test_least_rows_agree_with_a_linear_program(solid: bool, high: bool) -> None:
    """Never above it, and below it only by the error of the finite numbers of points."""
    rng = np.random.default_rng(3)
    for _ in range(8):
        area = random_area(rng, solid, high)
        chain, twist = placed_on(area, rng), random_twist(rng, area)
        packed = pack_centred(chain)
        least, _ = uncertain.rows_of(packed, twist[None])
        for found, (gx, gy, gm) in zip(least[0, 0], packed.facets[0], strict=True):
            row = np.array([gx, gy, gm / packed.length])
            coarse, fine = (least_by_program(area, twist, row, count)[0] for count in (60, 240))
            assert found <= fine + 1e-8
            assert fine - found <= max(2.0 * (coarse - fine), 1e-3) if solid else fine - found <= 1e-8


def test_the_worst_pressure_attains_the_bound(make_chain: ChainMaker) -> None:
    """On the boundary of the set, the worst pressure reaches the limit of the contact; a little outside, it exceeds
    it.
    """
    tried = 0
    for seed in range(6):
        chain = make_chain.random(seed, 1 + seed % 3)
        robust, packed = RobustSet(chain), pack_centred(chain, None)
        lines = robust.meridians(count=48)
        for lon, lat in list(zip(lines.longitude, lines.upper, strict=True))[::6]:
            if lat > 1.5:
                continue
            for step, low, high in ((0.0, -1e-6, 2e-4), (1e-2, -1.0, 0.0)):
                twist = twists_at(lon, lat + step, chain.characteristic_length)
                k = int(robust.contact_margins([twist])[0].argmin())
                rows, _ = uncertain.rows_of(packed, twist[None])
                gx, gy, gm = packed.facets[k, rows[0, k].argmin()]
                areas, objects = load_areas(chain, None), list(chain.objects)
                for i in np.flatnonzero(packed.carried[k]):
                    own = objects[i]
                    _, spread = least_by_program(areas[i], twist, np.array([gx, gy, gm / packed.length]), 120)
                    placed = transform_points(inverse(own.pose_chain), spread[:, :2])
                    objects[i] = replace(own, support=FeetSupport(placed, spread[:, 2] / spread[:, 2].sum()))
                loaded = stable_set(replace(chain, objects=tuple(objects)))
                assert low < loaded.contact_margins([twist])[0, k] < high
                tried += 1
    assert tried > 10


@pytest.mark.parametrize("high", [False, True])
@pytest.mark.parametrize("solid", [False, True])
def test_the_margin_is_that_of_the_least_row(solid: bool, high: bool) -> None:
    """Quick bounds decide which rows are computed, and must be below them, most of all where they are tight."""
    rng = np.random.default_rng(4)
    for _ in range(12):
        area = random_area(rng, solid, high)
        packed = pack_centred(placed_on(area, rng))
        twists = rng.normal(size=(80, 3))
        twists[:60, 2] *= 10.0 ** rng.uniform(-4.0, 0.0, 60)
        rows, sizes = uncertain.rows_of(packed, twists)
        expected = (rows / sizes[..., None]).min(axis=(1, 2))
        np.testing.assert_allclose(uncertain.margins_of(packed, twists, -1e9), expected, atol=2e-4)
