"""Floor friction and contact forces: closed forms against quadrature of Coulomb's law, and laws."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import shapely
from conftest import ChainMaker
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad_vec

import pushplan.core.contacts as contacts
from pushplan.errors import SupportError
from pushplan.geometry.se2 import transform_points
from pushplan.mechanics.chain import GRAVITY, PushedObject
from pushplan.mechanics.contacts import center_range, ecof, friction_wrench
from pushplan.mechanics.packed import pack_object
from pushplan.mechanics.sphere import twists_about
from pushplan.mechanics.support import FeetSupport, PressureMapSupport, UniformSupport
from pushplan.util.arrays import FloatArray

NODES, WEIGHTS = np.polynomial.legendre.leggauss(12)


def coulomb(obj: PushedObject, twist: FloatArray, pressure: tuple[float, FloatArray, FloatArray]) -> FloatArray:
    """Integrate -mu p v / |v| numerically over the object's outline, as signed triangles with their tip at the COR.

    `pressure` is (a, b, x0) of p(x) = a + b . (x - x0) for a unit weight, in the chain frame.
    """
    a, b, x0 = pressure
    corners = obj.outline_chain
    v, omega = twist[:2], twist[2]
    tip = np.array([-v[1], v[0]]) / omega if abs(omega) > 0.1 * np.hypot(*v) else corners.mean(axis=0)
    total = np.zeros(3)
    for p, q in zip(corners - tip, np.roll(corners, -1, axis=0) - tip, strict=True):
        jacobian = p[0] * q[1] - p[1] * q[0]

        def across(t: float, p: FloatArray = p, q: FloatArray = q) -> FloatArray:
            u = 0.5 * (NODES + 1.0)
            r = u[:, None] * ((1.0 - t) * p + t * q)
            x = tip + r
            velocity = v + omega * np.stack([-x[:, 1], x[:, 0]], axis=1)
            force = -velocity / np.linalg.norm(velocity, axis=1, keepdims=True)
            force *= (a + (x - x0) @ b)[:, None]
            wrench = np.column_stack([force, x[:, 0] * force[:, 1] - x[:, 1] * force[:, 0]])
            return np.asarray((0.5 * WEIGHTS * u) @ wrench, dtype=np.float64)

        nearest = np.clip(-(p @ (q - p)) / ((q - p) @ (q - p)), 0.0, 1.0)
        integral, _ = quad_vec(across, 0.0, 1.0, epsabs=1e-13, epsrel=1e-11, points=[float(nearest)])
        total += jacobian * integral
    return obj.friction_load * total


def uniform_pressure(obj: PushedObject) -> tuple[float, FloatArray, FloatArray]:
    assert isinstance(obj.support, UniformSupport)
    moments = obj.support.moments
    c, s = np.cos(obj.pose_chain[2]), np.sin(obj.pose_chain[2])
    gradient = np.array([[c, -s], [s, c]]) @ obj.support.gradient
    return 1.0 / moments.area, gradient, transform_points(obj.pose_chain, moments.centroid)


def random_object(make_chain: ChainMaker, rng: np.random.Generator, center: bool) -> PushedObject:
    outline = make_chain.star(rng, int(rng.integers(3, 10)), 0.1)
    support = UniformSupport(outline)
    if center:
        reach = 0.15 * np.sqrt(np.linalg.eigvalsh(support.moments.second)[0] / support.moments.area)
        support = UniformSupport(outline, support.moments.centroid + rng.uniform(-reach, reach, 2))
    pose = rng.uniform([-0.3, -0.3, -np.pi], [0.3, 0.3, np.pi])
    return PushedObject("it", outline, 1.3, 0.4, support, pose)


def assert_close(obj: PushedObject, got: FloatArray, want: FloatArray, tolerance: float) -> None:
    """Compare wrenches relative to the friction load and the object's lever."""
    lever = float(np.linalg.norm(obj.outline_chain, axis=1).max())
    scale = obj.friction_load * np.array([1.0, 1.0, lever])
    np.testing.assert_array_less(np.abs(got - want) / scale, tolerance)


