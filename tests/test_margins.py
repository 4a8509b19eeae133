"""The margin and the robustness of a plan: the value of auto, its reduction, and tight limits."""

from dataclasses import astuple
from functools import cache
from itertools import count, product

import joint_errors
import numpy as np
import pytest
import yaml
from conftest import ChainMaker, Patch, there
from kinds import made

from pushplan.geometry import se2
from pushplan.geometry.polygon import find_touch
from pushplan.mechanics.chain import Chain, Drive
from pushplan.mechanics.support import FeetSupport, UnknownSupport
from pushplan.planner import plan
from pushplan.planners.controls import HALVINGS, MOST_MARGIN, automatic_margin
from pushplan.plans.plan import Plan
from pushplan.plans.robustness import MOST_ANGLE, MOST_SHARE, USED_UP, Robustness
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.builders import box, build_scenario, plate
from pushplan.scenario.file import example_names, example_text, load_scenario, scenario_from_document
from pushplan.scenario.model import Scenario
from pushplan.sets.named import stable_set
from pushplan.sets.stable_set import StableSet
from pushplan.sim.joint_robustness import ErrorBox, JointErrors
from pushplan.sim.moments import ChainMotion, Moments, thinned
from pushplan.sim.robustness import least_robustness, robustness_along, robustness_of
from pushplan.util.arrays import FloatArray

ITERATIONS = 6000


def evenly(count: int) -> FloatArray:
    """Return unit vectors (k, 3) spread evenly over the half sphere x >= 0."""
    k = np.arange(count) + 0.5
    height, angle = 1.0 - 2.0 * k / count, np.pi * (1.0 + 5.0**0.5) * k
    flat = np.sqrt(1.0 - height**2)
    return np.stack([np.abs(flat * np.cos(angle)), flat * np.sin(angle), height], axis=1)


def largest_margin(stable: StableSet) -> float:
    """Return the largest margin of dense twists, refined three times about the best."""
    scale = np.array([1.0, 1.0, 1.0 / stable.chain.characteristic_length])
    center, radius, best = np.zeros(3), 1.0, -1.0
    for _ in range(4):
        near = center + radius * evenly(40_000) * np.linspace(0.1, 1.0, 40_000)[::-1, None]
        near = np.vstack([near, center - (near - center)]) if center.any() else near
        margins = stable.margin(near * scale)
        center, radius = near[int(margins.argmax())], 0.1 * radius
        best = max(best, float(margins.max()))
    return best


def made_by(drive: Drive) -> FloatArray:
    """Return twists (k, 3) of the plate for axle midpoints that move forward along their axis at any turn rate."""
    x, y, heading = there(drive.axle)
    tightest = 1.0 / drive.min_radius if drive.min_radius > 0.0 else 100.0
    omega = np.concatenate([np.linspace(-1.0, 1.0, 40_001) * min(tightest, s) for s in (100.0, 3.0)])
    forward = np.array([np.cos(heading), np.sin(heading)])
    return np.column_stack([forward[0] + omega * y, forward[1] - omega * x, omega])


def slippery(make_chain: ChainMaker, friction: float) -> Chain:
    return make_chain.boxes(2, contact_friction=friction, pusher_friction=friction)


@pytest.mark.parametrize("friction", [0.02, 0.05, 0.09, 0.15, 0.5])
def test_auto_is_a_twentieth_or_half_of_the_largest_margin(make_chain: ChainMaker, friction: float) -> None:
    chain = slippery(make_chain, friction)
    best = largest_margin(stable_set(chain))
    found = automatic_margin(stable_set(chain), chain.pusher.drive)
    assert min(MOST_MARGIN, 0.5 * best) - 1e-12 <= found <= min(0.05, 0.5 * best * 1.01)


