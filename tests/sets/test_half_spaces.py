"""Polyhedral sets against their geometric definition, and odd chains in every set."""

import re
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from conftest import ChainMaker

from pushplan.errors import PushplanError, SupportError
from pushplan.geometry.polygon import convex_hull
from pushplan.mechanics.chain import Chain, Contact
from pushplan.mechanics.contacts import cof
from pushplan.mechanics.dynamics import dynamic_margins, dynamic_rows
from pushplan.mechanics.heights import load_areas
from pushplan.mechanics.intervals import IntervalChain
from pushplan.mechanics.perturb import slid
from pushplan.mechanics.sphere import twists_about
from pushplan.mechanics.support import FeetSupport, PressureMapSupport, UniformSupport, UnknownSupport
from pushplan.plans.path import PushPath
from pushplan.sets.named import stable_set, stable_set_over
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray
from pushplan.util.names import STABLE_SETS


def cors_near(chain: Chain, seed: int, count: int) -> FloatArray:
    """Return CORs within a few lengths of the chain."""
    length = chain.characteristic_length
    return np.asarray(np.random.default_rng(seed).uniform(-4.0, 4.0, size=(count, 2)) * length)


def in_wedges(chain: Chain, c: FloatArray, sense: int) -> bool:
    """Return whether Algorithm 2 accepts a COR: at every contact, the velocity of the COF points through its segment,
    inside its friction cone."""
    loads = np.array([obj.friction_load for obj in chain.objects])
    centers = np.array([cof(obj) for obj in chain.objects])
    for k, contact in enumerate(chain.contacts):
        g = loads[k:] @ centers[k:] / loads[k:].sum()
        v = sense * np.array([c[1] - g[1], g[0] - c[0]])
        if abs(v @ contact.tangent) >= contact.friction * (v @ contact.normal):
            return False
        to_line = (contact.right - g) @ contact.normal / (v @ contact.normal)
        where = (g + to_line * v - contact.right) @ contact.tangent
        if not 0.0 < where < contact.length:
            return False
    return True


def stable_accepts(contact: Contact, hull: FloatArray, g: FloatArray, c: FloatArray, sense: int) -> bool:
    """Return whether STABLE accepts a COR for one contact, by lines and strips as Lynch and Mason draw them.

    (1) For both edges f of the friction cone the COR lies outside the strip perpendicular to f around the hull. A
    counter-clockwise turn about a COR left of f moves the hull backwards along it, and so on. (2) For both ends e it
    lies outside the strip between the middle of e and g and the line r^2 / p beyond g.
    """
    n, t = contact.normal, contact.tangent
    for f, side in ((n - contact.friction * t, +1.0), (n + contact.friction * t, -1.0)):
        inner = np.array([-f[1], f[0]]) * side  # points into the cone
        along = (hull - c) @ f
        if not ((along > 0.0).all() or (along < 0.0).all()):
            return False
        velocity = sense * np.array([-(hull - c)[0, 1], (hull - c)[0, 0]])
        if not velocity @ inner > 0.0:
            return False
    r2, push = ((hull - g) ** 2).sum(axis=1).max(), c - g
    for e, turn in ((contact.right, -1), (contact.left, +1)):
        p = float(np.linalg.norm(e - g))
        beyond = -float(push @ (e - g)) / p  # distance from g on the side away from e
        if -p / 2.0 <= beyond <= r2 / p:
            return False
        # the load at g turns with the chain about e when the COR is on e's side, against it beyond g
        if (sense if beyond < 0.0 else -sense) != turn:
            return False
    return True


@pytest.mark.parametrize("n", [1, 2, 4])
def test_cof_is_the_intersection_of_wedges(make_chain: ChainMaker, n: int) -> None:
    inside = 0
    for seed in range(6):
        chain = make_chain.random(seed, n)
        stable = stable_set(chain, "cof")
        for sense in (1, -1):
            cors = cors_near(chain, seed, 300)
            expected = [in_wedges(chain, c, sense) for c in cors]
            inside += sum(expected)
            assert stable.contains(twists_about(cors, sense)).tolist() == expected
    assert inside > 50


