"""Boundaries of stable sets, COR regions, cones and radii, against the margin alone and against a grid."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from conftest import ChainMaker, there

import pushplan.core.boundary as boundary
from pushplan.mechanics.contacts import cof
from pushplan.mechanics.sphere import angles_of, twists_about, twists_at
from pushplan.planners.controls import control_segments, segment_ends
from pushplan.scenario.builders import box, build_scenario, plate, polygon
from pushplan.sets.cor import cor_polygons
from pushplan.sets.known_load_sets import IntersectionSet
from pushplan.sets.named import stable_set
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray


class ByContacts(StableSet):
    """A user's set: the margins of contacts alone, in Python."""

    name = "by-contacts"

    def __init__(self, same: StableSet) -> None:
        super().__init__(same.chain)
        self._same = same

    def contact_margin_values(self, twists: FloatArray) -> FloatArray:
        """Return the margin (k, n) of each contact."""
        return self._same.contact_margin_values(twists)


@pytest.mark.parametrize("minimum", [0.0, 0.03])
@pytest.mark.parametrize(("seed", "n", "tree", "feet"), [
    (0, 1, False, False), (1, 2, False, True), (2, 3, True, False), (3, 4, True, True), (4, 6, False, False),
])  # fmt: skip
def test_compiled_margins_and_those_of_contacts_give_the_same_set(
    make_chain: ChainMaker, seed: int, n: int, tree: bool, feet: bool, minimum: float
) -> None:
    stable = stable_set(make_chain.random(seed, n, tree=tree, feet=feet))
    length, general = stable.chain.characteristic_length, ByContacts(stable)
    found, expected = stable.refined_meridians(minimum), general.refined_meridians(minimum)
    for sense in (+1, -1):
        one, other = (cor_polygons(each, length, sense, None) for each in (found, expected))
        assert one.symmetric_difference(other).area < 1e-5 * max(other.area, length**2)
    mine, theirs = stable.meridians(minimum), general.meridians(minimum)
    np.testing.assert_array_equal(mine.longitude, theirs.longitude)
    np.testing.assert_allclose(mine.lower, theirs.lower, rtol=0.0, atol=2e-12)
    np.testing.assert_allclose(mine.upper, theirs.upper, rtol=0.0, atol=2e-12)


@pytest.mark.parametrize("seed", range(40))
def test_only_intervals_in_order_with_excess_inside_and_none_outside_are_followed(seed: int) -> None:
    """Five latitudes an interval, one between two; some are out of order, or have the other sign."""
    rng, wanted = np.random.default_rng(seed), list[tuple[int, list[list[float]]]]()
    x, value, members = list[float](), list[float](), list[int]()
    for member in range(6):
        count = int(rng.integers(1, 4))
        at = np.sort(rng.uniform(-1.4, 1.4, 6 * count - 1))
        inside = np.resize([-1.0, 1.0, 1.0, 1.0, -1.0, -1.0], 6 * count - 1)
        outer, good = np.resize([True, False, False, False, True, False], len(at)), True
        if rng.random() < 0.3:  # an interval may end at the pole
            at[-2:] = 0.5 * np.pi, 0.5 * np.pi
            inside[-1] = 1.0
        match int(rng.integers(4)):
            case 0:
                k = int(rng.integers(len(at) if outer[-1] and inside[-1] < 0.0 else len(at) - 1))
                inside[k], good = -inside[k], False
            case 1:
                k = 5 * int(rng.integers(count))
                k += k // 5
                at[k + 2], good = at[k] - 0.1, False
            case 2 if count > 1:
                at[6] = at[4] - 1e-3  # begins in the interval before
                good = False
        x, value, members = (
            [*x, *at],
            [*value, *(inside * rng.uniform(0.1, 1.0, len(at)))],
            [*members, *[member] * len(at)],
        )
        if good:
            for k in range(0, len(at), 6):
                ends = [
                    [at[k + i], at[k + o], value[len(value) - len(at) + k + i], value[len(value) - len(at) + k + o]]
                    for i, o in ((1, 0), (3, 4))
                ]
                wanted.append((member, ends))
    found, brackets = boundary.followed(np.array(x), np.array(value), np.array(members))
    assert found.tolist() == [member for member, _ in wanted]
    np.testing.assert_array_equal(brackets, np.array([ends for _, ends in wanted]).reshape(-1, 2, 4))


