"""Supports of objects on the floor: support models, possible loads, and feet that represent a pressure."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import ChainMaker

from pushplan.cli.check import support_text
from pushplan.errors import SupportError
from pushplan.geometry.polygon import convex_hull
from pushplan.geometry.se2 import rotate
from pushplan.mechanics.chain import PushedObject
from pushplan.mechanics.contacts import friction_wrench
from pushplan.mechanics.perturb import with_leaning_load
from pushplan.mechanics.sphere import twists_about
from pushplan.mechanics.support import (
    FeetSupport,
    PointLoads,
    PressureMapSupport,
    Support,
    UniformSupport,
    UnknownSupport,
)
from pushplan.scenario.file import load_scenario
from pushplan.sim.identify.unknowns import Unknowns
from pushplan.slip.feet import DEGREE, feet_of, polygon_rule
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray

BOX = np.array([[-0.05, -0.03], [0.05, -0.03], [0.05, 0.03], [-0.05, 0.03]])


@pytest.mark.parametrize(("fractions", "center", "text"), [
    ([0.5, 0.5, 0.5, -0.5], None, "-0.5 of point 3 must be > 0"),
    ([0.5, 0.25, 0.0, 0.25], None, "load fraction 0 of point 2 must be > 0"),
    ([0.5, 0.5], None, "shape"), (None, None, "either"), ([0.25] * 4, [0.0, 0.0], "either"),
])  # fmt: skip
def test_wrong_feet_are_refused(fractions: FloatArray | None, center: FloatArray | None, text: str) -> None:
    with pytest.raises(Exception, match=text) as caught:
        FeetSupport(BOX, fractions, center)
    assert type(caught.value).__module__ == "pushplan.errors"


def test_pressure_map_from_csv() -> None:
    """Columns in any order, rows without pressure dropped, pressures scaled to a sum of 1."""
    table = b"pressure, x, y\n300, 0, 0\n100, 0.1, 0\n\n0, 0.5, 0.5\n"
    support = PressureMapSupport.from_bytes(table, "map.csv")
    np.testing.assert_allclose(support.fractions, [0.75, 0.25])
    np.testing.assert_allclose(support.center, [0.025, 0.0])


@pytest.mark.parametrize(("text", "finding"), [
    ("x,y\n1,2\n", "map.csv:1: the header is 'x,y'; it must name x, y and pressure"),
    ("", "map.csv:1: the header is ''"),
    ("x,y,pressure\n0,0,1\n1,2\n", "map.csv:3: 2 cells; there must be 3"),
    ("x,y,pressure\n0,0,one\n", "map.csv:2: could not convert"),
    ("x,y,pressure\n0,0,-1\n", "map.csv:2: x, y and pressure must be finite and pressure >= 0"),
    ("x,y,pressure\n0,nan,1\n", "map.csv:2: x, y and pressure must be finite"),
    ("x,y,pressure\n0,0,0\n", "map.csv: no row has a pressure > 0"),
])  # fmt: skip
def test_wrong_pressure_maps_name_file_and_line(text: str, finding: str) -> None:
    with pytest.raises(SupportError) as caught:
        PressureMapSupport.from_bytes(text.encode(), "map.csv")
    assert finding in str(caught.value)


def outlines(make_chain: ChainMaker) -> list[FloatArray]:
    """Return a box and stars with up to nine corners, non-convex."""
    return [BOX, *(make_chain.star(np.random.default_rng(seed), 3 + seed) for seed in range(7))]


def test_the_quadrature_on_a_polygon_has_its_area_centroid_and_second_moments(make_chain: ChainMaker) -> None:
    for outline in outlines(make_chain):
        moments = UniformSupport(outline).moments
        rule = polygon_rule(outline, 2)
        assert rule.weights.sum() == pytest.approx(moments.area, rel=1e-12)
        np.testing.assert_allclose(rule.weights @ rule.points / moments.area, moments.centroid, atol=1e-15)
        offsets = rule.points - moments.centroid
        np.testing.assert_allclose(
            (offsets * rule.weights[:, None]).T @ offsets, moments.second, rtol=1e-10, atol=1e-18
        )


def test_feet_have_the_moments_of_the_pressure_up_to_their_degree() -> None:
    """Against a much finer quadrature, monomial by monomial."""
    fine = polygon_rule(BOX, 12)
    feet = feet_of(UniformSupport(BOX))
    for i in range(DEGREE + 1):
        for j in range(DEGREE + 1 - i):
            want = fine.weights @ np.prod(fine.points ** [i, j], axis=1) / fine.weights.sum()
            have = feet.fractions @ np.prod(feet.positions ** [i, j], axis=1)
            assert have == pytest.approx(want, abs=1e-12 * 0.05 ** (i + j))


@pytest.mark.parametrize("center", [None, np.array([0.008, -0.004])])
def test_friction_on_the_feet_equals_that_of_the_pressure(center: FloatArray | None) -> None:
    """The wrench at centres of rotation around the footprint, twice as far out as its corners."""
    support = UniformSupport(BOX, center)
    feet = feet_of(support)
    angle = np.linspace(-np.pi, np.pi, 40)
    twists = twists_about(0.12 * np.stack([np.cos(angle), np.sin(angle)], axis=1), +1)
    wrenches = [
        friction_wrench(PushedObject("box", BOX, 1.0, 0.3, each, np.zeros(3)), twists)
        for each in (support, FeetSupport(feet.positions, feet.fractions))
    ]
    np.testing.assert_allclose(wrenches[1], wrenches[0], atol=3e-6)


class Rails(Support):
    """A user's support model: 12 points on each of two rails; the last carries three times as much as the first."""

    points = np.array([[x, y] for y in (-0.02, 0.03) for x in np.linspace(-0.04, 0.04, 12)])
    parts = np.linspace(1.0, 3.0, 24) / 48.0

    @property
    def center(self) -> FloatArray:
        return np.asarray(self.parts @ self.points)

    @property
    def hull(self) -> FloatArray:
        return convex_hull(self.points)

    @property
    def point_loads(self) -> PointLoads:
        return PointLoads(self.points, self.parts.copy(), self.parts.copy())


