"""How far numbers may be off on several pushes: the least of what any one of them tolerates."""

from __future__ import annotations

from pushplan.plans.robustness import Robustness
from pushplan.plans.segment import Segment, trajectory_of
from pushplan.plans.trajectory import Trajectory
from pushplan.several.modes import Mode
from pushplan.several.segments import mode_of
from pushplan.sim.robustness import robustness_of


def least_robustness(segments: tuple[Segment, ...], whole: Trajectory, modes: tuple[Mode, ...]) -> Robustness:
    """Return what all pushes of a plan tolerate.

    Args:
        segments: With their times.
        whole: The trajectory through all of them.
        modes: The contacts.
    """
    return Robustness.least_of(
        robustness_of(mode_of(push, modes).scenario.chain, trajectory_of(push, whole))
        for push in segments
        if push.pushes
    )
