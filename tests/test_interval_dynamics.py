"""Contact conditions with inertia over intervals: below every world that is built anew, and reached at vertices."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from conftest import ChainMaker

from pushplan.mechanics.chain import Chain
from pushplan.mechanics.dynamics import ContactDynamics, dynamic_margins
from pushplan.mechanics.intervals import IntervalChain
from pushplan.util.arrays import FloatArray


def motions(chain: Chain, seed: int, count: int = 60) -> tuple[FloatArray, FloatArray]:
    """Twists (k, 3), m/s and rad/s, and their rates (k, 3)."""
    rng, length = np.random.default_rng(seed), chain.characteristic_length
    twists = 0.2 * (rng.normal(size=(count, 3)) * [0.2, 0.1, 0.2 / length] + [1.0, 0.0, 0.0])
    return twists, 0.3 * rng.normal(size=(count, 3)) * [1.0, 0.5, 0.5 / length]


def spans(chain: Chain) -> tuple[dict[str, tuple[float, float]], dict[str, tuple[float, float]]]:
    """Intervals of all masses and of the first floor friction."""
    masses = {obj.name: (0.8 * obj.mass, 1.25 * obj.mass) for obj in chain.objects}
    first = chain.objects[0]
    return masses, {first.name: (0.7 * first.floor_friction, 1.2 * first.floor_friction)}


def widened(chain: Chain) -> IntervalChain:
    masses, frictions = spans(chain)
    last = chain.contacts[-1].friction
    lowest = {chain.objects[-1].name: (0.8 * last, 1.3 * last)}
    return IntervalChain.from_ranges(chain, mass=masses, floor_friction=frictions, contact_friction=lowest)


def world(interval: IntervalChain, masses: FloatArray, frictions: FloatArray, contact: float = 1.0) -> Chain:
    """The chain with masses (n,), floor frictions (n,) and the last contact's friction times a factor."""
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
    """Check that margins that are promised to be positive are kept in a world; return how many there are."""
    bound = contacts.margins(twists, rates)
    found = dynamic_margins(chain, twists, rates)
    promised = bound > 0.0
    assert (found >= bound - 1e-9)[promised].all()
    return int(promised.sum())


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("seed", range(4))
def test_no_world_has_less_than_the_least(make_chain: ChainMaker, n: int, seed: int) -> None:
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


def test_rows_hold_for_every_world_when_speeding_up_and_when_braking(make_chain: ChainMaker) -> None:
    """What timing relies on: a motion that the rows with a margin allow keeps this margin in every world."""
    interval = widened(make_chain.random(2, 2))
    contacts, margin, kept = ContactDynamics(interval.chain, interval=interval), 0.02, 0
    twists, _ = motions(interval.chain, 2, 40)
    rng = np.random.default_rng(9)
    for twist in twists:
        rows = contacts.rows(twist, margin)
        speed, acceleration = float(rng.uniform(0.1, 2.0)), float(rng.uniform(-3.0, 3.0))
        if rows.values(speed, acceleration).min() <= 0.0:
            continue
        kept += 1
        for chain in worlds(interval, 2):
            found = dynamic_margins(chain, [speed * twist], [acceleration * twist])
            assert found.min() > margin
    assert kept > 5