def test_a_narrow_cone_of_translations_is_found(make_chain: ChainMaker) -> None:
    """A cone of translations of 0.01 rad in which all contacts hold; the meridians end at its boundary."""
    chain = make_chain.boxes(2, contact_friction=0.005)
    chain = replace(chain, contacts=(chain.contacts[0], replace(chain.contacts[1], friction=0.005)))
    refined, cone = stable_set(chain, "translation").refined_meridians(), there(stable_set(chain).translation_cone())
    ends = refined.meridians.longitude[[0, -1]]
    np.testing.assert_allclose(ends, np.arctan2(cone[:, 1], cone[:, 0]), atol=1e-11)
    assert len(stable_set(chain, "translation").meridians(count=2048)) == 3


@pytest.mark.parametrize("minimum", [0.0, 0.05])
@pytest.mark.parametrize("seed", range(4))
def test_meridian_ends_enclose_the_boundary(make_chain: ChainMaker, seed: int, minimum: float) -> None:
    """Stable at every returned end, unstable 2e-12 rad beyond, and in agreement with dense samples between."""
    stable = stable_set(make_chain.random(seed, 2, feet=seed % 2 == 1))
    length = stable.chain.characteristic_length
    rows = stable.meridians(minimum, count=128)
    assert len(rows) > 0
    for end, outward in ((rows.lower, -2e-12), (rows.upper, 2e-12)):
        assert (stable.margin(twists_at(rows.longitude, end, length)) > minimum).all()
        assert (stable.margin(twists_at(rows.longitude, end + outward, length)) <= minimum).all()
    lat = np.linspace(-1.57, 1.57, 2001)
    for longitude in -np.pi + 2.0 * np.pi * np.arange(0, 128, 4) / 128:
        mine = rows.longitude == longitude
        inside = ((lat[:, None] >= rows.lower[mine]) & (lat[:, None] <= rows.upper[mine])).any(axis=1)
        np.testing.assert_array_equal(inside, stable.margin(twists_at(longitude, lat, length)) > minimum)


def test_several_intervals_on_one_meridian_are_all_found(make_chain: ChainMaker) -> None:
    """A synthetic set of two bands, one only 0.002 rad wide, with a generic margin."""

    class Bands(StableSet):
        name = "bands"

        def contact_margin_values(self, twists: FloatArray) -> FloatArray:
            lon, lat = angles_of(twists, self.chain.characteristic_length)
            wide = 0.1 - np.abs(lat - 0.6)
            narrow = 0.001 - np.abs(lat + 0.5 + 0.3 * np.sin(lon))
            return np.asarray(np.maximum(wide, narrow)[:, None], dtype=np.float64)

    stable = Bands(make_chain.boxes(1))
    rows = stable.meridians(count=64)
    assert len(rows) == 128
    np.testing.assert_allclose(rows.upper - rows.lower, np.tile([0.002, 0.2], 64), atol=1e-11)
    want = 2.0 * np.pi * (np.sin(0.7) - np.sin(0.5))
    lon = np.linspace(-np.pi, np.pi, 4001)
    want += float(np.trapezoid(2.0 * np.sin(0.001) * np.cos(-0.5 - 0.3 * np.sin(lon)), lon))
    assert stable.area() == pytest.approx(want, abs=1e-5)


def test_a_pole_inside_the_set_belongs_to_meridians_and_region(make_chain: ChainMaker) -> None:
    """A synthetic set of all left turns about points within 0.05 m of the origin."""

    class Cap(StableSet):
        name = "cap"

        def contact_margin_values(self, twists: FloatArray) -> FloatArray:
            _, lat = angles_of(twists, 0.05)
            return np.asarray((lat - np.pi / 4)[:, None], dtype=np.float64)

    stable = Cap(make_chain.boxes(1))
    assert (stable.meridians(count=16).upper == np.pi / 2).all()
    region = stable.cor_region(+1, (-1.0, -1.0, 1.0, 1.0))
    assert region.area == pytest.approx(np.pi * 0.05**2, rel=1e-4)
    assert stable.cor_region(-1).is_empty
    assert stable.turning_radii() == (0.0, np.inf)
    assert stable.translation_cone() is None


