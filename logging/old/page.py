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

from pushplan.drawing import palette
from pushplan.geometry import se2
from pushplan.logging.old.messages.recorded import RecordedRun
from pushplan.logging.old.view.contacts import cone_heights, largest_force, longest_arrow, worst_contacts
from pushplan.logging.old.view.scene import ghosts, obstacle_outline
from pushplan.logging.old.view.shapes import body_colours
from pushplan.logging.old.view.views import viewed
from pushplan.logging.old.view.window import shown_ways, window
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.friction_cone import friction_cone
from pushplan.plans.execution import Execution
from pushplan.plans.result import PlanResult, Run
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray, IntArray
from pushplan.util.files import write_whole

MOST_SAMPLES = 5_000
"""Samples of an execution that the page holds, at most, beside the smallest margins."""


def write_html(run: Run | RecordedRun, path: Path | str) -> None:
    """Write the page of `run`.

    Raises:
        OutputError: When the file cannot be written.
    """
    write_whole(path, render(run).encode())


def render(run: Run | RecordedRun) -> str:
    """Return the page of `run`."""
    execution = _execution(run.scenario.chain, run.execution)
    shown = {"window": window(run.scenario, run.plan), "why": _why(run), "events": _events(run)}
    data = {**_world(run.scenario), **_plan(run.plan), **execution, **shown}
    text = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")  # no </script>
    page = files("pushplan.logging.old").joinpath("player.html").read_text(encoding="utf-8")
    return page.replace("@TITLE@", html.escape(f"{run.scenario.name} - pushplan")).replace("@RUN@", text)


def _events(run: Run | RecordedRun) -> list[tuple[float, str]]:
    """Return what a closed loop noticed and did."""
    feedback = run.feedback if isinstance(run, RecordedRun) else None
    return (
        [] if feedback is None else [(event.time, f"{event.kind}: {event.text}") for event in feedback.events]
    )


def _world(scenario: Scenario) -> dict[str, Any]:
    chain, area = scenario.chain, scenario.workspace
    return {
        "name": scenario.name,
        "workspace": None if area is None else area.outline.tolist(),
        "obstacles": [_plain(obstacle_outline(obstacle)) for obstacle in scenario.obstacles],
        "start": scenario.first_pose.tolist(),
        "load": scenario.start.tolist(),
        "attached": scenario.pushes is None,
        "ghosts": {name: list(map(_plain, outlines)) for name, outlines in ghosts(scenario).items()},
        "bodies": _bodies(chain),
        "contacts": _contacts(chain),
        "reach": chain.reach,
        "longest_arrow": longest_arrow(chain),
        "colours": {"goal": palette.GOAL, "nearest": palette.NEAREST, "alone": palette.ALONE},
    }


def _bodies(chain: Chain) -> list[dict[str, Any]]:
    return [
        {"name": body.name, "kind": body.kind.value, "outline": _plain(body.outline), "colour": colour}
        for body, colour in zip(chain.bodies, body_colours(chain), strict=True)
    ]


def _contacts(chain: Chain) -> list[dict[str, Any]]:
    """Segments, and friction cones with their apex at the origin, in the chain frame."""
    heights, paints = cone_heights(chain), palette.contact_colours(len(chain.contacts))
    return [
        {
            "name": chain.contact_name(k),
            "colour": paint,
            "segment": _plain(np.stack([contact.right, contact.left])),
            "cone": _plain(friction_cone(contact, np.zeros(2), tall)),
        }
        for k, (contact, tall, paint) in enumerate(zip(chain.contacts, heights, paints, strict=True))
    ]


def _why(run: Run | RecordedRun) -> list[str]:
    """Return why there is nothing to play, in sentences."""
    if run.plan is None:
        return ["The log ends before a plan."]
    if run.plan.path is not None and run.execution is None:
        return ["A path was planned, but not executed."]
    return run.plan.why_not


def _plan(plan: PlanResult | None) -> dict[str, Any]:
    if plan is None:
        return {"facts": [], "ways": [], "tree": [], "nearest": None}
    facts = [f"{plan.planner}, set {plan.stable_set}, seed {plan.seed}"]
    tree = _plain(plan.tree[:, :, :2].reshape(-1, 4))
    ways = [{"points": _plain(way.points), "alone": way.alone} for way in shown_ways(plan)]
    shown = {"ways": ways, "tree": tree}
    if plan.path is None:
        end = None if plan.approximate_path is None else _plain(plan.approximate_path.end)
        return {"facts": [*facts, "no plan"], "nearest": end, **shown}
    if plan.segments:
        pushes = sum(segment.pushes for segment in plan.segments)
        count = f"{pushes} push{'es' if pushes > 1 else ''}"
        facts.append(
            f"{count}, {plan.way_pushed:.3f} m pushed, {plan.path.cost:.3f} m driven in all, alone where dashed"
        )
    else:
        facts.append(f"{len(plan.path.lengths)} arcs, cost {plan.path.cost:.3f} m")
    return {"facts": facts, "nearest": None, **shown}


def _execution(chain: Chain, execution: Execution | None) -> dict[str, Any]:
    """Samples by column; margins, lambdas and forces by contact."""
    if execution is None or len(execution.t) == 0:
        nothing: dict[str, Any] = {"t": [], "margins": [[] for _ in chain.contacts], "forces": None}
        return {"samples": nothing, "margin_range": [-0.05, 1.0], "largest_force": 1.0, "named": []}
    kept = _kept(execution)
    poses, margins = execution.poses[kept], execution.margins[kept]
    loads = None if execution.loads is None else _plain(execution.loads[kept].T)
    slipped = execution.object_poses
    samples = {
        "t": _plain(execution.t[kept]),
        **dict(zip(("x", "y", "theta"), _plain(poses.T), strict=True)),
        "loads": loads,
        "objects": None if slipped is None else _moved(chain, slipped[kept]),
        "margins": _plain(margins.T),
        "lambdas": None if execution.lambdas is None else _plain(execution.lambdas[kept].T),
        "forces": None if execution.forces is None else _plain(np.moveaxis(execution.forces[kept], 0, -1)),
    }
    largest = 1.0 if execution.forces is None else largest_force(execution.forces)
    low, high = min(0.0, float(margins.min())), float(margins.max())
    room = 0.05 * max(high - low, 0.1)
    shown = {"margin_range": [low - room, high + room], "largest_force": largest}
    return {"samples": samples, **shown, "named": worst_contacts(execution)}


def _moved(chain: Chain, object_poses: FloatArray) -> list[Any]:
    """Return where each object of (m, n, 3) has moved the chain frame to, by column."""
    return _plain(np.moveaxis(se2.compose(object_poses, se2.inverse(chain.places)), 0, -1))


def _kept(execution: Execution) -> IntArray:
    """Indices of the samples on the page: what viewers see, and of very long executions less."""
    shown = np.array(sorted(viewed(execution)), dtype=np.int64)
    stride = math.ceil(len(shown) / MOST_SAMPLES)
    always = [0, len(execution.t) - 1, *np.argmin(execution.margins, axis=0)]
    return np.union1d(shown[::stride], always)


def _plain(values: FloatArray) -> list[Any]:
    plain = np.round(values, 5).astype(object)  # 0.01 mm: far below a pixel
    plain[~np.isfinite(values)] = None
    rows: list[Any] = plain.tolist()
    return rows
