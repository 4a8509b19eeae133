"""A run as one web page that plays it: the chain from above, and every contact's margin over time.

The page holds everything it needs and asks the network for nothing.
"""

from __future__ import annotations

import html
import json
import math
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from pushplan.basics.arrays import FloatArray, IntArray
from pushplan.execution import Execution
from pushplan.logging.messages.recorded import RecordedRun
from pushplan.logging.view.scene import obstacle_outline
from pushplan.logging.view.views import viewed
from pushplan.logging.view.window import path_points, window
from pushplan.mechanics.chain import Chain
from pushplan.outputs.write import write_whole
from pushplan.result import PlanResult, Run
from pushplan.scenario import Scenario

MOST_SAMPLES = 5_000
"""Samples of an execution that the page holds, at most, beside the smallest margins."""

_DIGITS = 5


def write_html(run: Run | RecordedRun, path: Path | str) -> None:
    """Write the page of `run`.

    Raises:
        OutputError: When the file cannot be written.
    """
    write_whole(path, render(run).encode())


def render(run: Run | RecordedRun) -> str:
    """Return the page of `run`."""
    execution = _execution(run.scenario.chain, run.execution)
    data = {**_world(run.scenario), **_plan(run.plan), **execution, "window": window(run.scenario, run.plan)}
    text = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")  # no </script>
    page = files("pushplan.logging.export").joinpath("player.html").read_text(encoding="utf-8")
    return page.replace("@TITLE@", html.escape(f"{run.scenario.name} - pushplan")).replace("@RUN@", text)


def _world(scenario: Scenario) -> dict[str, Any]:
    chain, area = scenario.chain, scenario.workspace
    corners = [] if area is None else [(area.xmin, area.ymin), (area.xmax, area.ymin)]
    corners += [] if area is None else [(area.xmax, area.ymax), (area.xmin, area.ymax)]
    return {
        "name": scenario.name,
        "workspace": corners or None,
        "obstacles": [_plain(obstacle_outline(obstacle)) for obstacle in scenario.obstacles],
        "start": scenario.start.tolist(),
        "goal": scenario.goal.pose_chain.tolist(),
        "bodies": [
            {"name": body.name, "kind": body.kind.value, "outline": _plain(body.outline)}
            for body in chain.bodies
        ],
        "contacts": [
            {"name": chain.contact_name(k), "segment": _plain(np.stack([contact.right, contact.left]))}
            for k, contact in enumerate(chain.contacts)
        ],
    }


def _plan(plan: PlanResult | None) -> dict[str, Any]:
    if plan is None:
        return {"facts": ["the log ends before a plan"], "path": [], "tree": []}
    facts = [f"{plan.planner}, set {plan.stable_set}, seed {plan.seed}"]
    tree = _plain(plan.tree[:, :, :2].reshape(-1, 4))
    if plan.path is None:
        return {"facts": [*facts, plan.reason], "path": [], "tree": tree}
    facts.append(f"{len(plan.path.lengths)} arcs, cost {plan.path.cost:.3f} m")
    return {"facts": facts, "path": _plain(path_points(plan)), "tree": tree}


def _execution(chain: Chain, execution: Execution | None) -> dict[str, Any]:
    """Samples by column; margins, lambdas and forces by contact."""
    if execution is None or len(execution.t) == 0:
        nothing: dict[str, Any] = {"t": [], "margins": [[] for _ in chain.contacts], "forces": None}
        return {"samples": nothing, "margin_range": [-0.05, 1.0], "largest_force": 1.0}
    kept = _kept(execution)
    poses, margins = execution.poses[kept], execution.margins[kept]
    samples = {
        "t": _plain(execution.t[kept]),
        **dict(zip(("x", "y", "theta"), _plain(poses.T), strict=True)),
        "margins": _plain(margins.T),
        "lambdas": None if execution.lambdas is None else _plain(execution.lambdas[kept].T),
        "forces": None if execution.forces is None else _plain(np.moveaxis(execution.forces[kept], 0, -1)),
    }
    forces = np.zeros((1, 2)) if execution.forces is None else execution.forces
    largest = float(
        np.hypot(forces[..., 0], forces[..., 1]).max(initial=0.0, where=np.isfinite(forces).all(-1))
    )
    low, high = min(0.0, float(margins.min())), float(margins.max())
    room = 0.05 * max(high - low, 0.1)
    return {"samples": samples, "margin_range": [low - room, high + room], "largest_force": largest or 1.0}


def _kept(execution: Execution) -> IntArray:
    """Indices of the samples on the page: what viewers see, and of very long executions less."""
    shown = np.array(sorted(viewed(execution)), dtype=np.int64)
    stride = math.ceil(len(shown) / MOST_SAMPLES)
    always = [0, len(execution.t) - 1, *np.argmin(execution.margins, axis=0)]
    return np.union1d(shown[::stride], always)


def _plain(values: FloatArray) -> list[Any]:
    plain = np.round(values, _DIGITS).astype(object)
    plain[~np.isfinite(values)] = None
    rows: list[Any] = plain.tolist()
    return rows
