"""Whether a result is a solution: judged by code that the planners do not use."""

from __future__ import annotations

from pushplan.geometry.se2 import pose_error
from pushplan.planners.validation.clearance import Motion, Room, collision_along, excess
from pushplan.plans.execution import Execution
from pushplan.plans.path import PushPath
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray

EXACT = 1e-7
"""Largest error (m, rad) of a path's end that counts as reaching the goal pose."""


def verdict(
    scenario: Scenario,
    stable: StableSet,
    path: PushPath,
    trajectory: Trajectory,
    execution: Execution,
    room: Room | None = None,
) -> str:
    """Return why a path with its trajectory, executed, is no solution, empty if it is one."""
    motion = Motion.through(trajectory.poses, scenario.chain.reach)
    return (
        missed_goal(scenario, path)
        or lost_contact(scenario, execution)
        or excess(trajectory, scenario.chain.pusher.limits)
        or flaw_along(scenario, stable, path, motion, room)
    )


def path_verdict(scenario: Scenario, stable: StableSet, path: PushPath, room: Room | None = None) -> str:
    """Return why a path that is not timed is no solution, empty if it is one."""
    motion = Motion.along(path, scenario.chain.reach)
    return missed_goal(scenario, path) or flaw_along(scenario, stable, path, motion, room)


def missed_goal(scenario: Scenario, path: PushPath) -> str:
    """Return by how much a path misses the goal, empty if it does not."""
    error = pose_error(path.end, scenario.goal.pose_chain)
    if max(error) <= EXACT:
        return ""
    return f"the path misses the goal by {error[0]:.2g} m and {error[1]:.2g} rad"


def lost_contact(scenario: Scenario, execution: Execution) -> str:
    """Return where an execution loses a contact, empty if it does not."""
    loss = execution.loss
    if loss is None:
        return ""
    contact = scenario.chain.contact_name(loss.contact)
    return (
        f"the plan does not hold when it is executed: contact {contact} is lost after {loss.time:.2f} s, "
        f"with a margin of {loss.margin:.3g}"
    )


def flaw(scenario: Scenario, stable: StableSet, path: PushPath, poses: FloatArray) -> str:
    """Return why a path, driven through poses (m, 3), is not stable or not free; empty if it is both."""
    return flaw_along(scenario, stable, path, Motion.through(poses, scenario.chain.reach))


def flaw_along(
    scenario: Scenario, stable: StableSet, path: PushPath, motion: Motion, room: Room | None = None
) -> str:
    """Return why a path is not stable, or its motion not free; empty if it is both."""
    margin = float(stable.margin(path.twists).min())
    if margin <= scenario.required_margin:
        return f"the path's smallest margin is {margin:.3g}; it must be above {scenario.required_margin:g}"
    hit = collision_along(scenario, motion, room)
    if hit is not None:
        return f"the path is not free: {hit}; it must stay {1e3 * scenario.clearance:.3g} mm away"
    return ""
