"""Results of the older planning calls as plans; goes with them."""

from __future__ import annotations

from dataclasses import replace

from pushplan.geometry import se2
from pushplan.plans.plan import Load, Plan, Segment
from pushplan.plans.result import PlanResult
from pushplan.plans.segment import trajectory_of
from pushplan.scenario.model import Scenario


def as_plan(scenario: Scenario, result: PlanResult) -> Plan:
    """Return what was planned for one load as a plan."""
    segments: tuple[Segment, ...] = ()
    if result.segments and result.trajectory is not None:
        segments = _several(scenario, result)
    elif result.path is not None:
        load = Load.of(scenario)
        push = Segment.push(load, result.path, scenario.poses, result.margin or 0.0)
        own = result.trajectory
        timed = None if own is None else own.of_frame(scenario.chain.pusher.plate_pose)
        segments = (replace(push, trajectory=timed, min_margin=result.min_margin),)
    reason = result.reason or ("" if segments else "no plan was found")
    cost = result.objective_cost if result.path is None or result.segments else result.path.cost
    return Plan(scenario, segments, reason, result.planner, result.stable_set, result.seed, cost)


def _several(scenario: Scenario, result: PlanResult) -> tuple[Segment, ...]:
    from pushplan.several.modes import find_modes
    from pushplan.several.segments import mode_of

    assert result.trajectory is not None
    modes, plate = find_modes(scenario, result.stable_set), scenario.chain.pusher.plate_pose
    found = []
    for old in result.segments:
        load = mode_of(old, modes).contact_mode.load if old.face else None
        frame = se2.compose(old.robot, plate)
        before, after = (
            {obj.name: se2.compose(pose, obj.pose_chain) for obj in scenario.chain.objects}
            for pose in (old.load_before, old.load_after)
        )
        timed = trajectory_of(old, result.trajectory).of_frame(frame)
        path = old.path.of_frame(frame)
        found.append(Segment(old.kind, path, before, after, load, old.margin, timed))
    return tuple(found)
