"""Parts of the controller."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
import shapely
from conftest import there
from numpy.typing import ArrayLike

import pushplan
from pushplan.geometry.se2 import compose, exp, inverse, relative, transform_points, twist_of
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.perturb import slid
from pushplan.planner import Planner
from pushplan.planner import plan as plan_in
from pushplan.planners.clearance import find_collision
from pushplan.plans.path import cost_rate
from pushplan.plans.settings import Observer
from pushplan.scenario.goals import Goal
from pushplan.scenario.parts import CircleObstacle
from pushplan.sim.control.aim import Aim
from pushplan.sim.control.closing import GAP, ClosingPush, Closings, contacts_at
from pushplan.sim.control.departures import find_slide
from pushplan.sim.control.estimator import Estimator, Sample
from pushplan.sim.control.replanner import BOLD, CAUTION, NEARBY, Replanner, cautious
from pushplan.sim.control.sensing import Measurements, Sensor, Sightings
from pushplan.sim.control.settings import ControlSettings
from pushplan.sim.control.simulated_push import Disturbance, disturbed
from pushplan.sim.follower import Drive
from pushplan.sim.intake import Intake
from pushplan.util.arrays import FloatArray

NOISE, AHEAD = np.array([1e-3, 5e-3]), np.array([[1.0, 0.0]])
PERIOD = 1.0 / 30.0


@pytest.fixture(scope="module")
def crates() -> pushplan.Scenario:
    return pushplan.load_scenario("two-crates")


@pytest.fixture(scope="module")
def queries(crates: pushplan.Scenario) -> Planner:
    return Planner(crates)


def test_a_stop_from_any_point_keeps_to_the_path_and_the_limits(crates: pushplan.Scenario) -> None:
    trajectory = there(plan_in(crates, seed=1, first=True).trajectory)
    limits, dt = crates.chain.pusher.limits, 0.01
    for begin in np.linspace(0.05, 0.95, 7) * trajectory.duration:
        driving = Drive(trajectory, limits)
        driving.at = float(begin)
        driving.stop()
        poses, times = [trajectory.poses_at([begin])[0]], [float(begin)]
        while not driving.over:
            poses.append(driving.advance(dt))
            times.append(driving.at)
        np.testing.assert_allclose(trajectory.poses_at(times), poses, atol=1e-12)
        speeds = np.hypot(*np.diff(np.array(poses)[:, :2], axis=0).T) / dt
        speeds = np.append(speeds, 0.0)
        assert np.abs(np.diff(speeds)).max() / dt < 1.1 * limits.both("acceleration")[0]


@pytest.mark.parametrize(("slides", "best"), [((3e-3, 0.0), 0.0), ((0.0, 9e-3), 0.8), ((-4e-3, -1.2e-2), 1.05)])
def test_the_exact_pose_of_slid_objects_is_the_best_one(
    crates: pushplan.Scenario, slides: tuple[float, float], best: float
) -> None:
    """With the planned heading, the error of each object would be half of the second slide."""
    goal = Goal(crates.goal.pose_chain, None, crates.goal.pose_chain, 0.0, 0.0)
    aim, chain = Aim.of(goal, crates.chain, 5e-3, np.radians(1.0)), slid(crates.chain, slides)
    assert aim.best(chain) <= min(best, 0.5 * abs(slides[1]) / 5e-3)
    off = np.random.default_rng(1).uniform(-1.0, 1.0, (40_000, 3)) * [5e-3, 5e-3, np.radians(1.0)]
    assert aim.share(compose((aim.exact(chain) + off)[:, None], chain.places)).min() > aim.best(chain) - 0.01


TRUTHS = {
    "nothing": (np.zeros(3), 0.0, np.zeros(3), np.zeros(3)),
    "delay": (np.zeros(3), 0.03, np.zeros(3), np.zeros(3)),
    "all": (np.array([2e-3, 1e-3, 0.004]), -0.02, np.array([-0.01, 0.005, 0.01]), np.array([1e-3, 2e-3, 0.01])),
}  # fmt: skip


@pytest.mark.parametrize("wheels", [[0.0, 0.0, 0.0], [-0.45, -0.2, 0.0]])
@pytest.mark.parametrize("what", TRUTHS)
def test_errors_are_estimated_and_predict_later_measurements(what: str, wheels: list[float]) -> None:
    """The prediction is tested on other bends than the fit, so unobservable errors cannot matter. Errors of wheels
    are constant in the wheels' frame, wherever it is relative to the contact.
    """
    start, tau, scales, bias = TRUTHS[what]
    back = inverse(wheels)
    settings, places = ControlSettings(), np.array([[0.1, 0.0, 0.0], [0.3, 0.02, 0.5]])
    estimator, random, period = Estimator(settings, AHEAD[[0, 0]], np.array(wheels)), np.random.default_rng(3), 0.02
    believed, true, poses = np.zeros(3), start, []
    for k in range(1500):
        speed = 0.2 * min(1.0, 0.04 * max(0, k - 25))
        turn = 0.0 if k < 300 else 0.3 if k < 900 else -0.3
        twist = np.array([speed, 0.02 * speed, turn * speed / 0.2])
        estimator.moved(k * period, believed)
        poses.append(true)
        if k % 2 == 0 and k < 900:
            late = poses[max(0, k - round(tau / period))] if tau >= 0 else None
            there = compose(true, exp(-tau * twist)) if late is None else late
            if tau > 0.0:
                there = compose(poses[max(0, k - 2)], exp((2 * period - tau) * twist))
            seen = compose(compose(there, places), bias) + random.normal(size=(2, 3)) * [1e-3, 1e-3, 0.005]
            estimator.add(Sample(k * period, seen, places, NOISE))
        if k % 20 == 0:
            estimator.fit(k * period)
        rolled = twist_of(wheels, twist)
        done = np.array(rolled)
        done[0] += scales[0] * rolled[0] - scales[1] * rolled[1]
        done[1] += scales[0] * rolled[1] + scales[1] * rolled[0]
        done[2] *= 1.0 + scales[2]
        done = twist_of(back, done)
        believed, true = compose(believed, exp(twist * period)), compose(true, exp(done * period))
        if k == 1300:
            other = estimator.scaled(twist, np.array(wheels))
            assert estimator.asked(other, np.array(wheels)) == pytest.approx(twist)
    late = compose(compose(compose(poses[1490], exp(-tau * twist)), places), bias)
    sample = Sample(1490 * period, late, places, NOISE)
    off, spread = estimator.residuals([sample])[0], estimator.spread(sample)
    assert (np.hypot(off[:, 0], off[:, 1]) < 4.0 * spread[:, 0]).all()
    assert (spread < [4e-3, 5e-3]).all()
    assert estimator.values[3] == pytest.approx(tau, abs=8e-3)
    np.testing.assert_allclose(estimator.values[[4, 6]], scales[[0, 2]], atol=4e-3)
    # a lateral drift looks like a turned start with headings that are turned back
    assert estimator.values[2] + estimator.values[5] == pytest.approx(start[2] + scales[1], abs=4e-3)
    words = estimator.words()
    assert ("odometry" in words) == (what == "all"), words
    assert ("delay" in words.split(";")[0]) <= (tau != 0.0), words


class Watched:
    """A moving plate that is measured 30 times a second with stated or unstated noise, and its estimator."""

    def __init__(self, count: int, seed: int, true: ArrayLike = (0.0, 0.0, 0.0), **more: Any) -> None:
        self.estimator = Estimator(ControlSettings(), np.repeat(AHEAD, count, axis=0), np.zeros(3), **more)
        self.true, self.believed, self.k = np.array(true), np.zeros(3), 0
        self.random, self.noise, self.stated = np.random.default_rng(seed), NOISE, NOISE

    def see(self, objects: FloatArray, places: FloatArray, every: int = 0) -> None:
        """Measure objects (n, 3) of the plate's frame, at `places` by the plan; fit every so many times."""
        now = PERIOD * self.k
        self.estimator.moved(now, self.believed)
        seen = compose(self.true, objects) + self.random.normal(size=objects.shape) * self.noise[[0, 0, 1]]
        self.estimator.add(Sample(now, seen, places, self.stated))
        if every and self.k % every == 0:
            self.estimator.fit(now)

    def drive(self, twist: FloatArray, done: FloatArray | None = None) -> None:
        """Go on for a period as the wheels believe, and as they do."""
        self.believed = compose(self.believed, exp(PERIOD * twist))
        self.true = compose(self.true, exp(PERIOD * (twist if done is None else done)))
        self.k += 1