@pytest.mark.parametrize("n", [1, 2, 4])
def test_stable_is_the_intersection_of_half_planes(make_chain: ChainMaker, n: int) -> None:
    """With the farthest support point, not the farthest contact end, as the radius r."""
    inside = 0
    for seed in range(6):
        chain = make_chain.random(seed, n)
        loads = np.array([obj.friction_load for obj in chain.objects])
        areas = load_areas(chain)
        centers = np.array([area.center for area in areas])
        for sense in (1, -1):
            cors = 3.0 * cors_near(chain, seed, 300)
            expected = [
                all(
                    stable_accepts(
                        contact,
                        convex_hull(np.concatenate([area.points for area in areas[k:]])),
                        loads[k:] @ centers[k:] / loads[k:].sum(),
                        c,
                        sense,
                    )
                    for k, contact in enumerate(chain.contacts)
                )
                for c in cors
            ]
            inside += sum(expected)
            found = stable_set(chain, "stable").contains(twists_about(cors, sense))
            assert found.tolist() == expected
    assert inside > 50


@pytest.mark.parametrize("name", ["ecof", "cof", "translation"])
def test_unknown_loads_are_refused_where_they_matter(make_chain: ChainMaker, name: str) -> None:
    chain = make_chain.boxes(2, support=UnknownSupport)
    with pytest.raises(SupportError, match=r"the load under 'box0' is unknown; .*'stable' or 'robust'"):
        stable_set(chain, name)
    for other in ("stable", "robust"):
        assert stable_set(chain, other).contains([[1.0, 0.0, 0.0]]).all()


INTERVALS = tuple(f"{name} of intervals" for name in STABLE_SETS if name != "cof")


def make(chain: Chain, name: str) -> StableSet:
    """Return a set of a chain, or of all masses and floor frictions within 30 % of the nominal ones."""
    name, _, rest = name.partition(" ")
    if not rest:
        return stable_set(chain, name)
    spans = {obj.name: (0.7 * obj.mass, 1.3 * obj.mass) for obj in chain.objects}
    frictions = {obj.name: (0.7 * obj.floor_friction, 1.3 * obj.floor_friction) for obj in chain.objects}
    return stable_set_over(IntervalChain.from_ranges(chain, spans, frictions), name)


def odd_chains(make_chain: ChainMaker) -> list[Chain]:
    """Return chains with zero or huge friction, slivers, one or two feet, or an eccentric load."""
    sliver = np.array([[-0.05, -1e-7], [0.05, -1e-7], [0.05, 1e-7], [-0.05, 1e-7]])
    return [
        make_chain.boxes(2),
        make_chain.boxes(2, floor_friction=0.0),
        make_chain.boxes(2, contact_friction=0.0),
        make_chain.boxes(2, contact_friction=1e9, pusher_friction=1e9),
        make_chain.boxes(2, floor_friction=1e9),
        make_chain.boxes(2, size=(1e-6, 0.1)),
        make_chain.boxes(1, support=lambda _: UniformSupport(sliver)),
        make_chain.boxes(1, support=lambda _: FeetSupport(np.zeros((1, 2)), np.ones(1))),
        make_chain.boxes(1, support=lambda _: FeetSupport(np.array([[0.0, -0.05], [0.0, 0.05]]), np.full(2, 0.5))),
        make_chain.boxes(1, support=lambda o: UniformSupport(o, np.array([0.01, 0.0]))),
    ]


def odd_twists(chain: Chain) -> FloatArray:
    """Return twists about corners, edge midpoints, contact ends and centres of friction, near and far, and tiny
    ones.
    """
    corners = [obj.outline_chain for obj in chain.objects]
    contacts = np.array([end for c in chain.contacts for end in (c.right, c.left)])
    middles = [0.5 * (points + np.roll(points, -1, axis=0)) for points in corners]
    cors = np.concatenate([*corners, *middles, contacts, *(p.mean(axis=0)[None] for p in corners)])
    common = np.mean([p.mean(axis=0) for p in corners], axis=0)[None]
    cors = np.concatenate([cors, common, cors + 1e-9, cors * 1e9])
    slow = [[1.0, 0.0, 0.0], [1.0, 0.0, 1e-300], [1e-200, 0.0, 0.0]]
    return np.concatenate([twists_about(cors, +1), twists_about(cors, -1), slow])


