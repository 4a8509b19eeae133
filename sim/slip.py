"""Quasi-static execution of plans in a world where contacts can slip: the path counts, the speed does not.

Inertia is left out, as in the plan's mechanics without `contact: dynamic`. Times are those of the trajectory.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.plans.plan import Plan
from pushplan.plans.trajectory import Trajectory
from pushplan.sim.report import ContactReport, Mode, Part, first_closed, report_of, wanted_at_end, with_margins
from pushplan.slip.simulator import STEP, SlipSimulator
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray
from pushplan.util.names import APPROACH, CLOSE

SETTLED = 0.9
"""Share of the first arc of a push after an approach, by whose end the contacts should be closed."""


def simulate(plan: Plan, world: World, step: float = STEP) -> ContactReport:
    """Execute a plan in a world: contacts stick, slide, roll about an end, open and close again.

    Objects that nothing touches stay at rest.

    Args:
        plan: Timed plan.
        world: World of the execution; it can differ from the plan's scenario.
        step: Largest motion of the fastest corner in a step, m.

    Raises:
        PushplanError: If `world` is not a `World`, the plan has no trajectory, or too many bodies touch at once.
        SupportError: If the load under an object is not known, or the object has no friction with the floor.
    """
    return with_margins(slip(plan, world, step), plan)


def slip(plan: Plan, world: World, step: float = STEP) -> ContactReport:
    """Execute a plan like `simulate`, but without margins and goal errors, which take more time.

    Raises:
        PushplanError: As in `simulate`.
        SupportError: As in `simulate`.
    """
    if not isinstance(world, World):
        raise PushplanError(
            f"simulate needs a World, not {type(world).__name__}; World.from_scenario(scenario) makes one"
        )
    world.require(plan.scenario)
    if plan.trajectory is None:
        raise PushplanError(f"there is no plan to execute: {plan.reason or 'it is not timed'}")
    parts, ended = list[Part](), dict[str, float]()
    simulator = SlipSimulator(world, step=step)
    for k in range(len(plan.segments)):
        part, ended = _executed(simulator, plan, k)
        parts.append(part)
        if ended:
            break
    wanted = wanted_at_end(plan, parts[-1], world.names)
    return report_of(world.names, parts, wanted, **ended)


def _executed(simulator: SlipSimulator, plan: Plan, k: int) -> tuple[Part, dict[str, float]]:
    """Execute segment k, starting at the current poses; return values as in `_moved`."""
    segment, world = plan.segments[k], simulator.world
    load, alone = segment.load, world.plate is not None
    trajectory = segment.contact_trajectory
    if alone:
        simulator.hold(None if load is None else world.pushed(load.chain))
    t = step_times(trajectory, simulator.reach, simulator.step)
    poses = trajectory.poses_at(t)
    simulator.place(simulator.object_poses, poses[0])
    part, ended = _moved(simulator, t + plan.times[k], poses, k)
    part = replace(part, touched=segment.touched)
    if not segment.pushes or part.chain is None:
        return replace(part, chain=None), ended
    begin = 0
    if k and plan.segments[k - 1].kind in (APPROACH, CLOSE):
        way = segment.contact_path.lengths[0] * SETTLED
        gone = np.hypot(*(part.frame[:, :2] - part.frame[0, :2]).T)
        begin = min(int(np.searchsorted(gone, way)), len(t) - 1)
    if not alone and not world.offsets.any():
        return part, ended
    motions = part.motions(world.names)
    return replace(part, base=first_closed(part.chain, motions, begin)), ended


def _moved(
    simulator: SlipSimulator, t: FloatArray, poses: FloatArray, segment: int = 0
) -> tuple[Part, dict[str, float]]:
    """Move the plate through poses (m + 1, 3) at times (m + 1,), one step between two poses.

    Returns:
        The executed part, and the time of a jam or stall, s, by its name in a report (empty without one). The step of
        a jam or stall has no motion and is left out.
    """
    before = simulator.object_poses
    trace = simulator.follow(steps_of(poses))
    done, ended = len(trace.end), dict[str, float]()
    if simulator.jammed or simulator.stalled:
        ended["jammed_at" if simulator.jammed else "stalled_at"] = float(t[done])
        done -= 1
    modes = trace.modes[:done]
    part = Part(
        segment,
        simulator.chain,
        t[: done + 1],
        poses[: done + 1],
        simulator.plate_in_frame,
        np.concatenate([before[None], trace.poses[:done]]),
        modes=np.full_like(modes, Mode.UNKNOWN) if simulator.chain is None else modes,
        wrenches=trace.wrenches[:done],
    )
    return part, ended


def simulate_poses(t: FloatArray, poses: FloatArray, world: World) -> ContactReport:
    """Move a plate that is in contact through poses (m + 1, 3) of the chain frame, one step between two poses.

    Raises:
        PushplanError: If too many bodies touch at once.
        SupportError: If the load under an object is not known, or the object has no friction with the floor.
    """
    part, ended = _moved(SlipSimulator(world, poses[0]), t, poses)
    if world.offsets.any():
        part = replace(part, base=first_closed(world.chain, part.motions(world.names)))
    wanted = se2.compose(part.frame[-1], world.chain.places)
    return report_of(world.names, (part,), wanted, **ended)


def step_times(trajectory: Trajectory, reach: float, step: float) -> FloatArray:
    """Return times (m + 1,) between which no point within `reach` of the plate's reference moves by more than `step`.

    The ends of arcs are among them, because a step has one twist. Times at rest are left out.
    """
    arc_ends = trajectory.breaks[np.append(np.flatnonzero(np.diff(trajectory.arc)) + 1, len(trajectory.breaks) - 1)]
    fine = np.union1d(trajectory.t, trajectory.breaks)
    twists = trajectory.twists_at(fine)
    rate = np.hypot(twists[:, 0], twists[:, 1]) + reach * np.abs(twists[:, 2])
    peak = np.maximum(rate[:-1], rate[1:])
    way = np.concatenate([[0.0], np.cumsum(peak * np.diff(fine))])
    ends = np.concatenate([[0.0], arc_ends])
    found = [np.zeros(1)]
    for begin, end in zip(*(np.interp(part, fine, way) for part in (ends[:-1], ends[1:])), strict=True):
        count = max(1, int(np.ceil((end - begin) / step)))
        marks = begin + (end - begin) * (np.arange(count) + 1.0) / count
        found.append(np.interp(marks, way, fine))
    times = np.concatenate(found)
    times[np.cumsum([len(part) for part in found[1:]])] = arc_ends  # exactly, without rounding errors
    return np.asarray(times[np.append(True, np.diff(times) > 0.0)])


def steps_of(poses: FloatArray) -> FloatArray:
    """Return the body twists times time (m, 3) between neighbours of poses (m + 1, 3)."""
    return se2.log(se2.relative(poses[:-1], poses[1:]))