def test_estimates_are_the_same_wherever_in_the_world_the_plate_begins() -> None:
    found, places = [], np.array([[0.1, 0.0, 0.0], [0.3, 0.02, 0.5]])
    for origin in (np.zeros(3), np.array([30.0, -20.0, 2.0])):
        plate = Watched(2, seed=5, true=compose(origin, [3e-3, -2e-3, 0.01]))
        plate.believed, plate.noise = origin, 0.0 * NOISE
        for k in range(400):
            plate.see(places, places, 20)
            plate.drive(
                np.array([0.2, 0.0, 0.3 if k < 200 else -0.3]), np.array([0.202, 0.0, 0.3 if k < 200 else -0.3])
            )
        found.append(plate.estimator.values)
    assert np.abs(found[0]).max() > 1e-3
    np.testing.assert_allclose(found[1], found[0], atol=1e-6)


def test_each_measurement_is_weighted_by_its_stated_noise() -> None:
    """A bad camera with an error of 5 mm is replaced by a good one; nothing moves."""
    plate, places = Watched(1, seed=4), np.zeros((1, 3))
    for k in range(200):
        plate.noise = plate.stated = np.array([1e-2, 5e-2]) if k < 100 else NOISE
        plate.see(places + np.array([5e-3 * (k < 100), 0.0, 0.0]), places, 1)
        plate.drive(np.zeros(3))
    left = plate.estimator.residuals([Sample(200 * PERIOD, places, places, NOISE)])
    assert np.hypot(left[0, 0, 0], left[0, 0, 1]) < 4e-4


