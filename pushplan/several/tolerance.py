"""What several pushes can bear: the least of what any one of them can."""

from __future__ import annotations

from dataclasses import fields

from pushplan.plans.segment import Segment, trajectory_of
from pushplan.plans.trajectory import Trajectory
from pushplan.several.modes import Mode
from pushplan.several.segments import mode_of
from pushplan.sim.robustness.tolerance import Tolerance
from pushplan.sim.robustness.work_out import tolerance_of


def least_tolerance(segments: tuple[Segment, ...], whole: Trajectory, modes: tuple[Mode, ...]) -> Tolerance:
    """Return what all pushes of a plan can bear.

    Args:
        segments: With their times.
        whole: The trajectory through all of them.
        modes: The contacts.
    """
    each = [
        tolerance_of(mode_of(push, modes).scenario.chain, trajectory_of(push, whole))
        for push in segments
        if push.pushes
    ]
    if not all(one.known for one in each):
        return Tolerance()
    # A contact friction is the factor down to which it may go; all others are what may be off.
    numbers = {field.name: [getattr(one, field.name) for one in each] for field in fields(Tolerance)}
    return Tolerance(
        **{name: (max if name == "contact_friction" else min)(found) for name, found in numbers.items()}
    )