@pytest.mark.parametrize("affine", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_closed_form_agrees_with_quadrature(make_chain: ChainMaker, seed: int, affine: bool) -> None:
    """Random polygons, most of them not convex; CORs inside, near, far, on a vertex, an edge and its line."""
    rng = np.random.default_rng(seed)
    obj = random_object(make_chain, rng, affine)
    corners, (p, q) = obj.outline_chain, obj.outline_chain[:2]
    near_edge = 0.3 * p + 0.7 * q + rng.normal(size=2) * 1e-6
    cors = [
        corners.mean(axis=0),
        near_edge,
        p,
        0.5 * (p + q),
        p + 1.7 * (q - p),
        *rng.normal(size=(3, 2)) * 0.3,
        rng.normal(size=2) * 30.0,
    ]
    for cor in cors:
        twist = twists_about(cor, int(rng.choice([-1, 1])))
        want = coulomb(obj, twist, uniform_pressure(obj))
        assert_close(obj, friction_wrench(obj, [twist])[0], want, 1e-9)


@pytest.mark.parametrize("affine", [False, True])
def test_series_and_closed_form_agree_where_they_meet(make_chain: ChainMaker, affine: bool) -> None:
    """Beyond the switch the series is used, before it the closed form; the wrench must be continuous."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        packed = pack_object(random_object(make_chain, rng, affine))
        anchor, radius = packed.objects[0, 1:3], packed.objects[0, 3]
        heading = rng.uniform(-np.pi, np.pi)
        ray = np.array([np.cos(heading), np.sin(heading)]) * radius / contacts.REACH
        twists = [twists_about(anchor + ray * (1.0 + e), +1) for e in (-1e-12, 1e-12)]
        sides = contacts.object_wrenches_of(packed, np.array(twists))
        scale = packed.objects[0, 0] * np.array([1.0, 1.0, radius + np.linalg.norm(anchor)])
        np.testing.assert_array_less(np.abs(np.subtract(sides[0], sides[1])) / scale, 5e-12)


@pytest.mark.parametrize("kind", ["polygon", "affine", "feet"])
def test_wrench_is_the_gradient_of_the_dissipation(make_chain: ChainMaker, kind: str) -> None:
    """Maximal dissipation: the power P(V) = w . V is convex and homogeneous, and its gradient is w."""
    rng = np.random.default_rng(4)
    obj = random_object(make_chain, rng, kind == "affine")
    if kind == "feet":
        obj = replace(obj, support=FeetSupport(obj.outline, rng.dirichlet(np.ones(len(obj.outline)))))
    for _ in range(20):
        twist = rng.normal(size=3) * [1.0, 1.0, 5.0]
        steps = np.concatenate([np.eye(3), -np.eye(3)]) * 1e-5
        power = -(friction_wrench(obj, twist + steps) * (twist + steps)).sum(axis=1)
        gradient = (power[:3] - power[3:]) / 2e-5
        np.testing.assert_allclose(-friction_wrench(obj, [twist])[0], gradient, atol=1e-7)


@pytest.mark.parametrize("kind", ["polygon", "affine", "feet", "map"])
def test_push_height_moves_the_load_by_minus_h_f_over_n(make_chain: ChainMaker, kind: str) -> None:
    """The wrench with a push height is the wrench of the pressure whose centre has moved by -h f / N."""
    rng = np.random.default_rng(6)
    outline = make_chain.box(0.1, 0.08)
    loads = np.array([0.2, 0.3, 0.27, 0.23])
    supports = {
        "polygon": UniformSupport(outline),
        "affine": UniformSupport(outline, np.array([0.002, -0.003])),
        "feet": FeetSupport(outline * 0.9, loads),
        "map": PressureMapSupport(outline * 0.9, loads),
    }
    support = supports[kind]
    obj = PushedObject("it", outline, 1.0, 0.35, support, np.array([0.1, 0.05, 0.4]))
    height, weight = 0.015, obj.mass * GRAVITY
    for twist in rng.normal(size=(20, 3)) * [1.0, 1.0, 12.0]:
        wrench = friction_wrench(obj, [twist], height)[0]
        moved = transform_points([0, 0, -0.4], -height * wrench[:2] / weight)
        shifted = replace(obj, support=_with_center(support, support.center + moved))
        assert_close(obj, wrench, friction_wrench(shifted, [twist])[0], 1e-12)


def _with_center(support: object, center: FloatArray) -> UniformSupport | FeetSupport | PressureMapSupport:
    """Return the support with its load's centre shifted: affine on polygons, springs otherwise."""
    if isinstance(support, UniformSupport):
        return UniformSupport(support.outline, center)
    if isinstance(support, FeetSupport):
        assert support.fractions is not None
        return FeetSupport(support.positions, _affine(support.positions, support.fractions, None, center))
    assert isinstance(support, PressureMapSupport)
    return PressureMapSupport(support.points, _affine(support.points, support.fractions, support.fractions, center))


def _affine(points: FloatArray, loads: FloatArray, springs: FloatArray | None, center: FloatArray) -> FloatArray:
    weight = np.full(len(points), 1.0 / len(points)) if springs is None else springs
    rows = np.column_stack([np.ones(len(points)), points])
    change = np.linalg.solve(rows.T @ (rows * weight[:, None]), [0.0, *(center - loads @ points)])
    return np.asarray(loads + weight * (rows @ change), dtype=np.float64)


def test_push_height_that_lifts_a_corner_is_refused(make_chain: ChainMaker) -> None:
    """Middle third: a uniform box of length l and width w stays flat up to a shift of l w / (6 hypot(l, w))."""
    outline = make_chain.box(0.1, 0.1)
    obj = PushedObject("tall", outline, 1.0, 0.5, UniformSupport(outline), np.zeros(3))
    highest = 0.1 / 6.0 / np.sqrt(2.0) / 0.5
    friction_wrench(obj, [[1.0, 0.0, 0.0]], 0.999 * highest)
    with pytest.raises(SupportError, match=r"a push at height 0.03 m could lift a part of 'tall'.*at most 0.0235702"):
        friction_wrench(obj, [[1.0, 0.0, 0.0]], 0.03)
    two = replace(obj, support=FeetSupport(np.array([[0.0, -0.05], [0.0, 0.05]]), np.array([0.5, 0.5])))
    with pytest.raises(SupportError, match="are on a line"):
        friction_wrench(two, [[1.0, 0.0, 0.0]], 0.001)


@pytest.mark.parametrize("cor", [[0.3, -0.2], [0.06, 0.01], [0.0, 4.0]])
def test_force_at_the_ecof_reproduces_the_wrench(make_chain: ChainMaker, cor: list[float]) -> None:
    """The friction force acts at the ECOF against its velocity, and the ECOF is the foot of the line of action."""
    obj = make_chain.random(7, 1).objects[0]
    twist = twists_about(cor, -1)
    fx, fy, moment = friction_wrench(obj, [twist])[0]
    x, y = ecof(obj, cor, -1)
    assert moment == pytest.approx(x * fy - y * fx, rel=1e-12)
    velocity = twist[:2] + twist[2] * np.array([-y, x])
    assert velocity @ [fx, fy] == pytest.approx(-np.hypot(*velocity) * np.hypot(fx, fy), rel=1e-12)
    assert ([x, y] - np.array(cor)) @ [fx, fy] == pytest.approx(0.0, abs=1e-12)


@settings(max_examples=20)
@given(seed=st.integers(0, 10**6), size=st.floats(-200.0, 200.0))
def test_only_the_direction_of_a_twist_matters(seed: int, size: float) -> None:
    """Also for sizes near the ends of the floating-point range."""
    rng = np.random.default_rng(seed)
    outline = np.array([[0.0, 0.0], [0.1, 0.0], [0.02, 0.02], [0.0, 0.1]])
    obj = PushedObject("it", outline, 1.0, 0.3, UniformSupport(outline), rng.normal(size=3))
    twist = rng.normal(size=3)
    scaled = friction_wrench(obj, [twist * 10.0**size])[0]
    np.testing.assert_allclose(scaled, friction_wrench(obj, [twist])[0], rtol=1e-9, atol=1e-12)
    assert np.isfinite(scaled).all()


@pytest.mark.parametrize("seed", range(8))
def test_the_range_of_centres_is_the_hull_of_extreme_loads(seed: int) -> None:
    """A centre is a ratio of linear functions of the loads, so the extremes are among their corners."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 7))
    centers = rng.normal(size=(n, 2))
    loads = np.sort(rng.uniform(0.0, 2.0, (n, 2)) * (rng.random((n, 2)) < 0.8), axis=1)
    loads[0] = [0.5, 1.5]
    extreme = [np.array(some) for some in product(*loads) if sum(some) > 0.0]
    everything = shapely.MultiPoint([some @ centers / some.sum() for some in extreme]).convex_hull
    corners = center_range(loads, centers)
    assert shapely.MultiPoint(corners).convex_hull.hausdorff_distance(everything) < 1e-9
    again = shapely.get_coordinates(everything)
    assert all(np.abs(again - corner).max(axis=1).min() < 1e-9 for corner in corners)