def test_earlier_good_measurements_keep_their_weight_when_the_camera_gets_worse() -> None:
    """The noise rises from 1 mm to 8 mm without notice; more measurements must not increase the uncertainty."""
    plate, places, known = Watched(1, seed=6), np.zeros((1, 3)), []
    for k in range(300):
        plate.noise = (1.0 if k < 200 else 8.0) * NOISE
        plate.see(places, places, 1)
        plate.drive(np.array([0.2, 0.0, 0.0]))
        if k in (199, 299):
            known.append(np.sqrt(np.diag(plate.estimator.covariance)))
    assert (known[1] < 1.02 * known[0]).all()
    assert plate.estimator.noise([Sample(10.0, places, places, NOISE)])[0, 0] == pytest.approx(8e-3, rel=0.3)


def test_a_lateral_offset_of_the_load_is_not_taken_for_wheel_drift() -> None:
    """The plate stands 9 mm farther to the right along the load than believed, which shows in a bend."""
    places, aside = np.array([[0.075, 0.0, 0.0]]), -9e-3
    found = []
    for known in (0.0, 0.02):
        plate = Watched(1, 2, [0.0, aside, 0.0], aside_deviation=known, places=places)
        for k in range(400):
            plate.see(compose([0.0, -aside, 0.0], places), places, 8)
            if k == 280:
                straight = plate.estimator.aside(places)
            plate.drive(np.array([0.2, 0.0, 0.2 if k > 280 else 0.0]))
        estimator = plate.estimator
        bent = estimator.aside(places)
        assert bent[0] == pytest.approx(-aside, abs=1e-3)
        assert known == 0.0 or bent[1] < 4e-3 < 0.5 * abs(aside) < straight[1], "it shows in a bend only"
        found.append(abs(estimator.values[5]))
    assert found[1] < 1e-3 < 4e-3 < found[0]


