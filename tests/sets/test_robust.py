"""The worst case over all pressures, against linear programs, enumeration and the pressures themselves."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
import shapely
import shapely.affinity
from scipy.optimize import linprog

from pushplan.errors import PushplanError
from pushplan.geometry.polygon import convex_hull
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.sphere import twists_at
from pushplan.mechanics.support import FeetSupport, UnknownSupport
from pushplan.mechanics.worst_case.area_table import pack_area, table_rows
from pushplan.mechanics.worst_case.envelope_kernel import least_load, start_twist
from pushplan.mechanics.worst_case.load_area import LoadArea
from pushplan.sets.named import stable_set
from pushplan.sets.robust_set import CONDITIONS, RobustSet
from pushplan.util.arrays import FloatArray

if TYPE_CHECKING:
    from conftest import ChainMaker


def least_by_kernel(area: LoadArea, twist: FloatArray, row: FloatArray) -> float:
    table = pack_area(area, table_rows(area))
    vx, vy, omega = twist / np.abs(twist).max()
    start_twist(table, vx, vy, omega)
    return float(least_load(table, row[0], row[1], row[2], np.inf))


def least_by_program(area: LoadArea, twist: FloatArray, row: FloatArray, count: int) -> float:
    """Return the least over loads on `count` points of every edge, on points inside, and at the COR."""
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
    assert solution.fun is not None, solution.message
    return float(solution.fun)


def random_area(rng: np.random.Generator, solid: bool, high: bool) -> LoadArea:
    corners = convex_hull(rng.normal(size=(int(rng.integers(3, 9)), 2)) * [1.0, rng.choice([0.2, 1.0])])
    center = rng.dirichlet(np.full(len(corners), 2.0)) @ corners
    room = shapely.Polygon(corners).exterior.distance(shapely.Point(center))
    return LoadArea(corners, solid, center, float(rng.uniform(0.0, 0.9)) * room if high else 0.0)


def random_question(rng: np.random.Generator, area: LoadArea) -> tuple[FloatArray, FloatArray]:
    """Return a twist, for one in four about a COR under the object, and a row."""
    twist = rng.normal(size=3) * [1.0, 1.0, rng.choice([0.1, 1.0, 5.0])]
    if rng.uniform() < 0.25:
        cor = rng.dirichlet(np.ones(len(area.points))) @ area.points
        twist = np.array([cor[1], -cor[0], 1.0]) * rng.choice([-1.0, 1.0])
    row = rng.normal(size=3) * [1.0, 1.0, rng.choice([0.0, 1.0])]
    return twist, row / np.linalg.norm(row)


@pytest.mark.parametrize("high", [False, True])
@pytest.mark.parametrize("solid", [False, True])
def test_least_load_agrees_with_a_linear_program(solid: bool, high: bool) -> None:
    """Never above it, and below it by no more than its finite number of points explains."""
    rng = np.random.default_rng(3)
    for _ in range(30):
        area = random_area(rng, solid, high)
        twist, row = random_question(rng, area)
        least = least_by_kernel(area, twist, row)
        coarse, fine = (least_by_program(area, twist, row, count) for count in (60, 240))
        assert least <= fine + 1e-8
        assert fine - least <= max(2.0 * (coarse - fine), 1e-3 if solid else 1e-8)


def test_feet_agree_with_enumeration(make_chain: ChainMaker) -> None:
    """At most three feet carry the worst case: all triples with the centre between them."""
    rng = np.random.default_rng(0)
    for count in (3, 4, 6):
        feet = rng.normal(size=(count, 2)) * 0.03
        center = rng.dirichlet(np.ones(count)) @ feet
        chain = make_chain.boxes(1, support=lambda _, f=feet, c=center: FeetSupport(f, None, c))  # type: ignore[misc]
        triples = [np.array(t) for t in itertools.combinations(range(count), 3)]
        loads = []
        for triple in triples:
            fractions = np.linalg.solve(np.vstack([feet[triple].T, np.ones(3)]), [*center, 1.0])
            if (fractions > 1e-9).all():
                loads.append(FeetSupport(feet[triple], fractions))
        twists = rng.normal(size=(200, 3)) * [0.5, 0.5, 10.0] + [1.0, 0.0, 0.0]
        worst = np.min([stable_set(_on(chain, load)).margin(twists) for load in loads], axis=0)
        robust = stable_set(chain, "robust").margin(twists)
        assert ((robust > 0.0) == (worst > 0.0)).all()
        assert (robust > 0.0).any()
        assert (robust <= worst + 1e-9)[robust > 0.0].all()


def _on(chain: Chain, support: FeetSupport) -> Chain:
    return replace(chain, objects=tuple(replace(obj, support=support) for obj in chain.objects))


def test_worst_case_is_a_pressure_that_does_it(make_chain: ChainMaker) -> None:
    """On the boundary of the set, the worst pressure brings the contact to the brink; a little outside, it breaks."""
    tried = 0
    for seed in range(6):
        chain = make_chain.random(seed, 1 + seed % 3)
        robust = RobustSet(chain)
        found = robust.meridians(count=48)
        for lon, lat in list(zip(found.longitude, found.upper, strict=True))[::3]:
            if lat > 1.5:
                continue
            for step, low, high in ((0.0, -1e-6, 1e-6), (1e-2, -1.0, 0.0)):
                twist = twists_at(lon, lat + step, chain.characteristic_length)
                worst = robust.worst_case(twist)
                objects = list(chain.objects)
                for i, points in worst.points.items():
                    np.testing.assert_allclose(worst.fractions[i] @ points, chain_center(chain, i), atol=1e-7)
                    placed = FeetSupport(_local(chain, i, points), worst.fractions[i])
                    objects[i] = replace(objects[i], support=placed)
                loaded = stable_set(replace(chain, objects=tuple(objects)))
                assert low < loaded.contact_margins([twist])[0, worst.contact] < high
                assert worst.condition in CONDITIONS
                assert worst.margin == pytest.approx(robust.margin([twist])[0], abs=1e-9)
                tried += 1
    assert tried > 20


def chain_center(chain: Chain, i: int) -> FloatArray:
    pose = chain.objects[i].pose_chain
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.asarray(pose[:2] + np.array([[c, -s], [s, c]]) @ chain.objects[i].support.center)


def _local(chain: Chain, i: int, points: FloatArray) -> FloatArray:
    pose = chain.objects[i].pose_chain
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.asarray((points - pose[:2]) @ np.array([[c, -s], [s, c]]))


def test_known_loads_count_by_their_centre_alone(make_chain: ChainMaker) -> None:
    known, unknown = make_chain.boxes(2), make_chain.boxes(2, support=UnknownSupport)
    twists = np.random.default_rng(0).normal(size=(50, 3)) * [0.2, 0.2, 1.0] + [1.0, 0.0, 0.0]
    assert (stable_set(known, "robust").margin(twists) == stable_set(unknown, "robust").margin(twists)).all()


def test_margins_below_the_floor_stay_below(make_chain: ChainMaker) -> None:
    """The quick answer may differ from the exact one only at or below the floor."""
    for feet in (False, True):
        robust = stable_set(make_chain.random(5, 3, feet=feet), "robust")
        twists = np.random.default_rng(1).normal(size=(500, 3)) * [1.0, 1.0, 5.0]
        exact = robust.margin_values(twists)
        for floor in (-0.3, 0.0, 0.2):
            quick = robust.margin_values(twists, floor)
            assert (quick == exact)[exact > floor].all()
            assert (quick <= floor)[exact <= floor].all()
        assert np.abs(robust.contact_margin_values(twists).min(axis=1) - exact).max() < 1e-9


def test_margin_is_the_same_however_twists_are_grouped(make_chain: ChainMaker) -> None:
    robust = stable_set(make_chain.random(2, 3), "robust")
    twists = np.random.default_rng(1).normal(size=(40, 3))
    together = robust.margin(twists)
    assert [robust.margin(twist[None])[0] for twist in twists] == together.tolist()


def test_symmetries_of_the_worst_case(make_chain: ChainMaker) -> None:
    """Mirroring and scaling a chain mirrors and scales its set; turning it about the origin turns the set."""
    chain = make_chain.random(3, 3)
    twists = np.random.default_rng(0).normal(size=(60, 3)) * [0.4, 0.4, 2.0] + [1.0, 0.0, 0.0]
    for name in ("cof", "stable", "robust"):
        margin = stable_set(chain, name).margin(twists)
        mirrored = stable_set(make_chain.mirrored(chain), name).margin(twists * [1.0, -1.0, -1.0])
        scaled = stable_set(make_chain.scaled(chain, 3.0), name).margin(twists * [3.0, 3.0, 1.0])
        c, s = np.cos(0.7), np.sin(0.7)
        turned = np.column_stack([twists[:, :2] @ np.array([[c, s], [-s, c]]), twists[:, 2]])
        moved = stable_set(make_chain.moved(chain, np.array([0.0, 0.0, 0.7])), name).margin(turned)
        for other in (mirrored, scaled, moved):
            np.testing.assert_allclose(other, margin, atol=1e-8)


def test_bad_twists_are_refused(make_chain: ChainMaker) -> None:
    robust = RobustSet(make_chain.boxes(1))
    with pytest.raises(PushplanError, match="twist 0 is zero"):
        robust.worst_case([0.0, 0.0, 0.0])
