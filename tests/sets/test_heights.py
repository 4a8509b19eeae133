"""Pushes above the floor: twists in the sets hold on an elastic floor from which objects partly lift."""

import re
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from conftest import ChainMaker, there
from scipy.optimize import linprog

import pushplan.core.contacts as contacts
import pushplan.core.uncertain as uncertain
from pushplan.errors import SupportError
from pushplan.geometry.se2 import transform_points
from pushplan.mechanics.chain import GRAVITY
from pushplan.mechanics.dynamics import ContactDynamics
from pushplan.mechanics.heights import _most, counts_by_centre, inertia_shifts, load_areas, tipping_room
from pushplan.mechanics.intervals import IntervalChain
from pushplan.mechanics.packed import pack_chain
from pushplan.mechanics.support import FeetSupport
from pushplan.sets.named import stable_set, stable_set_over
from pushplan.util.arrays import FloatArray
from pushplan.util.names import KNOWN_LOAD_SETS

GRID = 12
"""Points along a side of a square, in the world frame."""


def cubes(
    make: ChainMaker,
    spans: list[tuple[float, float]],
    z: float | None = None,
    share: float = 0.2,
    masses: tuple[float, ...] = (1.0, 1.0),
) -> IntervalChain:
    """Return cubes with intervals of contact heights, frictions and loads."""
    chain = make.boxes(len(spans), contact_friction=0.45, pusher_friction=0.5)
    contacts = tuple(
        replace(c, height=h, friction=(1.0 - share) * c.friction) for c, h in zip(chain.contacts, spans, strict=True)
    )
    objects = tuple(replace(obj, center_height=z, mass=m) for obj, m in zip(chain.objects, masses, strict=False))
    names = [obj.name for obj in objects]
    return IntervalChain.from_ranges(
        replace(chain, objects=objects, contacts=contacts),
        floor_friction=dict.fromkeys(names, (0.3 * (1.0 - share), 0.3 * (1.0 + share))),
        pressures=dict.fromkeys(names, share) if share > 0.0 else {},
    )


def lifted(rest: FloatArray, points: FloatArray, center: FloatArray) -> FloatArray:
    """Return max(0, a + b . x) times the loads at rest (k,) on an elastic floor, with a given centre."""
    basis = np.column_stack([np.ones(len(points)), points - center])
    active = np.ones(len(points), dtype=np.bool_)
    for _ in range(60):
        weighted = basis * (rest * active)[:, None]
        pressure = basis @ np.linalg.solve(weighted.T @ basis, [1.0, 0.0, 0.0])
        if ((pressure > 0.0) == active).all():
            break
        active = pressure > 0.0
    else:
        raise AssertionError("the elastic floor has found no balance")
    return np.asarray(rest * np.where(active, pressure, 0.0))


