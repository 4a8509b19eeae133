"""One run of a suite, from scenario to validated execution, and its outcome.

The validation checks contacts, margins, goal and collisions of the execution, independently of the planner.
"""

from __future__ import annotations

import os
import resource
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pushplan.bench.suite import RunSpec
from pushplan.errors import EmptyStableSetError, PlanningError
from pushplan.geometry.se2 import compose, inverse
from pushplan.mechanics.chain import Body, BodyKind
from pushplan.planners.clearance import Motion, Moving, Room, Standing
from pushplan.planners.validator import Validator
from pushplan.plans.execution import Execution
from pushplan.plans.plan import Plan
from pushplan.plans.run import Run
from pushplan.run import run
from pushplan.scenario.model import Scenario
from pushplan.util.names import AUTO
from pushplan.util.stopwatch import Stopwatch

OK = "ok"
NO_PLAN = "no plan"
INVALID = "invalid"
CRASH = "crash"
TIMEOUT = "timeout"
OUT_OF_MEMORY = "out of memory"
ERROR = "error"

STATUSES = (OK, NO_PLAN, INVALID, CRASH, TIMEOUT, OUT_OF_MEMORY, ERROR)
"""Possible outcomes of a run. `invalid` means that the planner's path fails the validation."""

BROKEN = (CRASH, TIMEOUT, OUT_OF_MEMORY, ERROR)
"""Outcomes of runs that did not finish; they do not count for or against the planner."""

ATTRIBUTES = {
    "time": "REAL",  # of the search
    "solved": "BOOLEAN",
    "status": "ENUM",
    "correct_solution": "BOOLEAN",  # the planner's path passes the validation
    "seed": "INTEGER",
    "first_solution_time": "REAL",
    "solution_length": "REAL",  # path cost, m
    "lower_bound": "REAL",  # of the quantity that ranked the plan: cost, m, or duration, s
    "solution_segments": "INTEGER",  # arcs
    "solution_clearance": "REAL",  # smallest distance of the moving bodies from obstacles and walls, m
    "solution_difference": "REAL",  # goal error after execution, m
    "goal_angle_error": "REAL",
    "margin": "REAL",  # lower limit of the path's margins, which `auto` can reduce
    "undelivered": "INTEGER",  # objects that a partial plan leaves out
    "min_margin": "REAL",  # during execution
    "min_dynamic_margin": "REAL",  # during execution, with inertia
    "trial_success": "REAL",  # share of Monte Carlo samples (with slip) in which the plan arrives
    "duration": "REAL",  # of the trajectory
    "by_time": "BOOLEAN",  # time ranked the plan, not cost
    "extensions": "INTEGER",  # iterations; OMPL's planners count only propagated arcs
    "memory": "REAL",  # peak memory of the process beyond its code and kernels, MB
    "posing_time": "REAL",
    "timing_time": "REAL",
    "execution_time": "REAL",
    "logging_time": "REAL",
    "validation_time": "REAL",
    "trials_time": "REAL",
    "overhead_time": "REAL",  # reading the scenario, starting and ending the process
    "total_time": "REAL",  # from the start of the process to its end
}
"""Measured quantities of a run with Planner Arena's types, in s, m and rad; OMPL's names have OMPL's meaning."""

LOG = "run.mcap"
"""Name of the run's log in the run's folder."""

Value = float | int | None


@dataclass(frozen=True)
class Outcome:
    """Outcome of a run.

    Attributes:
        key: Key of the run.
        status: Status, one of `STATUSES`.
        message: Reason; its first line is a summary.
        values: Measured quantities by name in `ATTRIBUTES`; missing names were not measured.
        arcs: Twist (vx, vy, omega) and length of each arc.
        progress: Time (s), best cost (m) and iterations of each improvement.
        log: Bytes of the run log, possibly incomplete, or None.
        whole: Whether the log is complete.
        host: Name of the machine.
        cpu: Model of its processor.
    """

    key: str
    status: str
    message: str = ""
    values: Mapping[str, Value] = field(default_factory=dict)
    arcs: tuple[tuple[float, float, float, float], ...] = ()
    progress: tuple[tuple[float, float, int], ...] = ()
    log: bytes | None = None
    whole: bool = False
    host: str = ""
    cpu: str = ""


def perform(spec: RunSpec, folder: Path) -> Outcome:
    """Plan, time, execute, log and validate one push.

    Args:
        spec: Inputs of the run.
        folder: Folder of the log.

    Raises:
        PushplanError: If the problem cannot be read or posed.
    """
    watch, base, planner = Stopwatch(), resident_megabytes(), spec.planner
    with watch("loading"):
        scenario = spec.problem.scenario()
    try:
        done = run(
            scenario,
            log=folder / LOG,
            planner=planner.name,
            stable_set=spec.stable_set,
            seed=spec.seed,
            time_limit=planner.time,
            first=planner.first,
            iterations=planner.iterations,
            cost=planner.cost,
            gap=planner.gap,
        )
    except (PlanningError, EmptyStableSetError) as error:
        memory = peak_megabytes() - base
        return Outcome(spec.key, NO_PLAN, str(error), {"memory": memory, **_seconds(watch.seconds)})
    success = _trial_success(done, spec, watch) if spec.trials else None
    found = validated(spec.key, scenario, done, watch)
    memory = peak_megabytes() - base
    values = {**found.values, "trial_success": success, "memory": memory}
    return Outcome(spec.key, found.status, found.message, values, found.arcs, found.progress)


