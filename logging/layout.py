"""Layout of a run for Foxglove and Lichtblick: the scene from above, margins, planning, log.

The default layout of these viewers shows no scene. Import this one with "import from file" in the layout menu. It has
panels for the topics of a run log, with one line in the plot for each contact. For a run without a plan it shows the
search tree, the path that comes nearest to the goal, and the reason. If the keys of the two viewers differ, both are
written.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pushplan.logging.schemas as schemas
from pushplan.drawing import palette
from pushplan.drawing.scene import Scene
from pushplan.logging.recorded import RecordedRun
from pushplan.logging.shown import contact_names
from pushplan.plans.plan import Plan
from pushplan.plans.run import Run
from pushplan.scenario.model import Scenario
from pushplan.util.files import write_whole

LAYOUT_FILE = "layout.json"
"""Name of the attachment that every log carries from its plan on."""

_LINE_SHARE = 0.003
"""Width of the path as a share of the longer side of the scene."""

_RIM = 1.05
"""Size of the view over that of the scene, for a panel that is at least as wide as high."""


def write_layout(run: Run | RecordedRun, path: Path | str) -> None:
    """Write the layout for `run` as a JSON file.

    Raises:
        OutputError: If the file cannot be written.
    """
    write_whole(path, layout_text(run.scenario, run.plan))


def layout_text(scenario: Scenario, plan: Plan | None) -> bytes:
    """Return the layout as the JSON file that viewers import."""
    return (json.dumps(layout(scenario, plan), indent=1) + "\n").encode()


def layout(scenario: Scenario, plan: Plan | None) -> dict[str, Any]:
    """Return the layout for a run as plain data, from the template `layout.json`."""
    found: dict[str, Any] = json.loads(Path(__file__).with_name("layout.json").read_text("utf-8"))
    panels, solved = found["configById"], plan is not None and plan.solved
    view = Scene.of(scenario, plan).window
    side = float(view.size.max())
    distance, middle = _RIM * side, [0.5 * (view.xmin + view.xmax), 0.5 * (view.ymin + view.ymax), 0]
    scene, topics = panels["3D!pushplan"], panels["3D!pushplan"]["topics"]
    scene |= _titled(scenario.name if solved else f"{scenario.name}: no plan")
    scene["cameraState"] |= {"distance": distance, "targetOffset": middle}
    scene["cameraState"] |= {"near": 0.01 * distance, "far": 10.0 * distance}
    topics[schemas.PLAN_TREE.name]["visible"] = not solved
    for topic, colour in ((schemas.PLAN_PATH, palette.PATH), (schemas.PLAN_SMOOTHED, palette.SMOOTHED)):
        topics[topic.name] |= {"lineWidth": _LINE_SHARE * side, "gradient": 2 * [colour + "ff"]}
    plots = {
        "Plot!pushplanmargins": _contacts(scenario, "margin", {"0": "slips"}),
        "Plot!pushplanlambda": _contacts(scenario, "lambda", {"0": "right end", "1": "left end"}),
        "Plot!pushplanprogress": [_line(f"{schemas.COSTS.name}.cost[:]", "cost (m)", palette.PATH)],
    }
    for name, lines in plots.items():
        panels[name]["paths"] = lines
        if not solved:
            del panels[name]
    if not solved:
        panels["RosOut!pushplan"] |= _titled("Why there is no plan")
        found["layout"]["second"] = "RosOut!pushplan"
    return found


def _titled(title: str) -> dict[str, str]:
    return {"foxglovePanelTitle": title, "lichtblickPanelTitle": title}


def _contacts(scenario: Scenario, field: str, bounds: dict[str, str]) -> list[dict[str, Any]]:
    """Return the plot lines of a field of every contact, and of its bounds."""
    names = contact_names(scenario)
    lines = [
        _line(f"{schemas.MARGINS.name}.contacts[{k}].{field}", name, colour)
        for k, (name, colour) in enumerate(zip(names, palette.contact_colours(len(names)), strict=True))
    ]
    return [*lines, *(_line(value, label, palette.SLIPS) for value, label in bounds.items())]


def _line(path: str, label: str, colour: str) -> dict[str, Any]:
    return {"value": path, "label": label, "color": colour, "enabled": True, "timestampMethod": "receiveTime"}