@pytest.mark.parametrize("name", [*STABLE_SETS, *INTERVALS])
def test_odd_chains_and_twists_give_finite_margins(make_chain: ChainMaker, name: str) -> None:
    slow = name.startswith("robust")
    for chain in odd_chains(make_chain)[slow :: 6 if slow else 1]:
        stable = make(chain, name)
        margins = stable.contact_margins(odd_twists(chain))
        assert np.isfinite(margins).all()
        assert (np.abs(margins) <= 1.0 + 1e-9).all()
        # The samples of an outline depend on the order of the rows, so results differ by the sampling error.
        near = 1e-5 if name.startswith("robust") else 1e-9
        np.testing.assert_allclose(stable.margin(odd_twists(chain)), margins.min(axis=1), atol=near)
        if name in STABLE_SETS:
            assert np.isfinite(stable.area())
            assert not np.isnan(stable.turning_radii()).any()
            assert stable.cor_region(+1).is_valid


@pytest.mark.parametrize("name", [*STABLE_SETS, *INTERVALS])
def test_nothing_is_stable_without_friction(make_chain: ChainMaker, name: str) -> None:
    """There is no error either: regions are empty, radii infinite, cones None."""
    slow = name.startswith("robust")
    for chain in (make_chain.boxes(1, floor_friction=0.0), make_chain.boxes(2, contact_friction=0.0))[slow:]:
        stable = make(chain, name)
        assert stable.translation_cone() is None
        assert len(stable.meridians(count=48)) == 0
        if name in STABLE_SETS:
            assert stable.area() == 0.0
            assert stable.cor_region(+1).is_empty
            assert stable.cor_region(-1).is_empty
            assert stable.turning_radii() == (np.inf, np.inf)


AHEAD = np.array([[1.0, 0.0, 0.0]])


def joined(make: ChainMaker, pushed: int, pusher: int) -> Chain:
    chain = make.boxes(2)
    return replace(chain, contacts=(chain.contacts[0], replace(chain.contacts[1], pushed=pushed, pusher=pusher)))


def ranged(make: ChainMaker, **spans: Any) -> IntervalChain:
    return IntervalChain.from_ranges(make.boxes(2), **spans)