SLIDES = {
    "nothing": (None, 0.0, 0.0, 0.4),
    "drift aside": (None, 0.0, 0.01, 0.4),
    "slide from the start on, on a straight": (None, 0.01, 0.0, 0.0),
    "slide of all": (0, 0.01, 0.0, 0.4),
    "slide of all with drift aside": (0, 0.01, -0.01, 0.4),
    "slide of one": (1, -0.01, 0.0, 0.4),
    "step of one": (1, 3e-3, 0.0, 0.94),
}  # fmt: skip


@pytest.mark.parametrize("what", SLIDES)
def test_slides_are_distinguished_from_constant_errors(crates: pushplan.Scenario, what: str) -> None:
    """Over 2 m, first on a straight and then on an arc."""
    contact, rate, drift, begin = SLIDES[what]
    chain, plate, way = crates.chain, Watched(2, seed=5), 0.0
    for k in range(300):
        speed, slides = 0.2 * min(1.0, 0.05 * max(0, k - 15)), np.zeros(2)
        twist = np.array([speed, 0.0, 0.3 * speed if begin and k > 100 else 0.0])
        way += speed * PERIOD * (k >= 300 * begin)
        slides[contact or 0] = rate * (way if begin < 0.9 else k >= 300 * begin)
        plate.see(slid(chain, slides).places, chain.places, 8)
        plate.drive(twist, twist + np.array([0.0, drift * speed, 0.0]))
    found = find_slide(plate.estimator, chain, 0.0)
    assert (None if found is None else found.contact) == contact
    if found is not None:
        assert found.size == pytest.approx(slides[found.contact], abs=3e-3)
        assert found.since == pytest.approx(begin * 10.0, abs=1.5)


def noticed_after(chain: Chain, rate: float, seed: int) -> float:
    """Return the slide (m) of all objects of a chain at its detection; inf without one. It begins after 0.3 m of a
    straight, on an arc with a radius of 1 m.
    """
    plate, way = Watched(len(chain.objects), seed), 0.0
    for k in range(210):
        speed, far = 0.2 * min(1.0, 0.1 * k), max(0.0, rate * (way - 0.3))
        plate.see(slid(chain, [far] + [0.0] * (len(chain.objects) - 1)).places, chain.places, 8)
        found = find_slide(plate.estimator, chain, 0.0) if k % 8 == 0 else None
        if found is not None:
            return far if rate and found.size > 0.0 else -math.inf
        plate.drive(np.array([speed, 0.0, speed if way > 0.3 else 0.0]))
        way += PERIOD * speed
    return math.inf


def test_a_single_box_that_slides_on_an_arc_is_noticed_before_8_mm() -> None:
    """An offset of the wheels explains nearly the same; without a slide there is no detection."""
    chain = pushplan.load_scenario("one-box").chain
    far = np.array([noticed_after(chain, 0.01, seed) for seed in range(6)])
    assert ((far > 0.0) & (far < 8e-3)).all()
    assert {noticed_after(chain, 0.0, seed) for seed in range(6)} == {math.inf}


def test_a_sensor_has_its_rate_delay_and_noise() -> None:
    seen = Measurements(Sensor(), seed=1)
    came = []
    for k in range(1000):
        seen.take(0.01 * k, np.zeros((2, 3)))
        found = seen.arrived(0.01 * k)
        if found is not None:
            came.append(0.01 * k - found[1])
    assert len(seen.t) == pytest.approx(300, abs=2)
    assert min(came) >= 0.1 - 1e-9
    spread = np.std(np.array(seen.poses), axis=(0, 1))
    np.testing.assert_allclose(spread, [1e-3, 1e-3, np.radians(0.3)], rtol=0.15)


