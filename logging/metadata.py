"""The metadata of a run log: who wrote it, from what, and how it ended."""

from __future__ import annotations

import hashlib
import json
import math
import os
import platform
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

import pushplan.logging.schemas as schemas
from pushplan.logging.recorded import RecordedRun
from pushplan.plans.plan import Plan
from pushplan.plans.settings import PlanSettings
from pushplan.scenario.model import Scenario
from pushplan.util.names import AUTO

FORMAT = 3
"""Version of the log's format; logs of others are refused.

A new topic, or a new field of a message, needs no new number: `schemas.Topic` says since when a topic is there, and
fields that a log lacks are not compared.
"""

RUN = "pushplan.run"
PLANNING = "pushplan.planning"
PROGRESS = "pushplan.progress"
"""Followed by `.0000`, `.0001`, ...: what /planner/progress leaves out of improvements logged when found."""
RESULT = "pushplan.result"
DIGEST = "sha256"
"""Field of `pushplan.result`: what all metadata and attachments of a run come to, see `Digest`."""
RECOVERY = "pushplan.recovery"
"""In logs that were written from a damaged one: its name, and what of it was lost."""

_NONE = "none"

_DEPENDENCIES = ("numpy", "scipy", "shapely", "ompl", "ruckig", "mcap", "protobuf")


def versions() -> dict[str, str]:
    """Return the versions of pushplan, of what its results depend on, and of Python."""
    known = {name: version_of(name) for name in ("pushplan", *_DEPENDENCIES)}
    return {"python": platform.python_version(), **known}


def run_words(scenario: Scenario, settings: Mapping[str, object]) -> dict[str, str]:
    """Return what is known when a run begins; `started_at` and `machine` differ from run to run."""
    return {
        **{name: str(value) for name, value in settings.items()},
        "format": str(FORMAT),
        "topics": str(schemas.REVISION),
        "scenario": scenario.name,
        "scenario_sha256": hashlib.sha256(scenario.source).hexdigest(),
        **{f"version.{name}": version for name, version in versions().items()},
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
    git = Path(__file__).resolve().parents[1] / ".git"
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


def exact(number: float) -> str:
    """Return `number` in a text of fixed width that gives it back bit for bit."""
    return f"{number:.17e}"


def settings_in(words: Mapping[str, str]) -> PlanSettings:
    """Return what `pushplan.run` says was asked for besides the scenario: what ranks plans, and the margin.

    Raises:
        ValueError: When the margin is no number.
        PlanningError: When there is no such setting.
    """
    margin = words.get("margin", _NONE)
    chosen: Any = None if margin == _NONE else margin if margin == AUTO else float(margin)
    return PlanSettings(cost=words.get("cost"), margin=chosen)


def planning_words(plan: Plan) -> dict[str, str]:
    """Return what planning took: the one part of a plan that two runs with the same seed do not share."""
    first = plan.first_solution_s
    return {
        "planning_s": exact(plan.planning_s),
        "first_solution_s": _NONE if first is None else exact(first),
        "iterations": f"{plan.iterations:012d}",
    }


def without_clock(plan: Plan) -> Plan:
    """Return a plan without what it took."""
    return replace(plan, planning_s=math.nan, first_solution_s=None, iterations=0)


def with_clock(plan: Plan, words: Mapping[str, str]) -> Plan:
    """Return a plan with what it took, as `planning_words` told it.

    Raises:
        KeyError: When a field is missing.
        ValueError: When one is not a number.
    """
    first = words["first_solution_s"]
    return replace(
        plan,
        planning_s=float(words["planning_s"]),
        first_solution_s=None if first == _NONE else float(first),
        iterations=int(words["iterations"]),
    )


def result_words(run: RecordedRun) -> dict[str, str]:
    """Return what a run comes to, as far as that follows from its plan and its execution."""
    words, numbers = dict[str, str](), dict[str, float | None]()
    if (plan := run.plan) is not None:
        words |= {**planning_words(plan), "solved": str(plan.solved).lower(), "reason": plan.reason}
        numbers |= {"path_cost": plan.cost, "duration": plan.duration}
        numbers |= {"margin_asked": plan.margin_asked, "margin": plan.margin}
        if plan.segments:
            words["arcs"] = str(sum(len(segment.path.lengths) for segment in plan.pushes))
    if (execution := run.execution) is not None:
        numbers |= dict(zip(("goal_position_error", "goal_angle_error"), execution.goal_error, strict=True))
        numbers |= {"min_margin": execution.min_margin, "min_dynamic_margin": execution.min_dynamic_margin}
        numbers["max_force"] = execution.max_force()
        if execution.loss is not None:
            words |= {"lost_at": repr(execution.loss.time), "lost_contact": execution.loss.contact}
    return words | {name: repr(value) for name, value in numbers.items() if value is not None}


class Digest:
    """The digest of a run's attachments and metadata; it does not depend on their order, which other tools change."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []

    def add(self, name: str, data: bytes, kind: bytes = b"attachment") -> None:
        """Add an attachment: the lengths of kind, name and content, 8 bytes each, and all three."""
        parts = (kind, name.encode(), data)
        lengths = b"".join(len(part).to_bytes(8, "little") for part in parts)
        self._parts.append(hashlib.sha256(lengths + b"".join(parts)).digest())

    def add_words(self, name: str, words: Mapping[str, str]) -> None:
        """Add metadata: JSON with sorted fields, without the digest."""
        told = {key: words[key] for key in sorted(words) if key != DIGEST}
        self.add(name, json.dumps(told).encode(), b"metadata")

    def hexdigest(self) -> str:
        """Return the SHA-256 of the sorted SHA-256 of all that was added."""
        return hashlib.sha256(b"".join(sorted(self._parts))).hexdigest()
