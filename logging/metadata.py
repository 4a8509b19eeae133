"""Metadata of a run log: versions and settings of the run, and its outcome."""

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
"""Version of the log's format; logs with another version are refused.

A new topic, or a new field of a message, needs no new version: `schemas.Topic.since` states the revision of a topic,
and fields that a log lacks are not compared.
"""

RUN = "pushplan.run"
PLANNING = "pushplan.planning"
PROGRESS = "pushplan.progress"
"""Prefix of `.0000`, `.0001`, ...: data of each improvement that /planner/progress does not have."""
RESULT = "pushplan.result"
DIGEST = "sha256"
"""Field of `pushplan.result` with the digest of all metadata and attachments, see `Digest`."""
RECOVERY = "pushplan.recovery"
"""Metadata of a recovered log: the name of the damaged one, and its lost parts."""

_NONE = "none"

_DEPENDENCIES = ("numpy", "scipy", "shapely", "ompl", "ruckig", "mcap", "protobuf")


def versions() -> dict[str, str]:
    """Return the versions of pushplan, of the packages that affect its results, and of Python."""
    known = {name: version_of(name) for name in ("pushplan", *_DEPENDENCIES)}
    return {"python": platform.python_version(), **known}


def run_words(scenario: Scenario, settings: Mapping[str, object]) -> dict[str, str]:
    """Return the metadata of a run at its beginning; `started_at` and `machine` differ from run to run."""
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
    """Return the version of an installed package from the head of its metadata, because parsing all of it is slow."""
    text = distribution(package).read_text("METADATA") or distribution(package).read_text("PKG-INFO") or ""
    return next((line[9:].strip() for line in text.splitlines() if line.startswith("Version: ")), "")


def now() -> str:
    """Return the wall-clock time as a text of constant length."""
    return datetime.now(UTC).isoformat(timespec="microseconds")


def git_commit() -> str:
    """Return the commit of the checkout of this package, or an empty string."""
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
    """Return `number` as a text of fixed width that preserves every bit."""
    return f"{number:.17e}"


def settings_in(words: Mapping[str, str]) -> PlanSettings:
    """Return the settings in `pushplan.run` that are not in the scenario: cost and margin.

    Raises:
        ValueError: If the margin is not a number.
        PlanningError: If a setting is invalid.
    """
    margin = words.get("margin", _NONE)
    chosen: Any = None if margin == _NONE else margin if margin == AUTO else float(margin)
    return PlanSettings(cost=words.get("cost"), margin=chosen)


def planning_words(plan: Plan) -> dict[str, str]:
    """Return the planning effort, the only part of a plan that differs between runs with the same seed."""
    first = plan.first_solution_s
    return {
        "planning_s": exact(plan.planning_s),
        "first_solution_s": _NONE if first is None else exact(first),
        "iterations": f"{plan.iterations:012d}",
    }


def without_clock(plan: Plan) -> Plan:
    """Return a plan without its planning effort."""
    return replace(plan, planning_s=math.nan, first_solution_s=None, iterations=0)


def with_clock(plan: Plan, words: Mapping[str, str]) -> Plan:
    """Return a plan with its planning effort from `planning_words`.

    Raises:
        KeyError: If a field is missing.
        ValueError: If a field is not a number.
    """
    first = words["first_solution_s"]
    return replace(
        plan,
        planning_s=float(words["planning_s"]),
        first_solution_s=None if first == _NONE else float(first),
        iterations=int(words["iterations"]),
    )


def result_words(run: RecordedRun) -> dict[str, str]:
    """Return the metadata of the result that follow from plan and execution."""
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
    """Digest of a run's attachments and metadata; independent of their order, which other tools change."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []

    def add(self, name: str, data: bytes, kind: bytes = b"attachment") -> None:
        """Add the hash of an attachment: the lengths of kind, name and content, 8 bytes each, then all three."""
        parts = (kind, name.encode(), data)
        lengths = b"".join(len(part).to_bytes(8, "little") for part in parts)
        self._parts.append(hashlib.sha256(lengths + b"".join(parts)).digest())

    def add_words(self, name: str, words: Mapping[str, str]) -> None:
        """Add a metadata record as JSON with sorted fields, without the digest."""
        fields = {key: words[key] for key in sorted(words) if key != DIGEST}
        self.add(name, json.dumps(fields).encode(), b"metadata")

    def hexdigest(self) -> str:
        """Return the SHA-256 of the sorted SHA-256 digests of all added parts."""
        return hashlib.sha256(b"".join(sorted(self._parts))).hexdigest()