def test_what_a_camera_on_the_plate_sees_rests_in_the_world_between_two_steps() -> None:
    """From the first two steps on; a constant twist leads the plate from one to the next."""
    seen, rest = Sightings(np.array([1e-3, 0.005])), np.array([[0.4, 0.1, 0.2], [0.5, -0.2, -1.0]])
    begin, twist, steps = np.array([1.0, -2.0, 2.5]), np.array([0.3, 0.1, -0.8]), (0.0, 0.1, 0.2)
    for at in (0.04, 0.17):
        seen.see(at, relative(compose(begin, exp(at * twist)), rest), "plate")
    come = [one for now in steps for one in seen.come(now, compose(begin, exp(now * twist)), True, lambda *_: None)]
    assert [at for at, _ in come] == [0.04, 0.17]
    np.testing.assert_allclose(come[1][1], rest, atol=1e-12)  # the second confirms the first


@pytest.mark.parametrize("held", [True, False])
def test_a_disturbance_leaves_no_overlap_and_moves_carried_objects_ahead(
    crates: pushplan.Scenario, held: bool
) -> None:
    world = pushplan.World.from_scenario(crates)
    random = np.random.default_rng(2)
    for _ in range(20):
        way, index = random.uniform(-np.pi, np.pi), int(random.integers(2))
        disturbance = Disturbance(0.0, index, 5e-3 * np.cos(way), 5e-3 * np.sin(way), 0.05)
        simulator = pushplan.SlipSimulator(world)
        if not held:
            simulator.hold(None)
        poses = disturbed(simulator, simulator.plate_pose, disturbance)
        outlines = [transform_points(p, o.outline) for p, o in zip(poses, crates.chain.objects, strict=True)]
        outlines.append(transform_points(world.start, crates.chain.pusher.outline))
        shapes = [shapely.Polygon(outline) for outline in outlines]
        assert max(shapes[a].intersection(shapes[b]).area for a, b in ((0, 1), (0, 2), (1, 2))) < 1e-9


def test_a_long_load_that_turned_is_closed_by_a_longer_push() -> None:
    scenario = pushplan.load_scenario("carts")
    world = pushplan.World.from_scenario(scenario)
    poses = disturbed(pushplan.SlipSimulator(world), world.start, Disturbance(0.0, 0, 5e-3, 0.0, 0.052))
    assert contacts_at(scenario.chain, relative(world.start, poses)).opening.max() > 0.02
    noise = np.array([1e-3, 4e-3])
    push = Closings(world, ControlSettings()).next(world.start, poses, Planner(scenario).twists, noise)
    assert isinstance(push, ClosingPush)
    assert 0.05 < push.length < 0.1


def test_a_closing_push_also_works_in_other_samples(crates: pushplan.Scenario, queries: Planner) -> None:
    world = pushplan.World.from_scenario(crates)
    disturbance = Disturbance(0.0, 0, 4e-3, 2e-3, 0.03)
    poses = disturbed(pushplan.SlipSimulator(world), world.start, disturbance)
    assert contacts_at(crates.chain, relative(world.start, poses)).opening.max() > 1e-3
    push = Closings(world, ControlSettings()).next(world.start, poses, queries.twists, np.array([1e-3, 4e-3]))
    assert isinstance(push, ClosingPush)
    assert push.length < 0.05
    for factor in (0.75, 1.0, 1.25):
        simulator = pushplan.SlipSimulator(world.with_contact_friction(factor))
        simulator.place(poses, world.start)
        simulator.move(push.twist, push.length)
        after = relative(simulator.plate_pose, simulator.object_poses)
        assert contacts_at(crates.chain, after).flush(2.0 * GAP, 2e-3)


def test_the_rest_of_an_earlier_plan_is_kept_from_a_little_aside(crates: pushplan.Scenario, queries: Planner) -> None:
    before = there(queries.plan(crates.start, crates.goal.pose_chain, timed=False).path)
    start = compose(before.poses_at([0.3 * before.cost])[0], [0.0, 3e-3, 0.02])
    goal = crates.goal.pose_chain + np.array([2e-3, 1e-3, 0.0])
    after = there(queries.plan(start, goal, timed=False, previous=before).path)
    np.testing.assert_allclose(after.end, goal, atol=1e-9)
    assert after.cost < 1.5 * 0.7 * before.cost + 0.3
    np.testing.assert_allclose(after.twists[-1], before.twists[-1], atol=1e-12)
    assert cost_rate(after.twists) == pytest.approx(1.0)


