"""The metadata of a run log: who wrote it, from what, and how it ended."""

from __future__ import annotations

import hashlib
import os
import platform
from collections.abc import Mapping
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import distribution
from pathlib import Path

from pushplan.plans.execution import Execution
from pushplan.plans.result import PlanResult
from pushplan.scenario.model import Scenario

FORMAT = 1
"""Version of the log's format: raised when an older reader would misunderstand a newer file."""

RUN = "pushplan.run"
PLANNING = "pushplan.planning"
PROGRESS = "pushplan.progress"
"""Followed by `.0000`, `.0001`, ...: what /planner/progress leaves out of improvements logged when found."""
RESULT = "pushplan.result"
RECOVERY = "pushplan.recovery"
"""In logs that were written from a damaged one: its name, and what of it was lost."""

_DEPENDENCIES = ("numpy", "numba", "scipy", "shapely", "ompl", "ruckig", "mcap", "protobuf")


def run_words(scenario: Scenario, settings: Mapping[str, object]) -> dict[str, str]:
    """Return what is known when a run begins; `started_at` and `machine` differ from run to run."""
    return {
        **{name: str(value) for name, value in settings.items()},
        "format": str(FORMAT),
        "scenario": scenario.name,
        "scenario_sha256": hashlib.sha256(scenario.source).hexdigest(),
        **{f"version.{name}": version_of(name) for name in ("pushplan", *_DEPENDENCIES)},
        "version.python": platform.python_version(),
        "git": git_commit(),
        "machine": f"{platform.system()} {platform.release()} {platform.machine()}, {os.cpu_count()} CPUs",
        "started_at": now(),
    }


@cache
def version_of(package: str) -> str:
    """Return the version of an installed package, from the head of its metadata: parsing all of it takes long."""
    text = distribution(package).read_text("METADATA") or distribution(package).read_text("PKG-INFO") or ""
    return next((line[9:].strip() for line in text.splitlines() if line.startswith("Version: ")), "")


def now() -> str:
    """Return the wall-clock time, always in as many letters."""
    return datetime.now(UTC).isoformat(timespec="microseconds")


def git_commit() -> str:
    """Return the commit of the checkout that this package runs from, or an empty string."""
    git = Path(__file__).resolve().parents[3] / ".git"
    try:
        head = (git / "HEAD").read_text().strip()
        if not head.startswith("ref: "):
            return head
        reference = head.removeprefix("ref: ")
        loose = git / reference
        if loose.is_file():
            return loose.read_text().strip()
        packed = (line.split() for line in (git / "packed-refs").read_text().splitlines())
        return next((words[0] for words in packed if words[1:] == [reference]), "")
    except OSError:
        return ""


def plan_words(plan: PlanResult) -> dict[str, str]:
    """Return what a plan comes to."""
    words = {"solved": str(plan.solved).lower(), "reason": plan.reason}
    if plan.path is not None:
        words |= {"path_cost": repr(plan.path.cost), "arcs": str(len(plan.path.lengths))}
    if plan.margin is not None:
        words |= {"margin_asked": repr(plan.margin_asked), "margin": repr(plan.margin)}
    if plan.trajectory is not None:
        words["duration"] = repr(plan.trajectory.duration)
    return words


def execution_words(execution: Execution) -> dict[str, str]:
    """Return what an execution comes to."""
    position, angle = execution.goal_error
    words = {"goal_position_error": repr(position), "goal_angle_error": repr(angle)}
    if len(execution.t):
        words["min_margin"] = repr(execution.min_margin)
        if execution.min_dynamic_margin is not None:
            words["min_dynamic_margin"] = repr(execution.min_dynamic_margin)
    if execution.loss is not None:
        words |= {"lost_at": repr(execution.loss.time), "lost_contact": str(execution.loss.contact)}
    return words