WRONG: dict[str, tuple[Callable[[ChainMaker], object], str]] = {
    "no vector": (lambda m: stable_set(m.boxes(1)).margin([1.0, 0.0]), "must be (k, 3)"),
    "not finite": (lambda m: stable_set(m.boxes(1)).margin([[1.0, 0.0, np.nan]]), "not finite"),
    "zero": (lambda m: stable_set(m.boxes(1)).margin([[0.0, 0.0, -1e-300], [0.0, 0.0, 0.0]]), "twist 1 is zero"),
    "sense": (lambda m: stable_set(m.boxes(1)).cor_region(0), "sense is 0"),
    "window": (lambda m: stable_set(m.boxes(1)).cor_region(1, (1.0, 0.0, 1.0, 2.0)), "xmin < xmax"),
    "count": (lambda m: stable_set(m.boxes(1)).meridians(count=0), "count is 0"),
    "rates": (lambda m: dynamic_margins(m.boxes(1), [[1.0, 0.0, 0.0]], np.zeros((2, 3))), "rates have shape"),
    "load": (lambda m: dynamic_rows(m.boxes(1, support=UnknownSupport), [1.0, 0.0, 0.0]), "unknown"),
    "tipping": (lambda m: stable_set(m.boxes(1, support=UnknownSupport, contact_height=0.2), "robust"), "could tip"),
    "cof": (lambda m: stable_set_over(IntervalChain.from_ranges(m.boxes(1)), "cof"), "not linear in the loads"),
    "no feet": (lambda m: FeetSupport(np.zeros((0, 2)), np.zeros(0)), "at least one foot"),
    "no map": (lambda m: PressureMapSupport(np.zeros((0, 2)), np.zeros(0)), "at least one point"),
    "no objects": (lambda m: Chain((), (), m.boxes(2).pusher), "a chain needs at least one object"),
    "no contact": (lambda m: replace(m.boxes(2), contacts=m.boxes(1).contacts), "need as many contacts, not 1"),
    "itself": (lambda m: joined(m, 1, 1), "contact 1 pushes object 1 from 1; it must push object 1 from the plate"),
    "another": (lambda m: joined(m, 0, -1), "contact 1 pushes object 0 from -1; it must push object 1 from the"),
    "slid off": (lambda m: slid(m.boxes(2), [0.0, 0.5]), "has slid off the body that pushes it"),
    "backward": (lambda m: PushPath(np.zeros(3), AHEAD, np.array([-0.1])), "has a negative length"),
    "unscaled": (lambda m: PushPath(np.zeros(3), 2.0 * AHEAD, np.ones(1)), "must have a cost rate of 1 m/s"),
    "whose mass": (lambda m: ranged(m, mass={"bux": (1.0, 2.0)}), "no object is called 'bux'; allowed: box0, box1"),
    "no interval": (lambda m: ranged(m, mass={"box0": (2.0, 1.0)}), "mass of 'box0' is the interval (2, 1);"),
    "no mass": (lambda m: ranged(m, mass={"box0": (0.0, 1.0)}), "mass of 'box0' is the interval (0, 1)"),
    "no friction": (lambda m: ranged(m, contact_friction={"box1": (-0.1, 1.0)}), "contact friction of 'box1' is the"),
    "no end": (lambda m: ranged(m, floor_friction={"box1": (0.0, np.inf)}), "it must be finite"),
    "fractions": (lambda m: ranged(m, fractions={"box0": [(0.0, 1.0)]}), "'box0' does not stand on feet"),
    "intervals": (lambda m: stable_set_over(ranged(m), "ecoff"), "'ecoff' is not available for intervals"),
    "unknown": (
        lambda m: stable_set_over(IntervalChain.from_ranges(m.boxes(1, support=UnknownSupport))),
        "the load under 'box0' is unknown",
    ),
    "leaning": (lambda m: UnknownSupport(m.box()).lean(np.array([1.0, 0.0])), "not known"),
}  # fmt: skip


@pytest.mark.parametrize("what", WRONG)
def test_invalid_questions_are_refused(what: str, make_chain: ChainMaker) -> None:
    ask, said = WRONG[what]
    with pytest.raises(PushplanError, match=re.escape(said)):
        ask(make_chain)


@pytest.mark.parametrize("seed", range(3))
def test_stable_over_intervals_of_friction_is_stable_at_all_their_ends(make_chain: ChainMaker, seed: int) -> None:
    """With three or four objects, the possible centres form a polygon without point symmetry."""
    chain = make_chain.random(seed, 3 + seed % 2, tree=seed == 2)
    ends = {
        obj.name: (0.7 * obj.floor_friction, (1.1 + 0.4 * i) * obj.floor_friction)
        for i, obj in enumerate(chain.objects)
    }
    over = stable_set_over(IntervalChain.from_ranges(chain, floor_friction=ends), "stable")
    twists = np.random.default_rng(seed).normal((1.0, 0.0, 0.0), (0.1, 0.2, 1.0), (300, 3))
    least = np.full((300, len(chain.objects)), np.inf)
    for frictions in product(*ends.values()):
        objects = (replace(obj, floor_friction=mu) for obj, mu in zip(chain.objects, frictions, strict=True))
        least = np.minimum(
            least, stable_set(replace(chain, objects=tuple(objects)), "stable").contact_margins(twists)
        )
    found = over.contact_margins(twists)
    assert (least[found > 0.0] > 0.0).all()
    np.testing.assert_allclose(found, least, atol=8e-3)  # rows of other centres have other sizes