def test_a_cautious_plan_leaves_room_for_what_the_camera_may_err_by_against_the_map(
    crates: pushplan.Scenario,
) -> None:
    first = Replanner(crates, ControlSettings(bias=(4e-3, 0.01)), Observer()).first()
    poses = first.segments[0].contact_trajectory.poses
    assert find_collision(replace(crates, clearance=1.04e-2), poses) is None
    assert find_collision(replace(crates, clearance=0.5), poses) is not None


@pytest.mark.parametrize("slide", [-1.7e-2, 1.7e-2])
def test_what_has_slid_is_kept_off_obstacles(slide: float) -> None:
    """At the goal a pillar would stand 5 mm to the left of the cabinet, had that not slid by 3 % of its contact."""
    pillar = CircleObstacle(np.array([5.0 + 0.95, 0.3 + 0.1 + 0.005]), 0.1)
    goal = np.array([5.0, 0.0, 0.0])
    feet = pushplan.load_scenario("feet").with_goal(Goal(goal, "table", goal, 1e-3, 1e-3))
    feet = replace(feet, obstacles=(pillar,))
    replanner = Replanner(feet, ControlSettings(time_limit=60.0), Observer())
    found = replanner.replan(0.0, np.zeros(3), None, np.array([0.0, slide]), CAUTION[-1])
    assert found.solved == (slide < 0.0), found.reason


Question = tuple[float, FloatArray, None, FloatArray, float]


def carts_aside(
    margin: float | Literal["auto"], before: float, aside: float, travel: float = 1.0
) -> tuple[pushplan.Scenario, Question]:
    """Return carts that stand so far before the goal and aside, turned, and the question how to go on."""
    carts = pushplan.load_scenario("carts").with_margin(margin)
    start = compose(carts.goal.pose_chain, inverse([before, aside, 2.0 * aside]))
    return carts, (0.0, start, None, np.zeros(2), travel)


@pytest.mark.parametrize(("aside", "margin", "ends"), [
    (0.0, "auto", (-1.0, 1e-6)), (0.053, "auto", (0.1, 0.9)), (0.053, 0.05, (1.0, 4.0)),
])  # fmt: skip
def test_where_no_path_leads_to_the_goal_one_ends_as_near_as_it_can(
    aside: float, margin: float | Literal["auto"], ends: tuple[float, float]
) -> None:
    """Half a metre before it, carts that stand aside, turned, would have to turn more tightly than they bear.

    A margin that is stated is kept; an automatic one gives way where the goal can be met with less.
    """
    carts, given = carts_aside(margin, 0.45, aside)
    replanner = Replanner(carts, ControlSettings(time_limit=60.0), Observer())
    assert replanner.best(*given, left=0.9)[-1].solved == (aside == 0.0)
    found = there(replanner.best(*given, left=np.inf)[-1].result)
    share = float(replanner.aim.share(compose(there(found.path).end, carts.chain.places)))
    assert ends[0] < share <= ends[1]
    assert there(found.min_margin) > (0.05 if margin == 0.05 else 0.0125)
    if share > 1.0:
        random = np.random.default_rng(1).uniform(-1.0, 1.0, (40_000, 3)) * [4e-2, 4e-2, np.radians(2.0)]
        others = carts.goal.pose_chain + random
        shares = replanner.aim.share(compose(others[:, None], carts.chain.places))
        reach = replanner.planner(BOLD if margin == 0.05 else NEARBY[-1]).reach
        assert shares[np.isfinite(reach(given[1], others)[0])].min() > share - 0.2