def test_a_user_s_support_model_is_shown_simulated_and_identified() -> None:
    rails, unknown = Rails(), UnknownSupport(4.0 * BOX, np.array([0.01, 0.0]))
    feet = feet_of(rails)
    np.testing.assert_array_equal(feet.positions, rails.points)
    np.testing.assert_array_equal(feet.fractions, rails.parts)
    scenario = load_scenario("one-box")
    box = scenario.chain.objects[0]
    assert support_text(replace(box, support=rails)).startswith("known loads on 24 points (Rails), centre at (")
    assert support_text(replace(box, support=unknown)).startswith("load unknown, centre at (0.01, 0)")
    for support in (rails, unknown):
        chain = replace(scenario.chain, objects=(replace(box, support=support),))
        unknowns = Unknowns.from_world(World.from_chain(chain, scenario.start))
        middle = unknowns.values(np.array([0.0 if one.kind == "border" else 0.5 for one in unknowns.each]))
        center = unknowns.fractions(middle)[0] @ unknowns.loads[0].points
        np.testing.assert_allclose(center, support.center, atol=1e-5)  # before any measurement


@pytest.mark.parametrize("seed", range(4))
def test_a_load_shifts_until_a_part_is_zero_in_the_requested_direction(make_chain: ChainMaker, seed: int) -> None:
    """The centre moves along the direction in the chain frame for every heading of the object."""
    rng = np.random.default_rng(seed)
    outline, e = make_chain.star(rng, 5), rotate(rng.uniform(-3.0, 3.0), [1.0, 0.0])
    for support in (UniformSupport(outline), FeetSupport(outline, rng.dirichlet(np.ones(5)))):
        most = support.most_lean(e)
        assert support.leaning(e, 0.999 * most).known
        with pytest.raises(SupportError):
            support.leaning(e, 1.001 * most)
    chain = make_chain.boxes(2)
    turned = tuple(replace(obj, pose_chain=np.add(obj.pose_chain, [0.0, 0.01, 0.7])) for obj in chain.objects)
    leaning = with_leaning_load(replace(chain, objects=turned), e, 0.4)
    for obj, before in zip(leaning.objects, turned, strict=True):
        moved = rotate(before.pose_chain[2], obj.support.center - before.support.center)
        np.testing.assert_allclose(moved / np.linalg.norm(moved), e, atol=1e-6)
