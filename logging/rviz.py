"""What makes RViz (ROS 2) show a bag: the names of its frames, and a configuration that is written beside it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import yaml

from pushplan.drawing import palette
from pushplan.drawing.scene import Scene, Window
from pushplan.errors import PushplanError
from pushplan.logging.recorded import RecordedRun
from pushplan.logging.shown import CHAIN
from pushplan.scenario.model import Scenario
from pushplan.util.names import PUSHER

_PIXELS, _VIEW = 2.0, 800.0
"""Width of a line, pixels, in a view of so many pixels in which everything is seen."""


class FrameNamesError(PushplanError, ValueError):
    """Names of frames that cannot be used."""


@dataclass(frozen=True)
class Frames:
    """Names of the frames above the chain.

    Attributes:
        map: The world's frame, in which scenarios are specified.
        odom: In which the robot's motion is measured; here the same as `map`.
        base: The robot's frame.
    """

    map: str = "map"
    odom: str = "odom"
    base: str = "base_link"

    @classmethod
    def from_text(cls, text: str) -> Self:
        """Return the frames named `MAP,BASE` or `MAP,ODOM,BASE`.

        Raises:
            FrameNamesError: When they are not two or three different names.
        """
        names = [name.strip() for name in text.split(",")]
        if len(names) == 2:
            names.insert(1, cls.odom)
        if len(names) != 3 or len(set(names)) < 3 or not all(name and name[0] != "/" for name in names):
            raise FrameNamesError(
                f"frames {text!r}; allowed: MAP,BASE or MAP,ODOM,BASE, all different, without a leading /"
            )
        return cls(*names)

    def check(self, scenario: Scenario) -> None:
        """Find out whether a run has a frame of one of these names.

        Raises:
            FrameNamesError: When it has.
        """
        taken = {CHAIN, PUSHER, *scenario.poses} & {self.map, self.odom, self.base}
        if taken:
            raise FrameNamesError(f"the run has a frame {sorted(taken)[0]!r} already; name others with --frames")


def line_width(view: Window) -> float:
    """Return the width of lines that are seen in a view of all of `view`, m."""
    return _PIXELS / _VIEW * float(view.size.max())


def rviz_file(run: RecordedRun, frames: Frames) -> str:
    """Return a configuration of RViz (ROS 2): the scene from above, all of it."""
    view = Scene.of(run.scenario, run.plan).window
    side = float(view.size.max())
    displays = [
        *(_display("MarkerArray", topic, latched) for topic, latched in _MARKERS),
        {**_display("Path", "/plan/path", True), **_path(palette.PATH, line_width(view))},
        {**_display("Path", "/plan/smoothed", True), **_path(palette.SMOOTHED, line_width(view))},
        {"Class": "rviz_default_plugins/TF", "Name": "frames", "Enabled": False, "Marker Scale": side / 10},
    ]
    camera = {
        "Class": "rviz_default_plugins/TopDownOrtho",
        "Name": "Current View",
        "Scale": _VIEW / side,
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
    parts = "; ".join(map(str, palette.red_green_blue(colour)))
    return {"Line Style": "Billboards", "Line Width": width, "Color": parts, "Pose Style": "None"}