@pytest.mark.parametrize("name", ["ecof", "ecof in a tree", "cof", "stable", "robust", "both"])
@pytest.mark.parametrize("seed", range(3))
def test_cor_region_holds_exactly_the_stable_cors(make_chain: ChainMaker, name: str, seed: int) -> None:
    """Random CORs, in a window that cuts the regions, are in the region exactly if their twists are stable."""
    count = 2_000 if name == "robust" else 20_000
    chain = make_chain.random(seed, 1 + seed % 4, tree="tree" in name, feet=seed % 3 == 2)
    stable = stable_set(chain, "ecof" if name == "both" else name.split()[0])
    if name == "both":
        stable = IntersectionSet(stable, stable_set(chain, "stable"))
    size = 5.0 * stable.chain.characteristic_length
    window = (-size, -0.8 * size, size, size)
    rng = np.random.default_rng(seed)
    cors = rng.uniform(window[:2], window[2:], (count, 2)) * rng.choice([0.1, 0.3, 1.0], (count, 1))
    found = 0
    for sense in (-1, 1):
        region = stable.cor_region(sense, window)
        held = shapely.contains_xy(region, cors[:, 0], cors[:, 1])
        wrong = held != stable.contains(twists_about(cors, sense))
        if wrong.any():
            assert shapely.distance(region.boundary, shapely.points(cors[wrong])).max() < 1e-5 * size
        found += int(held.sum())
    assert found > (100 if name.startswith("ecof") else 0)


@pytest.mark.parametrize("seed", range(6))
def test_translation_cone_agrees_with_the_paper(make_chain: ChainMaker, seed: int) -> None:
    """Algorithm 3: for each contact the friction cone and the directions from its ends through the COF,
    intersected.
    """
    chain = make_chain.random(seed, 3)
    cone = stable_set(chain).translation_cone()
    low, high = -np.pi, np.pi
    for k, contact in enumerate(chain.contacts):
        loads = [obj.friction_load for obj in chain.objects[k:]]
        center = np.average([cof(obj) for obj in chain.objects[k:]], axis=0, weights=loads)
        normal = np.arctan2(contact.normal[1], contact.normal[0])
        from_left, from_right = center - contact.left, center - contact.right
        low = max(low, normal - np.arctan(contact.friction), np.arctan2(from_left[1], from_left[0]))
        high = min(high, normal + np.arctan(contact.friction), np.arctan2(from_right[1], from_right[0]))
    assert (cone is not None) == (low < high)
    if cone is not None:
        np.testing.assert_allclose(np.arctan2(cone[:, 1], cone[:, 0]), [low, high], atol=1e-11)
        assert stable_set(chain).contains(np.column_stack([cone, [0.0, 0.0]])).all()


@pytest.mark.parametrize("share", [0.5, 0.99])
def test_planning_works_in_a_set_smaller_than_the_sample_spacing(share: float) -> None:
    """A heavy object far ahead of the plate allows only turns to one side, within a degree or two."""
    wedge = [[0.0, -0.034], [0.038, -0.022], [0.038, 0.012], [0.0, 0.034]]
    objects = [
        box("a", 0.246, 0.34, mass=0.09),
        box("b", 0.178, 0.356, mass=0.3, offset=-0.053),
        polygon("c", wedge, mass=20.2, offset=-0.004),
        box("d", 0.075, 0.308, mass=4.77, offset=0.05),
    ]
    scenario = build_scenario(
        "island",
        objects,
        plate(0.269, friction=0.33),
        goal=(1.0, 0.0, 0.0),
        floor_friction=0.241,
        contact_friction=0.35,
    )
    chain = scenario.chain
    stable = stable_set(chain)
    margin = share * float(stable.peaks[1].max())
    segments = control_segments(stable, chain.pusher.drive, margin)
    assert len(segments) > 0
    assert (stable.margin(segment_ends(segments)) > margin).all()
