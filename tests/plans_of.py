"""Plans made by hand: of one push of a chain along a path or a trajectory."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import pushplan
from pushplan.mechanics.chain import Chain
from pushplan.plans.path import PushPath
from pushplan.plans.plan import Load, Plan, Segment
from pushplan.plans.trajectory import Trajectory
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