@pytest.mark.parametrize(("aside", "ends"), [(0.053, 0.9), (0.075, np.inf)])
def test_a_margin_that_planners_chose_is_lowered_where_nothing_else_leads_to_the_goal(
    aside: float, ends: float
) -> None:
    carts, given = carts_aside(0.05, 0.45, aside)
    for lowers in (False, True):
        replanner = Replanner(carts, ControlSettings(time_limit=60.0), Observer(), lowers)
        replan = replanner.best(*given, left=0.9)[-1]
        assert replan.solved == (lowers and ends < 1.0)
    if replan.solved:
        assert 0.0125 < there(there(replan.result).min_margin) < 0.05


def test_who_is_wary_plans_for_the_least_friction_only_and_of_objects_apart_too() -> None:
    """A metre before the goal, carts stand aside so that they can be turned enough with the friction as believed."""
    carts, given = carts_aside("auto", 1.0, 0.055, 1.5)
    replanner = Replanner(carts, ControlSettings(time_limit=60.0), Observer())
    for replanner.wary, least in ((False, 1.0), (True, 0.8)):
        found = there(replanner.best(*given, left=0.9)[-1].result)
        assert there(found.cost) < 1.5
        assert found.scenario.chain.contacts[0].friction == pytest.approx(least * carts.chain.contacts[0].friction)
    pencils = pushplan.load_scenario(Path(__file__).parents[2] / "examples" / "pencils.yaml")
    less, friction = cautious(pencils, 0.2), pencils.transport.row.friction
    assert less.transport.row.friction == pytest.approx((0.8 * friction[0], friction[1]))
    for load in less.loads:
        stated = pencils.task.by_name[load.name].chain.contacts[0].friction
        assert load.chain.contacts[0].friction == pytest.approx(0.8 * stated)


@pytest.mark.parametrize(("length", "slides"), [(0.25, 0.05), (3.0, 0.0)])
def test_what_a_slide_was_taken_for_is_forgotten_and_what_is_known_well_is_not(
    crates: pushplan.Scenario, length: float, slides: float
) -> None:
    """Both objects slide from the beginning of a short arc, or wheels err along a long one."""
    chain, plate, way = crates.chain, Watched(2, seed=5), 0.0
    scales, twist = np.array([1.03, 1.0, 0.99]) if slides == 0.0 else np.ones(3), np.array([0.2, 0.0, -0.14])
    while way < length:
        plate.see(slid(chain, [slides * way, 0.0]).places, chain.places)
        plate.drive(twist, twist * scales)
        way += 0.2 * PERIOD
    estimator, now = plate.estimator, PERIOD * plate.k + 1.0
    for _ in range(5):
        estimator.fit(now)
    taken = estimator.values[4:7].copy()
    estimator.doubt(now)
    found, sigma = estimator.values[4:7], np.sqrt(np.diag(estimator.covariance))[4:7]
    if slides:
        assert np.abs(taken).max() > 0.01
        assert np.abs(found[[1, 2]]).max() < 1e-6
        np.testing.assert_allclose(sigma[1:], ControlSettings().odometry_error)
    else:
        np.testing.assert_allclose(found, scales - 1.0, atol=4e-3)
        np.testing.assert_allclose(found, taken, atol=1e-3)


def test_invalid_covariances_are_dropped_and_valid_ones_give_the_largest_deviation() -> None:
    told: list[str] = []
    intake = Intake(told.append)
    one, other = np.diag([4e-6, 1e-6, 9e-4]), np.array([[2e-6, 1e-6, 0.0], [1e-6, 2e-6, 0.0], [0.0, 0.0, 1e-4]])
    np.testing.assert_allclose(there(intake.deviations(one, 2)), [2e-3, 3e-2])
    np.testing.assert_allclose(there(intake.deviations([other, one], 2)), [2e-3, 3e-2])
    np.testing.assert_allclose(there(intake.deviations(other, 2)), [np.sqrt(3e-6), 1e-2])
    assert not told
    for wrong in (np.full((3, 3), np.inf), -one, np.tril(other)):
        assert intake.deviations(wrong, 2) is None
    assert all("an invalid covariance" in line for line in told)
