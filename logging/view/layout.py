"""A layout for Foxglove and Lichtblick that shows a run: the scene from above, margins, planning, log.

The default layout of these viewers shows no scene. Importing this one (layout menu, "import from file") sets up
the panels for the topics of a run log, with one line in the plot for each contact of the run.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pushplan.logging.messages import schemas
from pushplan.logging.messages.recorded import RecordedRun
from pushplan.logging.view.scene import WORLD
from pushplan.logging.view.window import window
from pushplan.outputs.write import write_whole
from pushplan.result import Run

_SCENE, _MARGINS, _FORCES, _PROGRESS, _LOG = (
    "3D!pushplan",
    "Plot!pushplanmargins",
    "Plot!pushplanlambda",
    "Plot!pushplanprogress",
    "RosOut!pushplan",
)


def write_layout(run: Run | RecordedRun, path: Path | str) -> None:
    """Write the layout for `run` as a JSON file.

    Raises:
        OutputError: When the file cannot be written.
    """
    write_whole(path, (json.dumps(layout(run), indent=1) + "\n").encode())


def layout(run: Run | RecordedRun) -> dict[str, Any]:
    """Return the layout for `run` as plain data."""
    panels = {
        _SCENE: _scene(run),
        _MARGINS: _contacts(run, "Margins", "margin", {"0": "slips"}),
        _FORCES: _contacts(run, "Point of application", "lambda", {"0": "right end", "1": "left end"}),
        _PROGRESS: _progress(),
        _LOG: {"topicToRender": schemas.LOG.name, "minLogLevel": 1, "searchTerms": []},
    }
    lower = _split("row", 60, _PROGRESS, _LOG)
    plots = _split("column", 40, _MARGINS, _split("column", 50, _FORCES, lower))
    return {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1.0},
        "layout": _split("row", 60, _SCENE, plots),
    }


def _split(direction: str, percentage: int, first: str, second: Any) -> dict[str, Any]:
    return {"direction": direction, "splitPercentage": percentage, "first": first, "second": second}


def _scene(run: Run | RecordedRun) -> dict[str, Any]:
    """The scene seen straight from above, all of it."""
    view = window(run.scenario, run.plan)
    visible = {"visible": True}
    path = {"visible": True, "type": "line", "lineWidth": 0.006}
    return {
        "foxglovePanelTitle": run.scenario.name,
        "followTf": WORLD,
        "followMode": "follow-none",
        "cameraState": {
            "perspective": False,
            "distance": view.ymax - view.ymin,
            "phi": 0,
            "thetaOffset": 0,
            "target": [0, 0, 0],
            "targetOffset": [0.5 * (view.xmin + view.xmax), 0.5 * (view.ymin + view.ymax), 0],
            "targetOrientation": [0, 0, 0, 1],
            "fovy": 45,
            "near": 0.01,
            "far": 100,
        },
        "scene": {"backgroundColor": "#fbfaf7", "transforms": {"axisScale": 0.05, "showLabel": False}},
        "topics": {
            schemas.SCENE.name: visible,
            schemas.PLAN_TREE.name: {"visible": False},
            schemas.PLAN_PATH.name: {**path, "gradient": ["#1f6fb2ff", "#1f6fb2ff"]},
            schemas.PLAN_SMOOTHED.name: {**path, "gradient": ["#2f9a55ff", "#2f9a55ff"]},
            schemas.PUSHER_POSE.name: {"visible": False},
        },
        "transforms": {},
        "layers": {},
        "publish": {},
    }


def _contacts(run: Run | RecordedRun, title: str, field: str, bounds: dict[str, str]) -> dict[str, Any]:
    """A plot of one number of every contact over time, and of its bounds."""
    chain = run.scenario.chain
    lines = [
        _line(f"{schemas.MARGINS.name}.contacts[{k}].{field}", chain.contact_name(k))
        for k in range(len(chain.contacts))
    ]
    lines += [_line(value, label) for value, label in bounds.items()]
    return {**_plot(title, lines), "xAxisVal": "timestamp"}


def _progress() -> dict[str, Any]:
    """A plot of the cost of the best path over the planner's iterations."""
    topic = schemas.PROGRESS.name
    x = {"value": f"{topic}.iterations", "enabled": True}
    plot = _plot("Cost of the best path over iterations", [_line(f"{topic}.cost", "cost (m)")])
    return {**plot, "xAxisVal": "custom", "xAxisPath": x}


def _plot(title: str, lines: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "foxglovePanelTitle": title,
        "paths": lines,
        "isSynced": True,
        "showLegend": True,
        "legendDisplay": "floating",
        "showPlotValuesInLegend": True,
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "sidebarDimension": 240,
    }


def _line(path: str, label: str) -> dict[str, Any]:
    return {"value": path, "label": label, "enabled": True, "timestampMethod": "receiveTime"}
