"""What a run is given and what comes back from it, whatever happens to its process."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

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


@dataclass(frozen=True)
class Task:
    """One run as it is sent to the process that does it.

    Attributes:
        key: Of the run.
        name: Of the problem.
        source: Bytes of the scenario file.
        attachments: Bytes of the files that it refers to, by name.
        planner: Name of the planner.
        first: It stops at the first path.
        time_limit: Planning time, s, at most.
        iterations: Extensions and shortcuts, at most, or None.
        cost: What paths are ranked by, or None for the scenario's own.
        gap: Share above the lower bound that is good enough, or None likewise.
        stable_set: Name of the stable set.
        seed: Of the random numbers.
        seconds: Wall-clock time of the run, s, after which it is killed.
        megabytes: Memory that it may allocate, MB.
        version: Of the package that has to do it.
        trials: Number of sampled worlds that the plan is tried in.
    """

    key: str
    name: str
    source: bytes
    attachments: Mapping[str, bytes]
    planner: str
    first: bool
    time_limit: float
    iterations: int | None
    cost: str | None
    gap: float | None
    stable_set: str
    seed: int
    seconds: float
    megabytes: float
    version: str
    trials: int = 0


@dataclass(frozen=True)
class Figures:
    """What was measured in a run. SI units; None where there is nothing to measure.

    Attributes:
        reason: Why there is no plan, or why it is not valid; empty if it is.
        found: The planner claims a path to the goal.
        valid: The executed trajectory stands up to the checks of collision, margins and goal.
        first_solution_s: Time to the first path.
        seconds: Wall-clock time by phase: `loading` of the scenario, those of `pushplan.plans.result.Run`, and
            `validation` of the execution.
        path_cost: m.
        lower_bound: Cost that no path beats, m.
        arcs: Twist (vx, vy, omega) and length of each.
        clearance: Smallest distance of the moving bodies from anything, m.
        goal_position_error: After execution, m.
        goal_angle_error: After execution, rad.
        margin: What the margins of the path had to exceed in the end, which `auto` may lower.
        min_margin: Smallest margin during execution.
        min_dynamic_margin: The same with inertia.
        trial_success: Share of sampled worlds, with slip, in which the plan arrives.
        duration: Of the trajectory, s.
        extensions: Arcs propagated.
        memory: Most that the process has taken on top of the code and kernels that it starts with, MB.
        progress: Seconds, best cost, iterations of each improvement.
    """

    reason: str = ""
    found: bool = False
    valid: bool = False
    first_solution_s: float | None = None
    seconds: Mapping[str, float] = field(default_factory=dict)
    path_cost: float | None = None
    lower_bound: float | None = None
    arcs: tuple[tuple[float, float, float, float], ...] = ()
    clearance: float | None = None
    goal_position_error: float | None = None
    goal_angle_error: float | None = None
    margin: float | None = None
    min_margin: float | None = None
    min_dynamic_margin: float | None = None
    trial_success: float | None = None
    duration: float | None = None
    extensions: int | None = None
    memory: float | None = None
    progress: tuple[tuple[float, float, int], ...] = ()

    @property
    def status(self) -> str:
        """How a run with these figures has ended."""
        if self.found:
            return OK if self.valid else INVALID
        return NO_PLAN


@dataclass(frozen=True)
class Outcome:
    """How a run ended.

    Attributes:
        key: Of the run.
        status: One of `STATUSES`.
        message: What there is to say about it; the first line is enough for a list.
        figures: What was measured; empty where the process did not live to tell.
        log: Bytes of the run log, or of what was written of it, or None.
        whole: The log is complete.
        seconds: Wall-clock time from the start of the process to its end, s.
        host: Name of the machine.
    """

    key: str
    status: str
    message: str
    figures: Figures = field(default_factory=Figures)
    log: bytes | None = None
    whole: bool = False
    seconds: float = 0.0
    host: str = ""
