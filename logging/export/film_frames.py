"""The pictures of a film of a run: the chain from above, and under it the margins up to that time."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import cycle
from typing import NamedTuple

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from pushplan.basics.arrays import FloatArray
from pushplan.execution import Execution
from pushplan.geometry import se2
from pushplan.logging.messages.recorded import RecordedRun
from pushplan.logging.view.scene import obstacle_outline
from pushplan.logging.view.window import path_points, window
from pushplan.mechanics.body import BodyKind
from pushplan.result import Run

WIDTH, HEIGHT = 1280, 960
"""Size of a picture, pixels; even, as video encoders want it."""

_PLOT = 220
"""Height of the plot at the bottom of the picture, pixels."""

_FINE = 2
"""Pictures are drawn so many times larger and then reduced, which smooths their edges."""

_BLOCK = 2
"""What is drawn anew falls on blocks of so many pixels: video has one colour for four of them."""

_GROUND, _INK, _FAINT, _RULE, _BAD, _WAY, _GOAL = (
    "#fbfaf7", "#23262b", "#6f747c", "#dcdad3", "#c8322b", "#1f6fb2", "#2f9a55",
)  # fmt: skip
_OBJECTS = ("#e8912d", "#3a8ec9", "#57a64a", "#b5659f", "#8a7b52", "#4aa6a0", "#d0604d", "#7573c2")
_CARRYING = {BodyKind.ROBOT: "#9aa6b5", BodyKind.PLATE: "#3c4048"}

_LINE = 4
"""Half of the widest line, and of the sharpest corner that two lines make, pixels at most."""

Points = list[tuple[float, float]]
Box = tuple[int, int, int, int]
"""Left, top, right and bottom in a picture before it is reduced."""


class Patch(NamedTuple):
    """A part of a picture: the pixels from column `x` and row `y` on."""

    x: int
    y: int
    image: Image.Image


class Film:
    """Draws the pictures of a run that was executed.

    Attributes:
        still: What is the same in all pictures; where a `Patch` of one is not, the picture is this.
    """

    def __init__(self, run: Run | RecordedRun, execution: Execution) -> None:
        self._run, self._execution = run, execution
        view = window(run.scenario, run.plan)
        self._middle = 0.5 * np.array([view.xmin + view.xmax, view.ymin + view.ymax])
        room = np.array([WIDTH, HEIGHT - _PLOT])
        self._scale = 0.97 * float((room / [view.xmax - view.xmin, view.ymax - view.ymin]).min())
        low, high = min(0.0, float(execution.margins.min())), max(1e-3, float(execution.margins.max()))
        self._margins = low - 0.05 * (high - low), high + 0.05 * (high - low)
        self._font = ImageFont.load_default(15 * _FINE)
        self._background = self._draw_background()
        self.still = self._background.reduce(_FINE)
        self._canvas = self._background.copy()

    def pictures(self, rate: float, begin: float, end: float) -> Iterator[list[Patch]]:
        """Yield what moves in `rate` pictures for each simulated second from `begin` to `end`, s."""
        for time in np.append(np.arange(begin, end, 1.0 / rate), end):
            yield self.moving(float(time))

    def moving(self, time: float) -> list[Patch]:
        """Return what there is at a simulated time, s, in place of parts of the still picture.

        A later part hides earlier ones. All begin at even pixels and have even sizes.
        """
        pen = ImageDraw.Draw(self._canvas)
        boxes = [self._draw_chain(pen, time), *self._draw_now(pen, time)]
        parts = [Patch(b[0] // _FINE, b[1] // _FINE, self._canvas.crop(b).reduce(_FINE)) for b in boxes]
        for box in boxes:
            self._canvas.paste(self._background.crop(box), box)
        return parts

    def _draw_chain(self, pen: ImageDraw.ImageDraw, time: float) -> Box:
        poses, t = self._execution.poses, self._execution.t
        pose = np.array([np.interp(time, t, column) for column in poses.T])
        chain, paints = self._run.scenario.chain, cycle(_OBJECTS)
        bodies = [self._world(outline) for outline in self._outlines(pose)]
        for body, corners in zip(chain.bodies, bodies, strict=True):
            pen.polygon(corners, _CARRYING.get(body.kind) or next(paints), _INK, _FINE)
        for contact in chain.contacts:
            ends = se2.transform_points(pose, np.stack([contact.right, contact.left]))
            pen.line(self._world(ends), _BAD, 2 * _FINE)
        return _box([point for body in bodies for point in body])

    def _outlines(self, pose: FloatArray) -> list[FloatArray]:
        """Return the outlines of all bodies with the chain frame at `pose` (3,) in the world."""
        return [se2.transform_points(pose, body.outline) for body in self._run.scenario.chain.bodies]

    def _world(self, points: FloatArray) -> Points:
        """Return the place in the picture of points (k, 2) in the world."""
        middle = np.array([0.5 * WIDTH, 0.5 * (HEIGHT - _PLOT)])
        place = _FINE * (middle + self._scale * (points - self._middle) * [1.0, -1.0])
        return [(float(x), float(y)) for x, y in place]

    def _plot(self, t: FloatArray, margins: FloatArray) -> Points:
        """Return the place in the picture of margins (k,) at times (k,)."""
        low, high = self._margins
        last = float(self._execution.t[-1]) or 1.0
        x = 60.0 + (WIDTH - 80.0) * t / last
        y = HEIGHT - 14.0 - (_PLOT - 50.0) * (margins - low) / (high - low)
        return [(_FINE * float(a), _FINE * float(b)) for a, b in zip(x, y, strict=True)]

    def _draw_background(self) -> Image.Image:
        image = Image.new("RGB", (_FINE * WIDTH, _FINE * HEIGHT), _GROUND)
        pen = ImageDraw.Draw(image)
        scenario = self._run.scenario
        if scenario.workspace is not None:
            area = scenario.workspace
            x, y = [area.xmin, area.xmax, area.xmax, area.xmin], [area.ymin, area.ymin, area.ymax, area.ymax]
            pen.polygon(self._world(np.stack([x, y], axis=1)), None, _RULE, 2 * _FINE)
        for obstacle in scenario.obstacles:
            pen.polygon(self._world(obstacle_outline(obstacle)), _FAINT)
        for pose, paint in ((scenario.start, _RULE), (scenario.goal.pose_chain, _GOAL)):
            for outline in self._outlines(pose):
                pen.polygon(self._world(outline), None, paint, _FINE)
        way = path_points(self._run.plan)
        if len(way) > 1:
            pen.line(self._world(way), _WAY, 2 * _FINE, joint="curve")
        self._draw_plot(pen)
        return image

    def _draw_plot(self, pen: ImageDraw.ImageDraw) -> None:
        t, scenario = self._execution.t, self._run.scenario
        pen.line([(0, _FINE * (HEIGHT - _PLOT)), (_FINE * WIDTH, _FINE * (HEIGHT - _PLOT))], _RULE, _FINE)
        pen.line(self._plot(t[[0, -1]], np.zeros(2)), _BAD, _FINE)
        place = _FINE * 60
        for k, paint in zip(range(len(scenario.chain.contacts)), cycle(_OBJECTS), strict=False):
            pen.line(self._plot(t, self._execution.margins[:, k]), paint, 2 * _FINE)
            name = scenario.chain.contact_name(k)
            pen.text((place, _FINE * (HEIGHT - _PLOT + 8)), name, paint, self._font)
            place += int(pen.textlength(name, self._font)) + 24 * _FINE

    def _draw_now(self, pen: ImageDraw.ImageDraw, time: float) -> tuple[Box, Box]:
        now = self._plot(np.array([time, time]), np.array(self._margins))
        pen.line(now, _INK, _FINE)
        i = int(np.searchsorted(self._execution.t, time, side="right")) - 1
        smallest = float(self._execution.margins[max(i, 0)].min())
        text = f"{time:6.2f} s    smallest margin {smallest:.3f}"
        place = (_FINE * (WIDTH - 20), _FINE * (HEIGHT - _PLOT + 8))
        pen.text(place, text, _INK, self._font, anchor="ra")
        left, top, right, bottom = pen.textbbox(place, text, self._font, anchor="ra")
        return _box(now), _box([(left, top), (right, bottom)])


def _box(points: Points) -> Box:
    """Return the box around points and the lines through them; it falls on whole blocks of the picture."""
    size = _FINE * _BLOCK
    low, high = np.min(points, axis=0) - _FINE * _LINE, np.max(points, axis=0) + _FINE * _LINE
    most = np.array([WIDTH, HEIGHT]) // _BLOCK
    x, y = np.clip(np.floor(low / size), 0, most - 1).astype(int) * size
    right, bottom = np.clip(np.ceil(high / size), 1, most).astype(int) * size
    return int(x), int(y), int(right), int(bottom)
