"""Contact conditions with inertia, against Newton's law by differences, linear programs and samples of intervals."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from conftest import ChainMaker, Patch, pressure_of, there
from test_contacts import slack

from pushplan.geometry import se2
from pushplan.mechanics import uncertain
from pushplan.mechanics.chain import GRAVITY, Chain, PushedObject, inertia_of
from pushplan.mechanics.contacts import carried_objects
from pushplan.mechanics.dynamics import ContactDynamics, dynamic_margins, dynamic_rows
from pushplan.mechanics.intervals import IntervalChain
from pushplan.mechanics.support import FeetSupport, UnknownSupport
from pushplan.util.arrays import FloatArray

STEP = 1e-3


def _motion(twist: FloatArray, speed: float, acceleration: float) -> FloatArray:
    """Return poses (3, 3) of the chain frame at -STEP, 0 and STEP of a motion along `twist`, at a random place."""
    t = np.array([-STEP, 0.0, STEP])
    s = speed * t + 0.5 * acceleration * t**2
    return se2.compose(np.array([0.4, -1.0, 2.2]), se2.exp(s[:, None] * twist))


def _world(poses: FloatArray, point: FloatArray) -> FloatArray:
    return np.array([se2.transform_points(pose, point) for pose in poses])


def _floor_wrench(obj: PushedObject, poses: FloatArray) -> FloatArray:
    """Return the Coulomb friction on the feet of an object, about the world's origin."""
    assert isinstance(obj.support, FeetSupport)
    total = np.zeros(3)
    for foot, share in zip(obj.support.positions, there(obj.support.fractions), strict=True):
        path = _world(poses, se2.transform_points(obj.pose_chain, foot))
        velocity = path[2] - path[0]
        force = -obj.floor_friction * share * obj.mass * GRAVITY * velocity / np.linalg.norm(velocity)
        total += [*force, path[1, 0] * force[1] - path[1, 1] * force[0]]
    return total


def _momentum_rate(obj: PushedObject, poses: FloatArray) -> FloatArray:
    """Return the rate of change of an object's linear and angular momentum about the world's origin."""
    inertia = inertia_of(obj)
    path = _world(poses, inertia.center)
    force = inertia.mass * (path[2] - 2.0 * path[1] + path[0]) / STEP**2
    spin = inertia.moment * (poses[2, 2] - 2.0 * poses[1, 2] + poses[0, 2]) / STEP**2
    return np.array([*force, spin + path[1, 0] * force[1] - path[1, 1] * force[0]])


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("tree", [False, True])
def test_rows_agree_with_newton_by_differences_and_a_linear_program_over_forces(
    make_chain: ChainMaker, seed: int, tree: bool
) -> None:
    rng = np.random.default_rng(seed)
    chain = make_chain.random(seed, 1 + seed % 4, tree=tree, feet=True)
    kept = 0
    for _ in range(25):
        twist = rng.normal(size=3) * [1.0, 0.4, 2.0] + [0.5, 0.0, 0.0]
        rows = dynamic_rows(chain, twist)
        speed, acceleration = rng.uniform(0.01, 2.0), rng.normal() * 4.0
        lowest = float(rows.values(speed, acceleration).min())
        poses = _motion(twist, speed, acceleration)
        needed = [_momentum_rate(obj, poses) - _floor_wrench(obj, poses) for obj in chain.objects]
        if abs(lowest) > 1e-3:
            assert (lowest > 0.0) == (slack(chain, needed, poses[1]) > 0.0)
            kept += 1
    assert kept > 20


@pytest.mark.parametrize("tree", [False, True])
def test_each_contact_accelerates_its_carried_masses_by_newton_s_law(make_chain: ChainMaker, tree: bool) -> None:
    rng, chain = np.random.default_rng(tree), make_chain.random(5, 4, tree=tree)
    twist, speed, acceleration = rng.normal(size=3) * [1.0, 1.0, 4.0], 1.3, -0.7
    found = ContactDynamics(chain).mass_wrenches((speed * twist)[None], (acceleration * twist)[None])[0]
    poses = _motion(twist, speed, acceleration)
    x, y, theta = poses[1]
    for wrench, carried in zip(found, carried_objects(chain), strict=True):
        fx, fy, moment = np.sum([_momentum_rate(chain.objects[i], poses) for i in np.flatnonzero(carried)], axis=0)
        np.testing.assert_allclose(wrench[:2], se2.rotate(-theta, [fx, fy]), atol=1e-3)
        assert wrench[2] == pytest.approx(moment - (x * fy - y * fx), abs=1e-3)


