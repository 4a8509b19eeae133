"""What a plan tolerates: true just below and just above, by chains that are built anew; closed forms; words."""

from dataclasses import replace

import numpy as np
import perturbed
import pytest
from conftest import ChainMaker

from pushplan.mechanics.support import FeetSupport, UnknownSupport
from pushplan.planners.planner import plan
from pushplan.plans.robustness import MOST_ANGLE, MOST_SHARE, USED_UP, Robustness
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.file import load_scenario
from pushplan.sim.robustness import robustness_along, robustness_of

SEEDS = (2, 3, 4, 6, 8, 9, 11, 12, 13, 14, 15, 16, 17, 19, 21, 22, 23, 24, 25, 27)
"""Of random motions that keep every contact as stated; docs/will-it-hold.md has figures of 500."""
MOST = {"contact_friction": 1.0, "floor_friction": MOST_SHARE, "load": MOST_SHARE, "angle": MOST_ANGLE}
AHEAD, STILL = np.array([[0.1, 0.0, 0.0]]), np.zeros((1, 3))


@pytest.mark.parametrize("seed", SEEDS)
def test_every_margin_is_positive_just_below_the_robustness_and_one_is_not_just_above(seed: int) -> None:
    scenario = perturbed.random_scenario(seed)
    trajectory = perturbed.random_trajectory(scenario, seed)
    assert trajectory is not None
    robustness = robustness_of(scenario.chain, trajectory)
    assert not robustness.used_up
    for kind in perturbed.KINDS:
        value = getattr(robustness, kind)
        size = 1.0 - value if kind == "contact_friction" else value

        def least(share: float, kind: str = kind, size: float = size) -> float:
            off = 1.0 - share * size if kind == "contact_friction" else share * size
            return float(perturbed.least_at(scenario.chain, trajectory, kind, off))

        assert least(0.98) > 0.0, kind
        assert least(0.5) > 0.0, kind
        if size < MOST.get(kind, np.inf):
            assert least(1.02) <= 0.0, kind


@pytest.mark.parametrize("how", ["exact", "blended"])
def test_a_plan_says_what_it_bears(how: str) -> None:
    scenario = load_scenario("parallel-stacks")
    limits = replace(scenario.chain.pusher.limits, contact="dynamic")
    chain = replace(scenario.chain, pusher=replace(scenario.chain.pusher, limits=limits))
    stability = replace(scenario.stability, margin=0.05)
    scenario = replace(scenario, chain=chain, trajectory=how, stability=stability)
    result = plan(scenario, seed=1, time_limit=60.0, iterations=300)
    own = result.segments[0].contact_trajectory
    assert result.robustness == robustness_of(chain, own)
    assert result.robustness is not None
    for kind in ("floor_friction", "position", "angle"):
        size = getattr(result.robustness, kind)
        assert perturbed.least_at(chain, own, kind, 0.98 * size) > 0.0
        assert perturbed.least_at(chain, own, kind, 1.02 * size) <= 0.0


def test_a_box_pushed_straight_ahead_bears_no_friction_but_half_its_width(make_chain: ChainMaker) -> None:
    """No friction is asked for; the force passes through the box's middle, which stays in front of the plate."""
    robustness = robustness_along(make_chain.boxes(1), AHEAD, STILL)  # the plate is 0.2 m wide, the box 0.1 m
    assert robustness.contact_friction == pytest.approx(0.0, abs=1e-12)
    assert robustness.floor_friction == robustness.load == MOST_SHARE
    assert robustness.position == pytest.approx(0.1, rel=1e-6)


def test_a_motion_that_loses_a_contact_as_stated_bears_nothing(make_chain: ChainMaker) -> None:
    chain = make_chain.boxes(2, contact_friction=0.1)
    robustness = robustness_along(chain, np.array([[0.1, 0.02, 0.0]]), STILL)
    assert robustness == USED_UP
    assert (
        robustness.sentence
        == "tolerates nothing: once inertia counts, a contact does not hold even with nominal numbers"
    )


@pytest.mark.parametrize(
    "support",
    [UnknownSupport, lambda outline: FeetSupport(outline, center_of_mass=np.zeros(2))],
    ids=["unknown", "feet"],
)
def test_nothing_is_said_where_loads_are_not_known(make_chain: ChainMaker, support: object) -> None:
    assert callable(support)
    robustness = robustness_of(make_chain.boxes(2, support=support), _straight())
    assert robustness == Robustness()
    assert robustness.sentence == "not known, as the loads on the floor are not"


def _straight() -> Trajectory:
    coefficients = np.zeros((1, 3, 3))
    coefficients[0, 0, 0] = 0.1
    return Trajectory(np.zeros(3), np.array([0.0, 1.0]), coefficients, np.zeros(1))
