"""Plans made by hand: of one push of a chain along a path or a trajectory."""

from dataclasses import replace

import numpy as np

import pushplan
from pushplan.mechanics.chain import Chain
from pushplan.planners.timing.segments import time_segments
from pushplan.plans.load import Load
from pushplan.plans.path import PushPath
from pushplan.plans.plan import Plan
from pushplan.plans.segment import Segment
from pushplan.plans.trajectory import SAMPLE_RATE, Trajectory
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import Goal


def push_of(chain: Chain, trajectory: Trajectory) -> Plan:
    """Return the plan of one push on an empty floor, its goal where it ends."""
    end = trajectory.break_poses[-1]
    scenario: Scenario = replace(
        pushplan.load_scenario("one-box"),
        chain=chain,
        start=trajectory.start,
        goal=Goal(end, None, end, 1e-3, 1e-2),
        obstacles=(),
        workspace=None,
        contact_friction=None,
    )
    path = PushPath(trajectory.start, np.array([[1.0, 0.0, 0.0]]), np.array([1.0]))
    push = Segment.push(Load.of(scenario), path, scenario.poses, 0.0)
    push = replace(push, trajectory=trajectory.of_frame(chain.pusher.plate_pose))
    return Plan(scenario, (push,), "", "by hand", "ecof", 1)


def timed(
    scenario: Scenario, path: PushPath, stable_set: str | None = None, rate: float = SAMPLE_RATE
) -> Trajectory:
    """Return a path of the chain frame timed as the scenario says; the trajectory is of the chain frame, too."""
    push = Segment.push(Load.of(scenario), path, scenario.poses, scenario.required_margin)
    return time_segments(scenario, (push,), rate, stable_set)[0].contact_trajectory