@pytest.mark.parametrize("friction", [0.05, 0.1, 0.5])
@pytest.mark.parametrize("radius", [0.0, 0.6])
@pytest.mark.parametrize("aside", [0.0, 0.01])
def test_with_wheels_only_their_twists_count(
    make_chain: ChainMaker, friction: float, radius: float, aside: float
) -> None:
    chain = slippery(make_chain, friction)
    kind = "car" if radius else "differential"
    drive = Drive(kind, np.array([-0.2, aside, 0.0]), radius)
    best = float(stable_set(chain).margin(made_by(drive)).max())
    found = automatic_margin(stable_set(chain), drive)
    assert min(MOST_MARGIN, 0.5 * best) == pytest.approx(found, rel=0.01)


@cache
def u_turn(side: float = 2.6) -> Scenario:
    """Return slippery boxes that must turn round although only wide turns have half of the largest margin."""
    friction = 0.08
    return build_scenario(
        "u-turn",
        [box("near", 0.2, 0.3, 2.0), box("far", 0.2, 0.3, 2.0)],
        plate(0.3, friction),
        (0.6, side - 0.25, np.pi),
        floor_friction=0.3,
        contact_friction=friction,
        start=(0.6, 0.25, 0.0),
        workspace={"x": [0.0, 1.3 * side], "y": [0.0, side]},
    )


@cache
def u_turned(margin: float | None = None) -> Plan:
    return plan(u_turn(), margin=margin, time_limit=60.0, iterations=ITERATIONS)


def test_the_margin_is_lowered_in_halvings_until_there_is_a_path() -> None:
    result = u_turned()
    assert result.solved, result.reason
    asked, margin = there(result.margin_asked), there(result.margin)
    assert asked == pytest.approx(automatic_margin(u_turn().stable_set(), Drive()))
    most = f"no push of 'near', 'far' has more than {2.0 * asked:.2g}"
    assert result.notes == [f"margin {asked:.2g} instead of 0.05: {most}", result.lowered]
    halvings = np.log2(asked / margin)
    assert halvings == pytest.approx(round(float(halvings)), abs=1e-9)
    assert 1 <= halvings <= HALVINGS
    assert margin < there(result.min_margin) < asked
    assert result.lowered == f"margin {margin:.2g} instead of {asked:.2g}: no path was found with a larger one"


def test_a_stated_margin_is_never_lowered() -> None:
    asked = there(u_turned().margin_asked)
    result = u_turned(asked)
    assert not result.solved
    assert (result.margin_asked, result.margin, result.notes) == (asked, asked, [])
    kept = u_turned(u_turned().margin)
    assert kept.solved, kept.reason
    assert kept.lowered == ""


def test_all_margins_share_one_time_limit(monkeypatch: Patch) -> None:
    """No margin solves it or proves infeasibility, and each of six searches would use its whole time."""
    looked = count()
    monkeypatch.setattr("time.perf_counter", lambda: 0.005 * next(looked))  # CPU time, independent of other programs
    result = plan(u_turn(1.6), time_limit=1.5, planner="rrt")
    assert not result.solved
    assert (result.margin or 1.0) < (result.margin_asked or 0.0)
    assert 1.2 < result.planning_s < 3.0


MOST = {
    "contact_friction": 1.0, "floor_friction": MOST_SHARE, "load": MOST_SHARE, "position": np.inf,
    "angle": MOST_ANGLE,
}  # fmt: skip
COLUMNS = {"floor_friction": [0], "load": [2, 3], "position": [4], "angle": [5]}
"""Columns of each kind of error in an error box."""
AHEAD, STILL = np.array([[0.1, 0.0, 0.0]]), np.zeros((1, 3))


def least_at(chain: Chain, moments: Moments, kind: str, size: float) -> float:
    """Return the smallest margin of all chains with an error of `size` in one number."""
    n = len(chain.objects)
    if kind == "contact_friction":
        box = ErrorBox(chain, np.full(n, size), np.zeros((n, 6)))
        return joint_errors.least(box, 1.0, np.zeros((n, 6)), moments)
    box, found = ErrorBox(chain, np.zeros(n), np.full((n, 6), size)), []
    for i, column, sign in product(range(n), COLUMNS[kind], (1.0, -1.0)):
        point = np.zeros((n, 6))
        point[i, column] = sign
        found.append(joint_errors.least(box, 1.0, point, moments))
    return float(min(found))