def test_the_worst_case_is_below_every_pressure_with_the_same_centre_and_near_the_worst(
    make_chain: ChainMaker,
) -> None:
    rng = np.random.default_rng(8)
    twists = rng.normal(size=(40, 3)) * [0.3, 0.3, 3.0] + [1.0, 0.0, 0.0]
    worst = ContactDynamics(make_chain.boxes(2, support=UnknownSupport), worst_case=True)
    bound = worst.quasi_static(twists).rows
    least = np.full_like(bound, np.inf)
    for _ in range(60):
        chain = make_chain.boxes(2, support=lambda outline: pressure_of(rng, outline, np.zeros(2)))
        found = ContactDynamics(chain).quasi_static(twists).rows
        assert (found >= bound - 1e-9).all()
        least = np.minimum(least, found)
    assert np.median(least - bound) < 0.1 * np.median(np.abs(bound))


def motions(chain: Chain, seed: int, count: int = 60) -> tuple[FloatArray, FloatArray]:
    """Return twists (k, 3), m/s and rad/s, and their rates (k, 3)."""
    rng, length = np.random.default_rng(seed), chain.characteristic_length
    twists = 0.2 * (rng.normal(size=(count, 3)) * [0.2, 0.1, 0.2 / length] + [1.0, 0.0, 0.0])
    return twists, 0.3 * rng.normal(size=(count, 3)) * [1.0, 0.5, 0.5 / length]


def widened(chain: Chain) -> IntervalChain:
    """Return the chain with intervals of all masses, the first floor friction and the last contact friction."""
    first, last = chain.objects[0], chain.contacts[-1].friction
    return IntervalChain.from_ranges(
        chain,
        mass={obj.name: (0.8 * obj.mass, 1.25 * obj.mass) for obj in chain.objects},
        floor_friction={first.name: (0.7 * first.floor_friction, 1.2 * first.floor_friction)},
        contact_friction={chain.objects[-1].name: (0.8 * last, 1.3 * last)},
    )


def world(interval: IntervalChain, masses: FloatArray, frictions: FloatArray, contact: float = 1.0) -> Chain:
    """Return the chain with masses (n,), floor frictions (n,) and a factor of the last contact's friction."""
    chain = interval.chain
    objects = tuple(
        replace(obj, mass=float(m), floor_friction=float(mu))
        for obj, m, mu in zip(chain.objects, masses, frictions, strict=True)
    )
    last = replace(chain.contacts[-1], friction=chain.contacts[-1].friction * contact)
    return replace(chain, objects=objects, contacts=(*chain.contacts[:-1], last))


def worlds(interval: IntervalChain, seed: int, count: int = 15) -> Iterator[Chain]:
    rng = np.random.default_rng([seed, 1])
    masses, frictions = interval.mass.T, interval.floor_friction.T
    for _ in range(count):
        yield world(
            interval,
            rng.uniform(masses[0], masses[1]),
            rng.uniform(frictions[0], frictions[1]),
            rng.uniform(1.0, 1.6),
        )


def below(contacts: ContactDynamics, chain: Chain, twists: FloatArray, rates: FloatArray) -> int:
    """Check that positive margins of the bound stay positive in a sample; return their number."""
    bound = contacts.margins(twists, rates)
    found = dynamic_margins(chain, twists, rates)
    promised = bound > 0.0
    assert (found >= bound - 1e-9)[promised].all()
    return int(promised.sum())


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("seed", range(4))
def test_no_sample_is_below_the_worst_case(make_chain: ChainMaker, n: int, seed: int) -> None:
    interval = widened(make_chain.random(seed, n, tree=seed == 3, feet=seed == 1))
    contacts = ContactDynamics(interval.chain, interval=interval)
    twists, rates = motions(interval.chain, seed)
    promised = 0
    for chain in worlds(interval, seed):
        same_cones = replace(chain, contacts=interval.chain.contacts)
        exact = ContactDynamics(same_cones)
        for least, real in (
            (contacts.quasi_static(twists), exact.quasi_static(twists)),
            (contacts.inertia(twists, rates), exact.inertia(twists, rates)),
        ):
            assert (least.rows <= real.rows + 1e-9).all()
            assert (least.size >= real.size - 1e-9).all()
        promised += below(contacts, chain, twists, rates)
    assert promised > 50


def test_a_few_motions_at_a_time_have_the_same_bounds(make_chain: ChainMaker, monkeypatch: Patch) -> None:
    chain = make_chain.random(5, 2, feet=True)
    contacts, (twists, rates) = ContactDynamics(chain, interval=widened(chain)), motions(chain, 5)
    least, forces = contacts.inertia(twists, rates), contacts.interval_inertia.forces(twists, rates)
    monkeypatch.setattr(uncertain, "_AT_ONCE", 100)
    part = contacts.inertia(twists, rates)
    np.testing.assert_array_equal(part.rows, least.rows)
    np.testing.assert_array_equal(part.size, least.size)
    np.testing.assert_array_equal(contacts.interval_inertia.forces(twists, rates), forces)
