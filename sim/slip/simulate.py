"""Execute a trajectory in a world whose contacts may slip."""

from __future__ import annotations

import numpy as np

from pushplan.errors import PushplanError
from pushplan.plans.trajectory import Trajectory
from pushplan.sim.slip.report import SlipReport
from pushplan.sim.slip.settings import SlipSettings
from pushplan.sim.slip.simulator import DEFAULTS, SlipSimulator, steps_of
from pushplan.sim.worlds.world import World
from pushplan.util.arrays import FloatArray


def simulate(trajectory: Trajectory, world: World, settings: SlipSettings = DEFAULTS) -> SlipReport:
    """Execute a trajectory quasi-statically: contacts stick, slide, roll off an end, open and close again.

    Inertia is left out, as in all of the plan's mechanics without `contact: dynamic`: only the path counts, not how
    fast it is driven; times are the trajectory's.

    Args:
        trajectory: What the plate is made to do.
        world: What it meets; it need not be what the plan believes.
        settings: See there.

    Raises:
        PushplanError: When `world` is no `World`, or more bodies touch at once than there is room for.
        SupportError: When the load under an object is not known, or it has no friction with the floor.
    """
    if not isinstance(world, World):
        raise PushplanError(
            f"simulate takes a World, not {type(world).__name__}: World.from_scenario(scenario) makes one "
            f"(the rigid chain that stops where a contact fails is simulate_rigid)"
        )
    t = step_times(trajectory, world.chain.reach, settings.step)
    return simulate_poses(t, trajectory.poses_at(t), world, settings)


def simulate_poses(
    t: FloatArray, poses: FloatArray, world: World, settings: SlipSettings = DEFAULTS
) -> SlipReport:
    """Move the plate through poses (m + 1, 3) of the chain frame in the world at times `t`, one step between two."""
    simulator = SlipSimulator(world, poses[0], settings)
    trace = simulator.follow(steps_of(poses))
    done = len(trace.end) - simulator.jammed
    return SlipReport(
        world=world,
        settings=settings,
        t=t[: done + 1],
        poses=poses[: done + 1],
        object_poses=np.concatenate([world.object_poses[None], trace.poses[:done]]),
        modes=trace.modes[:done],
        forces=trace.forces[:done],
        wrenches=trace.wrenches[:done],
        others=trace.others[:done],
        residual=trace.residual[:done],
        end=trace.end,
        switched=trace.switched[:done],
        jammed_at=float(t[done]) if simulator.jammed else None,
    )


def step_times(trajectory: Trajectory, reach: float, step: float) -> FloatArray:
    """Return times (m + 1,) between which no point within `reach` of the plate's reference moves by more than `step`.

    Where one arc goes over into the next is one of them: a step has one twist. Times at rest are left out.
    """
    arc_ends = trajectory.breaks[
        np.append(np.flatnonzero(np.diff(trajectory.arc)) + 1, len(trajectory.breaks) - 1)
    ]
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
    times[np.cumsum([len(part) for part in found[1:]])] = arc_ends  # not where rounding puts them
    return np.asarray(times[np.append(True, np.diff(times) > 0.0)])