STRAIGHT = sorted({*example_names()} - {"trapezoids"})  # an oblique contact opens with the error


@pytest.mark.parametrize("name", STRAIGHT)
def test_shifted_objects_touch_with_their_outline_and_turned_ones_carry_others_along(name: str) -> None:
    chain = load_scenario(name).chain
    for k, size in product(range(len(chain.objects)), (0.004, -0.004)):
        moved = joint_errors.one_off(chain, k, aside=size).applied(chain)
        bodies = [*(obj.outline_chain for obj in moved.objects), chain.pusher.outline]  # the plate is -1
        for contact in moved.contacts:
            touches = there(find_touch(bodies[contact.pusher], bodies[contact.pushed]))
            ends = np.array([contact.right, contact.left])
            assert min(np.abs(touch - ends).max() for touch in touches) < 1e-9
        shift = moved.places - chain.places
        np.testing.assert_allclose(shift[k, :2], size * chain.contacts[k].tangent, atol=1e-12)
        assert not np.delete(shift, k, axis=0).any()
        off, own = joint_errors.one_off(chain, k, angle=size).applied(chain), chain.contacts[k]
        middle = 0.5 * (own.right + own.left)
        np.testing.assert_allclose([off.contacts[k].right, off.contacts[k].left], [own.right, own.left])
        motion = np.append(middle - se2.rotate(size, middle), size)
        carried = {k}
        for i, contact in enumerate(chain.contacts):
            carried |= {i} if contact.pusher in carried else set()
            place = se2.compose(motion, chain.places[i]) if i in carried else chain.places[i]
            np.testing.assert_allclose(off.places[i], place, atol=1e-12)


def test_the_robustness_is_told_with_two_digits_rounded_down() -> None:
    robustness = Robustness(0.6789, 0.0339, 1.29, 0.01259, np.radians(9.99), 0.123)
    assert robustness.sentence().startswith(
        "one at a time: contact friction -32 %,\nfloor friction ±3.3 %, load ±120 % or more,\n"
        "position 12 mm, heading 9.9 deg;\nall together: 0.12 x"
    )


@pytest.mark.parametrize("name", [name for name in STRAIGHT if name != "five-objects"])  # it takes seconds
def test_every_margin_is_positive_just_below_the_robustness_and_one_is_not_just_above(name: str) -> None:
    scenario = load_scenario(name)
    found = plan(scenario, first=True, seed=1, time_limit=60.0)
    robustness, trajectory = there(found.robustness), found.segments[0].contact_trajectory
    assert robustness == robustness_of(scenario.chain, trajectory)
    assert not robustness.used_up
    moments = thinned(trajectory.directions, trajectory.rates_at(trajectory.t), scenario.chain.characteristic_length)
    for kind in MOST:
        value = getattr(robustness, kind)
        size = 1.0 - value if kind == "contact_friction" else value
        for share, holds in ((0.98, True), (1.02, False)):
            least = least_at(scenario.chain, moments, kind, share * size)
            assert (least > 0.0) == holds or (share > 1.0 and size >= MOST[kind]), (kind, share)
    # All errors together, at random corners of the box and at the worst one.
    box = ErrorBox.fixed(scenario.chain)
    scale, corner = JointErrors(ChainMotion(scenario.chain, moments), box).worst()
    assert scale == pytest.approx(robustness.joint, rel=1e-5)
    rng = np.random.default_rng(1)
    for point in [corner, *rng.choice([-1.0, 1.0], (8, *corner.shape))]:
        assert joint_errors.least(box, 0.98 * scale, point, moments) > 0.0
    assert joint_errors.least(box, 1.02 * scale, corner, moments) < 0.0


