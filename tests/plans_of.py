"""Scenarios without defaults and hand-made plans, for tests of searches and timing."""

from dataclasses import replace

import numpy as np

import pushplan
from pushplan.mechanics.chain import Chain
from pushplan.planners.timing.blending import time_segments
from pushplan.plans.load import Load
from pushplan.plans.path import PushPath
from pushplan.plans.plan import Plan
from pushplan.plans.segment import Segment
from pushplan.plans.trajectory import SAMPLE_RATE, Trajectory
from pushplan.scenario.goals import Goal
from pushplan.scenario.model import Scenario


def push_of(chain: Chain, trajectory: Trajectory) -> Plan:
    """Return the plan of one push on an empty floor to the end of a path."""
    end = trajectory.break_poses[-1]
    scenario = pushplan.load_scenario("one-box")
    load = replace(scenario.load, chain=chain, start=trajectory.start, contact_friction=None)
    scenario = replace(scenario.push_of(load, Goal.of_chain(end, (1e-3, 1e-2))), obstacles=(), workspace=None)
    path = PushPath(trajectory.start, np.array([[1.0, 0.0, 0.0]]), np.array([1.0]))
    push = Segment.push(Load.of(scenario), path, scenario.poses, 0.0)
    push = replace(push, trajectory=trajectory.of_frame(chain.pusher.plate_pose))
    return Plan(scenario, (push,), "", "by hand", "ecof", 1)


def timed(scenario: Scenario, path: PushPath, stable_set: str | None = None, rate: float = SAMPLE_RATE) -> Trajectory:
    """Return a path of the chain frame as a trajectory of the chain frame, with the scenario's timing."""
    push = Segment.push(Load.of(scenario), path, scenario.poses, scenario.required_margin)
    return time_segments(scenario, (push,), rate, stable_set)[0].contact_trajectory


ARC_PRICE = 0.002
"""Cost of an arc beside its length, m."""


def plain(scenario: Scenario) -> Scenario:
    """Return a scenario ranked by travel, with a margin of 0, quasi-static contacts and exact timing.

    Its paths are the hardest to time: few metres, sharp corners, twists on the boundary of the stable set.
    """
    pusher, stated = scenario.chain.pusher, scenario.load.stated["pusher"]
    limits = replace(pusher.limits, contact="quasi-static")
    words = {**stated, "limits": {**stated["limits"], "contact": "quasi-static"}}
    chain = replace(scenario.chain, pusher=replace(pusher, limits=limits))
    ranked = scenario.with_margin(0.0).with_planner(cost="travel", arc_price=ARC_PRICE)
    ranked = ranked.with_load(chain=chain, stated={**scenario.load.stated, "pusher": words})
    return replace(ranked, trajectory="exact")


def load_plain(name: str) -> Scenario:
    """Return a packaged scenario, made `plain`."""
    return plain(pushplan.load_scenario(name))