def _trial_success(done: Run, spec: RunSpec, watch: Stopwatch) -> float | None:
    """Return the share of Monte Carlo samples in which a plan arrives; None without a plan or known loads."""
    known = all(load.chain.loads_known for load in done.scenario.loads)
    if done.plan.trajectory is None or not known:
        return None
    with watch("trials"):
        from pushplan.sim.trials import execute_trials  # imported late: most suites have no trials

        return execute_trials(done.plan, spec.trials, seed=spec.seed, jobs=1).success


def validated(key: str, scenario: Scenario, done: Run, watch: Stopwatch) -> Outcome:
    """Validate an execution and return its outcome, without memory and trials."""
    plan, execution = done.plan, done.execution
    with watch("validation"):
        reason, free = plan.reason, None
        if execution is not None:
            reason = validation_error(plan, execution)
            free = clearance(scenario, execution)
    partial = bool(plan.undelivered) and not reason
    reason = plan.reason if partial else reason
    found = not partial and (plan.solved or plan.first_solution_s is not None)
    valid = plan.solved and not reason
    arcs = [
        (*twist, length)
        for push in plan.pushes
        for twist, length in zip(push.contact_path.twists.tolist(), push.contact_path.lengths.tolist(), strict=True)
    ]
    values: dict[str, Value] = {
        "correct_solution": int(valid) if found else None,
        "first_solution_time": plan.first_solution_s,
        "lower_bound": plan.lower_bound,
        "margin": plan.margin,
        "undelivered": len(plan.undelivered),
        "extensions": plan.iterations,
        **_seconds({**watch.seconds, **done.seconds}),
    }
    if plan.cost is not None:
        values |= {"solution_length": plan.cost, "solution_segments": len(arcs)}
        values["by_time"] = int(plan.objective == "time")
    if plan.trajectory is not None:
        values["duration"] = plan.trajectory.duration
    if execution is not None:
        values |= {
            "solution_clearance": free,
            "solution_difference": execution.goal_error[0],
            "goal_angle_error": execution.goal_error[1],
            "min_margin": execution.min_margin,
            "min_dynamic_margin": execution.min_dynamic_margin,
        }
    return Outcome(
        key,
        OK if valid else INVALID if found else NO_PLAN,
        reason,
        values,
        tuple(arcs),
        tuple((one.seconds, one.cost, one.iterations) for one in plan.improvements),
    )


def _seconds(seconds: Mapping[str, float]) -> dict[str, Value]:
    """Return the wall-clock times of the phases in `ATTRIBUTES`, s."""
    named = {"time" if phase == "search" else f"{phase}_time": spent for phase, spent in seconds.items()}
    return {name: spent for name, spent in named.items() if name in ATTRIBUTES}


def resident_megabytes() -> float:
    """Return the resident set of this process, MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def peak_megabytes() -> float:
    """Return the peak resident set of this process, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6


CLEARANCE_SPACING = 0.01
"""Largest motion of any point of a body between two measurements of the clearance, m."""

COARSE = 16
"""Step of the first pass over these poses, which gives a bound on the distance."""


def validation_error(plan: Plan, execution: Execution) -> str:
    """Return why an execution fails the validation; empty if it passes.

    Args:
        plan: Plan with the margin that it claims to keep.
        execution: Execution of the plan.
    """
    scenario = plan.scenario
    stated = scenario.stability.margin
    required = max(plan.margin or 0.0, 0.0 if stated == AUTO else stated)  # a plan cannot lower a given margin
    if execution.min_margin is not None and execution.min_margin <= required:
        return f"the smallest margin is {execution.min_margin:.3g}; it must be above {required:g}"
    if scenario.pusher.limits.contact == "dynamic":
        smallest = execution.min_dynamic_margin
        if smallest is None:
            return "the execution has no margins with inertia"
        if smallest <= 0.0:
            return f"the smallest margin with inertia is {smallest:.3g}; it must be above 0"
    position, angle = execution.goal_error
    goals = [goal for goals in scenario.goals.values() for goal in goals]
    allowed = min(goal.position_tolerance for goal in goals), min(goal.angle_tolerance for goal in goals)
    if not (position <= allowed[0] and angle <= allowed[1]):
        return f"the goal is missed by {position:.2g} m and {angle:.2g} rad"
    return Validator(scenario).flaw(plan.segments, execution, plan.stable_set)


def clearance(scenario: Scenario, execution: Execution) -> float | None:
    """Return the smallest distance (m) of the moving bodies from obstacles and walls during an execution.

    It is None without obstacles and walls. It is measured at poses `CLEARANCE_SPACING` apart, so the true distance
    can be smaller by up to half of that.
    """
    if not scenario.obstacles and scenario.workspace is None:
        return None
    chain = scenario.loads[0].chain
    moving = [(compose(execution.poses, inverse(chain.pusher.plate_pose)), chain.carried)]
    outlines = {obj.name: obj.outline for obj in scenario.objects}
    for k, name in enumerate(execution.names):
        moving.append((execution.objects[:, k], (Body(name, BodyKind.OBJECT, outlines[name]),)))
    standing, smallest = Standing.of(scenario.obstacles), np.inf
    for poses, bodies in moving:
        reach = max(float(np.linalg.norm(body.outline, axis=1).max()) for body in bodies)
        motion, room = Motion.through(poses, reach), Room((Moving.of(bodies),), scenario.workspace, standing)
        some = motion.at(np.append(np.arange(0.0, motion.travel[-1], CLEARANCE_SPACING), motion.travel[-1]))
        for sampled in (some[::COARSE], some):
            smallest = float(room.gaps(sampled, smallest).min())
    return smallest
