"""RViz (ROS 2) view of a bag: the names of its frames, and a configuration beside the bag."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import jinja2

from pushplan.drawing import palette
from pushplan.drawing.scene import Scene, Window
from pushplan.errors import PushplanError
from pushplan.logging.recorded import RecordedRun
from pushplan.logging.shown import CHAIN
from pushplan.scenario.model import Scenario
from pushplan.util.names import PUSHER

_PIXELS, _VIEW = 2.0, 800.0
"""Width of a line, and of a view of the whole scene, pixels."""


class FrameNamesError(PushplanError, ValueError):
    """A frame name cannot be used."""


@dataclass(frozen=True)
class Frames:
    """Names of the frames above the chain.

    Attributes:
        map: World frame, in which scenarios are specified.
        odom: Odometry frame; here the same as `map`.
        base: Frame of the robot.
    """

    map: str = "map"
    odom: str = "odom"
    base: str = "base_link"

    @classmethod
    def from_text(cls, text: str) -> Self:
        """Return the frames named `MAP,BASE` or `MAP,ODOM,BASE`.

        Raises:
            FrameNamesError: If they are not two or three different names.
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
        """Check that a run has no frame with one of these names.

        Raises:
            FrameNamesError: If it has one.
        """
        taken = {CHAIN, PUSHER, *scenario.poses} & {self.map, self.odom, self.base}
        if taken:
            raise FrameNamesError(f"the run already has a frame {sorted(taken)[0]!r}; choose others with --frames")


def line_width(view: Window) -> float:
    """Return a width of lines that is visible in a view of the whole scene, m."""
    return _PIXELS / _VIEW * float(view.size.max())


def rviz_file(run: RecordedRun, frames: Frames) -> str:
    """Return a configuration of RViz (ROS 2) with a view of the whole scene from above."""
    view = Scene.of(run.scenario, run.plan).window
    side = float(view.size.max())
    planned, smoothed = (
        "; ".join(map(str, palette.red_green_blue(colour))) for colour in (palette.PATH, palette.SMOOTHED)
    )
    source = Path(__file__).with_name("run.rviz.jinja").read_text("utf-8")
    template: Any = jinja2.Template(source, undefined=jinja2.StrictUndefined, keep_trailing_newline=True)
    text: str = template.render(
        map=frames.map,
        side=side,
        scale=_VIEW / side,
        x=0.5 * (view.xmin + view.xmax),
        y=0.5 * (view.ymin + view.ymax),
        line=line_width(view),
        planned=planned,
        smoothed=smoothed,
    )
    return text
