"""One run of a suite from scenario to validated execution, and how it ended.

Executions are judged by contacts, margins, goal and collisions, whatever the planner claims.
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
"""How a run may end. `invalid`: a planner's path that does not stand up to the checks."""

BROKEN = (CRASH, TIMEOUT, OUT_OF_MEMORY, ERROR)
"""Of them, those that say nothing about the planner: the run did not get as far as it was to."""

ATTRIBUTES = {
    "time": "REAL",  # of the search
    "solved": "BOOLEAN",
    "status": "ENUM",
    "correct_solution": "BOOLEAN",  # the planner's path stands up to the checks
    "seed": "INTEGER",
    "first_solution_time": "REAL",
    "solution_length": "REAL",  # path cost, m
    "lower_bound": "REAL",  # of what ranked the plan: cost, m, or duration, s
    "solution_segments": "INTEGER",  # arcs
    "solution_clearance": "REAL",  # smallest distance of the moving bodies from anything, m
    "solution_difference": "REAL",  # goal error after execution, m
    "goal_angle_error": "REAL",
    "margin": "REAL",  # that the path had to keep in the end, which `auto` may lower
    "undelivered": "INTEGER",  # objects that a partial plan leaves out
    "min_margin": "REAL",  # during execution
    "min_dynamic_margin": "REAL",  # the same with inertia
    "trial_success": "REAL",  # share of sampled worlds, with slip, in which the plan arrives
    "duration": "REAL",  # of the trajectory
    "by_time": "BOOLEAN",  # duration ranked the plan, not cost
    "extensions": "INTEGER",  # iterations: OMPL's planners count arcs propagated only
    "memory": "REAL",  # most that the process has taken on top of the code that it starts with, MB
    "posing_time": "REAL",
    "timing_time": "REAL",
    "execution_time": "REAL",
    "logging_time": "REAL",
    "validation_time": "REAL",
    "trials_time": "REAL",
    "overhead_time": "REAL",  # reading the scenario, starting and ending the process
    "total_time": "REAL",  # from the start of the process to its end
}
"""What is measured in a run, with Planner Arena's types, in s, m and rad; names that OMPL has too mean the same."""

LOG = "run.mcap"
"""Name of the run's log in the run's folder."""

Value = float | int | None


@dataclass(frozen=True)
class Outcome:
    """How a run ended.

    Attributes:
        key: Of the run.
        status: One of `STATUSES`.
        message: What there is to say about it; the first line is enough for a list.
        values: What was measured, by name in `ATTRIBUTES`; what is left out was not.
        arcs: Twist (vx, vy, omega) and length of each arc.
        progress: Seconds, best cost, iterations of each improvement.
        log: Bytes of the run log, or of what was written of it, or None.
        whole: The log is complete.
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
        spec: What to do.
        folder: Where the log goes.

    Raises:
        PushplanError: When the problem cannot be read or posed.
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
    """Return the share of sampled worlds in which a plan arrives; None without a plan or known loads."""
    known = all(load.chain.loads_known for load in done.scenario.loads)
    if done.plan.trajectory is None or not known:
        return None
    with watch("trials"):
        from pushplan.sim.trials import execute_trials  # most suites do not ask for it

        return execute_trials(done.plan, spec.trials, seed=spec.seed, jobs=1).success


def validated(key: str, scenario: Scenario, done: Run, watch: Stopwatch) -> Outcome:
    """Validate an execution and return all that was measured but the memory and the trials."""
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
    """Return the wall-clock times of phases that have a name in `ATTRIBUTES`."""
    named = {"time" if phase == "search" else f"{phase}_time": spent for phase, spent in seconds.items()}
    return {name: spent for name, spent in named.items() if name in ATTRIBUTES}


def resident_megabytes() -> float:
    """Return the resident set of this process, MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def peak_megabytes() -> float:
    """Return the largest resident set that this process has had, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6


CLEARANCE_SPACING = 0.01
"""No point of a body moves farther than this between two poses at which the clearance is measured, m."""

COARSE = 16
"""Every so many of these poses is looked at first, for a bound on the distance."""


def validation_error(plan: Plan, execution: Execution) -> str:
    """Return why an execution does not solve what was asked, empty if it does.

    Args:
        plan: What was planned, with the margin that it says it kept.
        execution: Of it.
    """
    scenario = plan.scenario
    stated = scenario.stability.margin
    required = max(plan.margin or 0.0, 0.0 if stated == AUTO else stated)  # a plan may not lower what is stated
    if execution.min_margin is not None and execution.min_margin <= required:
        return f"the smallest margin is {execution.min_margin:.3g}; it must be above {required:g}"
    if scenario.pusher.limits.contact == "dynamic":
        smallest = execution.min_dynamic_margin
        if smallest is None:
            return "nobody looked at the margins with inertia"
        if smallest <= 0.0:
            return f"the smallest margin with inertia is {smallest:.3g}; it must be above 0"
    position, angle = execution.goal_error
    goals = [goal for goals in scenario.goals.values() for goal in goals]
    allowed = min(goal.position_tolerance for goal in goals), min(goal.angle_tolerance for goal in goals)
    if not (position <= allowed[0] and angle <= allowed[1]):
        return f"the goal is missed by {position:.2g} m and {angle:.2g} rad"
    return Validator(scenario).flaw(plan.segments, execution, plan.stable_set)


def clearance(scenario: Scenario, execution: Execution) -> float | None:
    """Return the smallest distance (m) of the moving bodies from obstacles and walls in an execution.

    None where there is nothing to keep clear of. Measured at poses `CLEARANCE_SPACING` apart, so the true one may be
    smaller by half of that at most.
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
        for looked in (some[::COARSE], some):
            smallest = float(room.gaps(looked, smallest).min())
    return smallest
