"""The files beside a bag that make RViz and PlotJuggler show it: seen from above, and the margins over time."""

from __future__ import annotations

import re
from typing import Any
from xml.etree import ElementTree

import yaml

from pushplan.logging.export.bag.frames import Frames
from pushplan.logging.export.bag.markers import line_width
from pushplan.logging.messages.recorded import RecordedRun
from pushplan.logging.view.window import window
from pushplan.mechanics.chain import Chain
from pushplan.util import colours

_VIEW_PIXELS = 800
"""Side of RViz's view in which everything is to be seen, pixels."""


def margin_topics(chain: Chain) -> list[str]:
    """Return the topic of each contact's margin; names in ROS have letters, digits and underscores only."""
    names = (chain.contact_name(k) for k in range(len(chain.contacts)))
    return [f"/margins/c{k:02d}_{re.sub('[^A-Za-z0-9]+', '_', name)}" for k, name in enumerate(names)]


def rviz_file(run: RecordedRun, frames: Frames) -> str:
    """Return a configuration of RViz (ROS 2): the scene from above, all of it."""
    view = window(run.scenario, run.plan)
    side = max(view.xmax - view.xmin, view.ymax - view.ymin)
    displays = [
        *(_display("MarkerArray", topic, latched) for topic, latched in _MARKERS),
        {**_display("Path", "/plan/path", True), **_path(colours.PATH, line_width(view))},
        {**_display("Path", "/plan/smoothed", True), **_path(colours.SMOOTHED, line_width(view))},
        {"Class": "rviz_default_plugins/TF", "Name": "frames", "Enabled": False, "Marker Scale": side / 10},
    ]
    camera = {
        "Class": "rviz_default_plugins/TopDownOrtho",
        "Name": "Current View",
        "Scale": _VIEW_PIXELS / side,
        "Angle": 0,
        "X": 0.5 * (view.xmin + view.xmax),
        "Y": 0.5 * (view.ymin + view.ymax),
        "Target Frame": frames.map,
    }
    options = {"Fixed Frame": frames.map, "Background Color": "251; 250; 247", "Frame Rate": 30}
    manager = {
        "Class": "",
        "Displays": displays,
        "Enabled": True,
        "Global Options": options,
        "Tools": [{"Class": f"rviz_default_plugins/{tool}"} for tool in ("MoveCamera", "Measure")],
        "Views": {"Current": camera, "Saved": None},
    }
    panels = [{"Class": f"rviz_common/{name}", "Name": name} for name in ("Displays", "Time")]
    config = {"Panels": panels, "Visualization Manager": manager, "Window Geometry": _WINDOW}
    return yaml.safe_dump(config, sort_keys=False)


_MARKERS = (("/scene", True), ("/plan/nearest", True), ("/contacts", False))
_WINDOW = {"Width": 1400, "Height": 1000}


def _display(kind: str, topic: str, latched: bool) -> dict[str, Any]:
    durability = "Transient Local" if latched else "Volatile"
    quality = {"Depth": 5, "Durability Policy": durability, "Reliability Policy": "Reliable", "Value": topic}
    return {
        "Class": f"rviz_default_plugins/{kind}",
        "Name": topic,
        "Enabled": True,
        "Topic": {**quality, "History Policy": "Keep Last"},
    }


def _path(colour: str, width: float) -> dict[str, Any]:
    parts = "; ".join(map(str, colours.red_green_blue(colour)))
    return {"Line Style": "Billboards", "Line Width": width, "Color": parts, "Pose Style": "None"}


def plotjuggler_layout(run: RecordedRun) -> str:
    """Return a layout of PlotJuggler: margins above, the pusher's twist below."""
    chain = run.scenario.chain
    names = [f"{topic}/data" for topic in margin_topics(chain)]
    margins = list(zip(names, colours.contact_colours(len(names)), strict=True))
    parts = ("linear/x", "linear/y", "angular/z")
    paints = (colours.PATH, colours.SMOOTHED, colours.NEAREST)
    twist = [(f"/pusher/twist/twist/{part}", paint) for part, paint in zip(parts, paints, strict=True)]
    root = ElementTree.Element("root")
    tabs = ElementTree.SubElement(root, "tabbed_widget", {"name": "Main Window", "parent": "main_window"})
    tab = ElementTree.SubElement(tabs, "Tab", tab_name=run.scenario.name, containers="1")
    container = ElementTree.SubElement(tab, "Container")
    split = ElementTree.SubElement(container, "DockSplitter", orientation="-", sizes="0.6;0.4", count="2")
    for title, curves in (("margins", margins), ("twist", twist)):
        area = ElementTree.SubElement(split, "DockArea", name=title)
        plot = ElementTree.SubElement(
            area, "plot", mode="TimeSeries", style="Lines", flip_x="false", flip_y="false"
        )
        for name, paint in curves:
            ElementTree.SubElement(plot, "curve", name=name, color=paint)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"
