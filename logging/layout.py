"""A layout for Foxglove and Lichtblick that shows a run: the scene from above, margins, planning, log.

The default layout of these viewers shows no scene. Importing this one (layout menu, "import from file") sets up
the panels for the topics of a run log, with one line in the plot for each contact of the run; of a run without a plan
it shows the search tree, the path that comes nearest, and the reason. Keys are those of both viewers' sources;
where they differ, both are written.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pushplan.logging.schemas as schemas
from pushplan.drawing import palette
from pushplan.drawing.scene import Scene
from pushplan.logging.recorded import RecordedRun
from pushplan.logging.shown import WORLD, contact_names
from pushplan.plans.plan import Plan
from pushplan.plans.run import Run
from pushplan.scenario.model import Scenario
from pushplan.util.files import write_whole

LAYOUT_FILE = "layout.json"
"""Name of the attachment that every log carries from its plan on."""

_SCENE, _MARGINS, _FORCES, _PROGRESS, _LOG = (
    "3D!pushplan",
    "Plot!pushplanmargins",
    "Plot!pushplanlambda",
    "Plot!pushplanprogress",
    "RosOut!pushplan",
)

_LINE_SHARE = 0.003
"""Width of the path as a share of the longer side of what is shown."""

_RIM = 1.05
"""What is seen over what has to be; the panel is taken to be at least as wide as high."""


def write_layout(run: Run | RecordedRun, path: Path | str) -> None:
    """Write the layout for `run` as a JSON file.

    Raises:
        OutputError: When the file cannot be written.
    """
    write_whole(path, layout_text(run.scenario, run.plan))


def layout_text(scenario: Scenario, plan: Plan | None) -> bytes:
    """Return the layout as the JSON file that viewers import."""
    return (json.dumps(layout(scenario, plan), indent=1) + "\n").encode()


def layout(scenario: Scenario, plan: Plan | None) -> dict[str, Any]:
    """Return the layout for a run as plain data."""
    solved = plan is not None and plan.solved
    log = {"topicToRender": schemas.LOG.name, "minLogLevel": 1, "searchTerms": []}
    panels = {
        _SCENE: _scene(scenario, plan),
        _LOG: {**_titled("Log" if solved else "Why there is no plan"), **log},
        **(_plots(scenario) if solved else {}),
    }
    return {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1.0},
        "layout": _split("row", 60, _SCENE, _beside() if solved else _LOG),
    }


def _plots(scenario: Scenario) -> dict[str, Any]:
    return {
        _MARGINS: _contacts(scenario, "Margin of each contact", "margin", {"0": "slips"}),
        _FORCES: _contacts(scenario, "Where the force acts", "lambda", {"0": "right end", "1": "left end"}),
        _PROGRESS: _progress(),
    }


def _beside() -> dict[str, Any]:
    lower = _split("row", 60, _PROGRESS, _LOG)
    return _split("column", 40, _MARGINS, _split("column", 50, _FORCES, lower))


def _split(direction: str, percentage: int, first: str, second: Any) -> dict[str, Any]:
    return {"direction": direction, "splitPercentage": percentage, "first": first, "second": second}


def _titled(title: str) -> dict[str, str]:
    return {"foxglovePanelTitle": title, "lichtblickPanelTitle": title}


def _scene(scenario: Scenario, plan: Plan | None) -> dict[str, Any]:
    """The scene seen straight from above, all of it."""
    view = Scene.of(scenario, plan).window
    side = float(view.size.max())
    distance, solved = _RIM * side, plan is not None and plan.solved
    return {
        **_titled(scenario.name if solved else f"{scenario.name}: no plan"),
        "followTf": WORLD,
        "followMode": "follow-none",
        "cameraState": {
            "perspective": False,
            "distance": distance,
            "phi": 0,
            "thetaOffset": 0,
            "target": [0, 0, 0],
            "targetOffset": [0.5 * (view.xmin + view.xmax), 0.5 * (view.ymin + view.ymax), 0],
            "targetOrientation": [0, 0, 0, 1],
            "fovy": 45,
            "near": 0.01 * distance,
            "far": 10.0 * distance,
        },
        "scene": {
            "backgroundColor": "#fbfaf7",
            "transforms": {"axisScale": 0, "lineWidth": 0, "showLabel": False, "enablePreloading": True},
        },
        "topics": _topics(_LINE_SHARE * side, solved),
        "transforms": {f"frame:{WORLD}": {"visible": False}},
        "layers": {},
        "publish": {},
    }


def _topics(width: float, solved: bool) -> dict[str, Any]:
    path = {"visible": True, "type": "line", "lineWidth": width}
    return {
        **{topic.name: {"visible": True} for topic in (schemas.SCENE, schemas.CONTACTS, schemas.PLAN_NEAREST)},
        schemas.PLAN_TREE.name: {"visible": not solved},
        schemas.PLAN_PATH.name: {**path, "gradient": 2 * [palette.PATH + "ff"]},
        schemas.PLAN_SMOOTHED.name: {**path, "gradient": 2 * [palette.SMOOTHED + "ff"]},
    }


def _contacts(scenario: Scenario, title: str, field: str, bounds: dict[str, str]) -> dict[str, Any]:
    """A plot of one number of every contact over time, and of its bounds."""
    names = contact_names(scenario)
    lines = [
        _line(f"{schemas.MARGINS.name}.contacts[{k}].{field}", name, colour)
        for k, (name, colour) in enumerate(zip(names, palette.contact_colours(len(names)), strict=True))
    ]
    lines += [_line(value, label, palette.SLIPS) for value, label in bounds.items()]
    return {**_plot(title, lines), "xAxisVal": "timestamp"}


def _progress() -> dict[str, Any]:
    """A plot of the cost of the best path over the planner's iterations, both out of one message."""
    topic = schemas.COSTS.name
    plot = _plot("Cost of the best path over iterations", [_line(f"{topic}.cost[:]", "cost (m)", palette.PATH)])
    return {**plot, "xAxisVal": "currentCustom", "xAxisPath": {"value": f"{topic}.iterations[:]", "enabled": True}}


def _plot(title: str, lines: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        **_titled(title),
        "paths": lines,
        "isSynced": True,
        "showLegend": True,
        "legendDisplay": "left",
        "showPlotValuesInLegend": False,
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "sidebarDimension": 180,
    }


def _line(path: str, label: str, colour: str) -> dict[str, Any]:
    return {"value": path, "label": label, "color": colour, "enabled": True, "timestampMethod": "receiveTime"}