def carried(interval: IntervalChain, v: FloatArray, dv: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return the wrenches (n, 3) of all contacts in one sample of the intervals."""
    chain, n = interval.chain, len(interval.chain.objects)
    height = [rng.uniform(*span) for span in chain.contact_heights]
    total = np.zeros((n, 3))
    for i in reversed(range(n)):
        obj = chain.objects[i]
        mu, weight = rng.uniform(*interval.floor_friction[i]), obj.mass * GRAVITY
        if isinstance(obj.support, FeetSupport):
            places, rest = obj.support.positions, np.full(len(obj.support.positions), 0.25)
        else:
            side = 0.05 * (2.0 * np.arange(GRID) + 1.0 - GRID) / GRID
            places, rest = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2), np.ones(GRID**2)
        points = transform_points(obj.pose_chain, places)
        uneven = np.sign((points - points.mean(axis=0)) @ rng.normal(size=2))
        rest = rest * (1.0 + interval.pressures.get(i, 0.0) * uneven)
        rest /= rest.sum()
        g = rest @ points
        velocity = np.stack([v[0] - v[2] * points[:, 1], v[1] + v[2] * points[:, 0]], axis=1)
        u = velocity / np.linalg.norm(velocity, axis=1, keepdims=True)
        turned = [-dv[2] * g[1] - v[2] * v[1] - v[2] ** 2 * g[0], dv[2] * g[0] + v[2] * v[0] - v[2] ** 2 * g[1]]
        push = obj.mass * (dv[:2] + turned)
        z = height[i] if obj.center_height is None else obj.center_height
        ahead = [j for j in range(n) if chain.contacts[j].pusher == i]
        pressure = rest
        for _ in range(100):
            force = mu * weight * pressure @ u + push + total[ahead, :2].sum(axis=0)
            moved = height[i] * force - sum((height[j] * total[j, :2] for j in ahead), z * push)
            before, pressure = pressure, lifted(rest, points, g + moved / weight)
            if np.abs(pressure - before).max() < 1e-12:
                break
        drag = mu * weight * pressure[:, None] * u
        spin = dv[2] * obj.mass * 0.1**2 / 6.0 + g[0] * push[1] - g[1] * push[0]
        about = (points[:, 0] * drag[:, 1] - points[:, 1] * drag[:, 0]).sum() + spin
        total[i] = np.append(drag.sum(axis=0) + push, about) + total[ahead].sum(axis=0)
    return total


def least_row(interval: IntervalChain, v: FloatArray, dv: FloatArray, rng: np.random.Generator) -> float:
    """Return the smallest of all contact conditions, N and N m, in one sample."""
    least = np.inf
    for contact, (fx, fy, m) in zip(interval.chain.contacts, carried(interval, v, dv, rng), strict=True):
        normal, aside = np.array([fx, fy]) @ contact.normal, np.array([fx, fy]) @ contact.tangent
        right, left = (m - end[0] * fy + end[1] * fx for end in (contact.right, contact.left))
        least = min(least, contact.friction * normal - abs(aside), -right, left)
    return float(least)


def test_inertia_moves_known_loads_as_the_balance_of_moments_says(make_chain: ChainMaker) -> None:
    """Without lifting feet, everything is known, and the contacts' margins agree to rounding."""
    feet = np.array([[-0.04, -0.04], [0.05, -0.03], [0.04, 0.04], [-0.03, 0.05]])
    chain = make_chain.boxes(3, support=lambda _: FeetSupport(feet, np.full(4, 0.25)), contact_height=0.02)
    chain = replace(chain, objects=tuple(replace(obj, center_height=0.05) for obj in chain.objects))
    assert not counts_by_centre(chain)
    rng = np.random.default_rng(3)
    twists = 0.2 * (np.array([1.0, 0.0, 0.0]) + rng.normal(size=(20, 3)) * [0.0, 0.2, 1.0])
    rates = rng.normal(size=(20, 3)) * [0.4, 0.2, 0.8]
    packed, length = pack_chain(chain), chain.characteristic_length
    world = np.array(
        [carried(IntervalChain.from_ranges(chain), *pair, rng) for pair in zip(twists, rates, strict=True)]
    )
    dynamics = ContactDynamics(chain)
    np.testing.assert_allclose(dynamics.margins(twists, rates), contacts.contact_margins_of(packed, world), atol=1e-8)
    alpha, beta, gamma, _ = dynamics.rows_along(twists)
    along = np.array([carried(IntervalChain.from_ranges(chain), v, 0.7 * v, rng) for v in twists])
    rows = contacts.facet_rows(packed.rows, along, length)[0]
    np.testing.assert_allclose(alpha + 0.7 * beta + gamma, rows, atol=1e-7)


SPANS = {
    "one": [(0.055, 0.055)],
    "somewhere": [(0.0, 0.06)],
    "two": [(0.05, 0.055), (0.05, 0.055)],
    "uneven": [(0.03, 0.04), (0.0, 0.02)],
    "heavy far object": [(0.015, 0.015), (0.0, 0.004)],
}


@pytest.mark.parametrize("what", SPANS)
def test_twists_in_the_set_hold_for_every_sample(make_chain: ChainMaker, what: str) -> None:
    """Random frictions, loads, heights and accelerations violate no condition of an allowed push."""
    rng = np.random.default_rng(7)
    interval = cubes(make_chain, SPANS[what], z=0.05, masses=(0.5, 2.0) if "heavy" in what else (1.0, 1.0))
    dynamics = ContactDynamics(interval.chain, interval=interval)
    stable = stable_set_over(interval)
    held = 0
    for _ in range(150):
        v = 0.2 * np.array([1.0, rng.normal(scale=0.1), rng.normal(scale=3.0 / len(SPANS[what]) ** 2)])
        dv = rng.normal(size=3) * [0.4, 0.2, 0.8]
        if stable.contains(v[None])[0]:
            held += 1
            assert least_row(interval, 1e-6 * v, np.zeros(3), rng) > 0.0
        if dynamics.margins(v[None], dv[None]).min() > 0.0:
            held += 1
            assert least_row(interval, v, dv, rng) > 0.0
    assert held > 60


@pytest.mark.parametrize("name", ["ecof", "robust", "translation", "stable"])
def test_a_push_that_could_tip_is_refused_with_the_largest_height(make_chain: ChainMaker, name: str) -> None:
    with pytest.raises(
        SupportError, match=r"a push at the height 200 mm could tip 'box0'.*allowed: heights up to [\d.]+ mm"
    ) as refused:
        stable_set_over(cubes(make_chain, [(0.1, 0.2)], z=0.05), name)
    possible = 1e-3 * float(re.findall(r"up to ([\d.]+) mm", str(refused.value))[0])
    assert 0.09 < possible < 0.14
    span = np.array([0.5, 1.0]) * possible
    fits, tips = (cubes(make_chain, [tuple(share * span)], z=0.05) for share in (0.999, 1.001))
    assert stable_set_over(fits, name).contains([[1.0, 0.0, 0.0]])
    with pytest.raises(SupportError, match="could tip"):
        stable_set_over(tips, name)
    off = name in KNOWN_LOAD_SETS
    room, beyond = (there(tipping_room(one.chain, one, off)) for one in (fits, tips))
    assert -1e-4 < beyond[0] < 0.0 < room[0] < 1e-4


def test_numbers_equal_intervals_of_zero_width(make_chain: ChainMaker) -> None:
    chain = make_chain.boxes(2, contact_height=0.03, contact_friction=0.45)
    twists = np.array([1.0, 0.0, 0.0]) + np.random.default_rng(0).normal(size=(200, 3)) * [0.0, 0.2, 1.0]
    interval = IntervalChain.from_ranges(chain)
    for name in ("robust", "stable", "translation", "ecof"):
        np.testing.assert_allclose(
            stable_set(chain, name).margin(twists), stable_set_over(interval, name).margin(twists), atol=1e-12
        )
    assert not counts_by_centre(chain)
    assert counts_by_centre(make_chain.boxes(1, contact_height=0.05))


def test_the_centres_of_uncertain_feet_are_the_possible_ones(make_chain: ChainMaker) -> None:
    feet = np.array([[-0.04, -0.04], [0.05, -0.03], [0.04, 0.04], [-0.03, 0.05]])
    spans = [(0.1, 0.4), (0.2, 0.35), (0.1, 0.3), (0.15, 0.5)]
    chain = make_chain.boxes(1, support=lambda _: FeetSupport(feet, np.full(4, 0.25)), contact_height=0.02)
    interval = IntervalChain.from_ranges(chain, fractions={"box0": spans})
    (area,) = load_areas(chain, interval)
    parts = np.random.default_rng(0).uniform(0.1, 0.5, size=(9000, 4))
    parts = parts[((parts >= np.array(spans)[:, 0]) & (parts <= np.array(spans)[:, 1])).all(axis=1)]
    parts = parts[np.abs(parts.sum(axis=1) - 1.0) < 0.01]
    away = np.abs(parts @ transform_points(chain.objects[0].pose_chain, feet) - area.center)
    assert (away.max(axis=0) < area.drift + 1e-3).all()
    assert (away.max(axis=0) > 0.6 * area.drift).all()
    assert stable_set_over(interval, "robust").contains([[1.0, 0.0, 0.0]])


def test_planned_pushes_hold_in_an_engine_with_six_degrees_of_freedom() -> None:
    """A cube pushed at 55 mm holds, a tower pushed too high falls."""
    pytest.importorskip("mujoco", reason="MuJoCo is not installed; the extra pushplan[physics] brings it")
    from engine_of_heights import Case, tried

    held, count, said = tried(Case("cube", 0.1, 0.1, ((0.045, 0.055),)), 1, 3)
    assert held == count == 2, said
    held, count, said = tried(Case("tower", 0.06, 0.3, ((0.12, 0.12),)), 1, 3)
    assert count == 0
    assert "up to 5" in said
    held, count, said = tried(Case("tower", 0.06, 0.3, ((0.12, 0.12),), knowing=False), 1, 3)
    assert (held, count) == (0, 2), said


def _uneven(make: ChainMaker) -> IntervalChain:
    """Return three boxes, two of them pushed by the first, with different masses, heights and intervals."""
    chain, heights = make.boxes(3), [(0.01, 0.02), (0.0, 0.005), (0.03, 0.034)]
    contacts = tuple(
        replace(c, height=h, pusher=min(c.pusher, 0)) for c, h in zip(chain.contacts, heights, strict=True)
    )
    objects = tuple(
        replace(obj, mass=m, center_height=z, pose_chain=np.add(obj.pose_chain, [0.0, 0.01 * m, 0.3 * m]))
        for obj, m, z in zip(chain.objects, (1.0, 2.0, 0.7), (0.04, 0.05, None), strict=True)
    )
    return IntervalChain.from_ranges(
        replace(chain, objects=objects, contacts=contacts),
        mass={obj.name: (0.8 * obj.mass, 1.3 * obj.mass) for obj in objects},
        floor_friction={"box0": (0.2, 0.3), "box1": (0.15, 0.4), "box2": (0.3, 0.32)},
    )


def test_load_shifts_are_those_of_the_worst_heights_and_masses(make_chain: ChainMaker) -> None:
    """By enumeration; the inertia of a pushed object acts at another height than its own push."""
    interval, worst = _uneven(make_chain), np.zeros((3, 3))
    for mass, height in product(product(*interval.mass), product(*interval.chain.contact_heights)):
        for i, k in ((0, 1), (0, 2)):
            worst[i, k] = max(worst[i, k], abs(height[i] - height[k]) * mass[k] / (mass[i] * GRAVITY))
        for i, z in ((0, 0.04), (1, 0.05)):
            worst[i, i] = max(worst[i, i], abs(height[i] - z) / GRAVITY)
    np.testing.assert_allclose(inertia_shifts(interval.chain, interval), worst, rtol=1e-12)


def test_inertia_includes_the_load_shift_by_all_accelerated_masses(make_chain: ChainMaker) -> None:
    interval = _uneven(make_chain)
    dynamics, shifts = ContactDynamics(interval.chain, interval=interval), inertia_shifts(interval.chain, interval)
    rng = np.random.default_rng(2)
    v, dv = rng.normal((0.2, 0.0, 0.0), (0.1, 0.1, 0.5), (20, 3)), rng.normal(size=(20, 3))
    _, _, slopes = uncertain.sloped_rows_of(dynamics.loads, v)
    moved = np.zeros((20, 3))
    for k, obj in enumerate(interval.chain.objects):
        x, y = transform_points(obj.pose_chain, obj.support.center)
        ax = dv[:, 0] - dv[:, 2] * y - v[:, 2] * (v[:, 1] + v[:, 2] * x)
        ay = dv[:, 1] + dv[:, 2] * x + v[:, 2] * (v[:, 0] - v[:, 2] * y)
        moved += np.hypot(ax, ay)[:, None] * shifts[:, k]
    lost = dynamics.inertia(v, dv).rows - dynamics.rows_of_inertia(v, v, dv).rows
    np.testing.assert_allclose(lost, np.einsum("mkji,mi->mkj", slopes, moved), atol=1e-9)
    assert lost.max() > 0.01


def test_forces_of_pushed_objects_move_a_load_within_its_area_up_to_its_ends(make_chain: ChainMaker) -> None:
    interval = _uneven(make_chain)
    chain, (h0, h1, h2) = interval.chain, np.array(interval.chain.contact_heights)
    ends, moved = np.random.default_rng(0).integers(0, 2, (9, 20_000)), np.zeros((20_000, 2))
    for contact, k, height, end in ((chain.contacts[1], 1, h1, ends[:4]), (chain.contacts[2], 2, h2, ends[4:8])):
        aside = contact.friction / np.hypot(1.0, contact.friction) * (2.0 * end[0, :, None] - 1.0)
        force = interval.loads[k, 1] * (end[1, :, None] * contact.normal + aside * contact.tangent)
        moved += (h0[end[2]] - height[end[3]])[:, None] * force
    moved /= interval.mass[0, ends[8], None] * GRAVITY
    area = load_areas(chain, interval)[0]
    place = transform_points(chain.objects[0].pose_chain, chain.objects[0].support.center)
    off = moved + place - area.center
    np.testing.assert_allclose(np.abs(off).max(axis=0), area.drift, atol=1e-9)


@pytest.mark.parametrize("high", [0, 1])
def test_a_contact_transmits_less_if_any_load_that_it_carries_can_move(make_chain: ChainMaker, high: int) -> None:
    """Of two cubes only one is pushed above the floor; the first contact carries both."""
    spans, twists = [(0.0, 0.0), (0.0, 0.0)], np.array([[1.0, 0.0, 0.0], [1.0, 0.1, 0.2]])
    low = stable_set_over(cubes(make_chain, spans), "stable").contact_margin_values(twists)
    spans[high] = (0.02, 0.04)
    found = stable_set_over(cubes(make_chain, spans), "stable").contact_margin_values(twists)
    assert (found[:, 0] < 0.85 * low[:, 0]).all()


def test_the_largest_sum_of_parts_is_that_of_a_linear_program() -> None:
    rng = np.random.default_rng(5)
    for count in (1, 2, 5, 9):
        values, parts = rng.normal(size=count), np.sort(rng.uniform(-1.0, 1.0, (count, 2)), axis=1)
        parts[0] = -parts[1:].sum(axis=0)[::-1] + [-0.1, 0.1]  # sums of 0 are possible
        best = linprog(-values, A_eq=np.ones((1, count)), b_eq=[0.0], bounds=parts.tolist())
        assert _most(values, parts) == pytest.approx(-there(best.fun))
