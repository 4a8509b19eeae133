"""What planning and running a push return."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from pushplan.arrays import FloatArray
from pushplan.path import PushPath
from pushplan.trajectory import Trajectory

if TYPE_CHECKING:
    from pushplan.scenario import Scenario
    from pushplan.sim.kinematic import Execution


@dataclass(frozen=True)
class ProgressPoint:
    """The cost (m) of the best path known after `seconds` of planning (wall clock)."""

    seconds: float
    cost: float
    iterations: int


@dataclass(frozen=True, eq=False)
class PlanResult:
    """The outcome of planning.

    Attributes:
        solved: A path to the goal was found and passed the independent checker.
        reason: Why not, in words; empty when solved.
        planner: Name of the planner that ran.
        stable_set: Name of the stable set that limited the controls.
        seed: Of the random numbers.
        path: The path found; None when not solved.
        trajectory: The timed path; None when not solved.
        first_solution_s: Wall-clock seconds to the first path, or None.
        planning_s: Wall-clock seconds spent planning.
        progress: Cost of the best path over time.
        extensions: Number of arcs propagated.
        min_margin: Smallest margin along the path, or None.
        tree: (q, 2, 3) poses at both ends of the search tree's branches, thinned.
    """

    solved: bool
    reason: str
    planner: str
    stable_set: str
    seed: int
    path: PushPath | None
    trajectory: Trajectory | None
    first_solution_s: float | None
    planning_s: float
    progress: tuple[ProgressPoint, ...]
    extensions: int
    min_margin: float | None
    tree: FloatArray


@dataclass(frozen=True, eq=False)
class Run:
    """A plan, its execution and the log of both.

    Attributes:
        scenario: What was asked.
        plan: What was planned.
        execution: What the simulator made of it; None when there was nothing to execute.
        log: The log file, or None.
        seconds: Wall-clock time by phase: `posing`, `search`, `timing`, `checking`, `execution`, `logging`; s.
    """

    scenario: Scenario
    plan: PlanResult
    execution: Execution | None
    log: Path | None
    seconds: Mapping[str, float] = field(default_factory=dict)
