"""Limits of an arc from the contacts: inside the exact polygon, and never at the cost of a stall unsaid."""

import numpy as np
import pytest
import shapely
from conftest import ChainMaker

from pushplan.errors import TimingError
from pushplan.mechanics.chain import Limits
from pushplan.mechanics.dynamics import ContactDynamics, SpeedWindow, admissible_speeds
from pushplan.mechanics.sphere import twists_at
from pushplan.planners.timing.arc_limits import ROOM, ArcLimits, Bounds, arc_limits, contact_limits
from pushplan.planners.timing.exact_timing import rest_to_rest, time_path
from pushplan.planners.timing.parts import PASSED, passing_speeds
from pushplan.plans.judge import contact_dynamics
from pushplan.plans.path import PushPath, cost_rate
from pushplan.scenario.file import load_scenario
from pushplan.util.arrays import FloatArray

FAST = Limits(speed=2.0, acceleration=20.0, jerk=1e3, angular_speed=20.0, angular_acceleration=90.0)


def _stable_twists(contacts: ContactDynamics, seed: int, count: int) -> FloatArray:
    """Unit-cost twists (count, 3) along which every contact holds by some margin."""
    rng = np.random.default_rng(seed)
    twists = rng.normal(size=(4000, 3)) * [0.2, 0.2, 1.5] + [1.0, 0.0, 0.0]
    margins = contacts.margins(1e-6 * twists, np.zeros_like(twists)).min(axis=1)
    kept = twists[margins > 0.02][:count]
    assert len(kept) == count
    return np.asarray(kept / cost_rate(kept)[:, None])


def _box(found: ArcLimits) -> shapely.Polygon:
    return shapely.box(0.0, -found.deceleration, found.speed**2, found.acceleration)


@pytest.mark.parametrize("n", [1, 3])
def test_the_rectangle_of_speeds_lies_inside_the_polygon(make_chain: ChainMaker, n: int) -> None:
    chain = make_chain.boxes(n)
    contacts = ContactDynamics(chain)
    for twist in _stable_twists(contacts, n, 20):
        found = contact_limits(twist, 1.0, Bounds(FAST, contacts))
        polygon = shapely.Polygon(admissible_speeds(chain, twist, SpeedWindow(100.0, 200.0)).vertices)
        assert polygon.contains(_box(found))


def test_no_other_split_between_speed_and_acceleration_is_much_faster(make_chain: ChainMaker) -> None:
    contacts = ContactDynamics(make_chain.boxes(2))
    for twist in _stable_twists(contacts, 7, 10):
        rows = contacts.rows(twist)
        best = rest_to_rest(0.8, contact_limits(twist, 0.8, Bounds(FAST, contacts))).duration
        for top in np.linspace(0.02, 1.0, 60) * arc_limits(twist, FAST).speed:
            bounds = arc_limits(twist, FAST, float(top))
            left = ROOM * rows.alpha + np.minimum(rows.gamma, 0.0) * bounds.speed**2
            if left.min() <= 0.0:
                continue
            up = float(np.min(left[rows.beta < 0] / -rows.beta[rows.beta < 0], initial=np.inf))
            down = float(np.min(left[rows.beta > 0] / rows.beta[rows.beta > 0], initial=np.inf))
            other = bounds._replace(
                acceleration=min(bounds.acceleration, up), deceleration=min(bounds.deceleration, down)
            )
            assert rest_to_rest(0.8, other).duration > 0.97 * best


def test_a_fast_pusher_makes_contacts_slip_unless_they_limit_it(make_chain: ChainMaker) -> None:
    chain = make_chain.boxes(3)
    contacts = ContactDynamics(chain)
    path = PushPath(np.zeros(3), _stable_twists(contacts, 3, 5), np.full(5, 0.6))
    least = []
    for used in (None, contacts):
        trajectory = time_path(path, Bounds(FAST, used))
        times = np.linspace(1e-3, trajectory.duration - 1e-3, 4000)
        rates = (trajectory.twists_at(times + 1e-6) - trajectory.twists_at(times - 1e-6)) / 2e-6
        moving = np.abs(trajectory.twists_at(times)).max(axis=1) > 1e-6
        least.append(contacts.margins(trajectory.twists_at(times)[moving], rates[moving]).min())
    assert least[0] < 0.0
    assert least[1] > 0.0


def test_a_twist_without_room_is_refused_with_the_way_out(make_chain: ChainMaker) -> None:
    """On the boundary of the stable set any acceleration would slip."""
    contacts = ContactDynamics(make_chain.boxes(1))
    inside, outside = np.array([1.0, 0.0, 0.0]), np.array([1.0, 0.0, 20.0])
    for _ in range(60):
        middle = 0.5 * (inside + outside)
        held = contacts.quasi_static(middle[None]).rows.min() > 0.0
        inside, outside = (middle, outside) if held else (inside, middle)
    with pytest.raises(TimingError, match=r"no room for inertia.*raise stability\.margin"):
        contact_limits(inside / cost_rate(inside), 1.0, Bounds(Limits(), contacts))


def test_an_arc_too_long_for_its_room_is_passed_at_the_speed_of_its_own_length() -> None:
    scenario = load_scenario("two-crates")
    stable, length = scenario.stable_set(), scenario.chain.characteristic_length
    bounds = Bounds(scenario.chain.pusher.limits, contact_dynamics(scenario, stable.name))
    meridians = stable.meridians(1e-6)
    upper = meridians.upper[:1] - 0.005 * 0.5 * (meridians.upper[:1] - meridians.lower[:1])
    twist = twists_at(meridians.longitude[:1], upper, length)
    twist /= cost_rate(twist)[:, None]
    with pytest.raises(TimingError, match="no room for inertia"):
        contact_limits(twist[0], PASSED, bounds)
    own = contact_limits(twist[0], 0.02, bounds).speed
    assert passing_speeds(twist, np.array([0.02]), bounds) == pytest.approx([own])