@pytest.mark.parametrize("kind", ["rearrangement", "gathering"])
def test_the_robustness_of_a_plan_is_that_of_its_weakest_push(kind: str) -> None:
    segments = made(kind).plan.segments
    each = [
        astuple(robustness_of(push.load.chain, push.contact_trajectory, ErrorBox.of(push.load)))
        for push in segments
        if push.pushes and push.load is not None
    ]
    assert len(each) > 1
    friction, *others = zip(*each, strict=True)
    # A contact friction is the smallest tolerated factor; all others are tolerated errors.
    np.testing.assert_allclose(astuple(least_robustness(segments)), [max(friction), *map(min, others)], rtol=2e-4)


def test_stated_intervals_are_the_box_of_the_joint_robustness() -> None:
    """The plan holds for all stated values, so the scale is at least 1; the test does not require 2."""
    stated = {"contact_friction": "20 %", "floor_friction": "10 %", "load": "5 %"}
    document = yaml.safe_load(example_text("two-crates")) | {"uncertainty": stated}
    found = plan(scenario_from_document(document), first=True, seed=1, time_limit=60.0)
    push = found.segments[0]
    box = ErrorBox.of(there(push.load))
    assert box.contact_friction == pytest.approx(0.2)
    assert box.widths == pytest.approx(np.tile([0.1, 0.0, 0.05, 0.05, 0.0, 0.0], (2, 1)))
    assert [c.friction for c in box.chain.contacts] == pytest.approx(
        [c.friction / 0.8 for c in there(push.load).chain.contacts]
    )
    assert 1.0 <= (there(found.robustness).joint or 0.0) < 2.0
    assert found.robustness_words.endswith(" x the stated intervals")


def test_a_box_pushed_straight_ahead_tolerates_no_friction_and_half_its_width(make_chain: ChainMaker) -> None:
    """The push needs no friction; the force passes through the middle of the box, which stays in front of the
    plate.
    """
    robustness = robustness_along(make_chain.boxes(1), AHEAD, STILL)  # the plate is 0.2 m wide, the box 0.1 m
    assert robustness.contact_friction == pytest.approx(0.0, abs=1e-12)
    assert robustness.floor_friction == robustness.load == MOST_SHARE
    assert robustness.position == pytest.approx(0.1, rel=1e-6)


@pytest.mark.parametrize("turn", [0.6, -0.6])
def test_robustness_holds_at_any_lower_speed(make_chain: ChainMaker, turn: float) -> None:
    """In a fast curve, inertia unloads one side of a contact; a slower robot lacks this relief."""
    chain, fast = make_chain.boxes(2), np.array([[0.3, -0.2 * turn, turn]])
    found = [astuple(robustness_along(chain, speed * fast, STILL)) for speed in (1.0, 0.5, 1e-3)]
    friction, *others = (np.array(values) for values in zip(*found, strict=True))
    assert 0.0 < friction.min() < 1.0
    assert friction[0] >= friction.max() * (1.0 - 1e-9)
    assert all(values[0] <= values.min() * (1.0 + 1e-3) for values in others)


def test_a_motion_that_loses_a_nominal_contact_has_no_robustness(make_chain: ChainMaker) -> None:
    chain = make_chain.boxes(2, contact_friction=0.1)
    robustness = robustness_along(chain, np.array([[0.1, 0.02, 0.0]]), STILL)
    assert robustness == USED_UP


@pytest.mark.parametrize("support", [
    UnknownSupport,
    lambda outline: FeetSupport(outline, center_of_mass=np.zeros(2)),
], ids=["unknown", "feet"])  # fmt: skip
def test_robustness_is_unknown_for_unknown_loads(make_chain: ChainMaker, support: object) -> None:
    assert callable(support)
    ahead = np.array([[[0.1, 0.0, 0.0], np.zeros(3), np.zeros(3)]])
    straight = Trajectory(np.zeros(3), np.array([0.0, 1.0]), ahead, np.zeros(1))
    robustness = robustness_of(make_chain.boxes(2, support=support), straight)
    assert robustness == Robustness()
    assert robustness.sentence() == "unknown, because a load on the floor is unknown or can lift"
