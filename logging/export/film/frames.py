"""The pictures of a film of a run: the chain from above, and under it the margins up to that time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from PIL import Image, ImageDraw

from pushplan.geometry import se2
from pushplan.logging.export.film.scene import FINE, HEIGHT, INK, PLOT, WIDTH, FilmScene, Points
from pushplan.logging.messages.recorded import RecordedRun
from pushplan.logging.view.contacts import PushedContacts, worst_contacts
from pushplan.logging.view.shapes import body_colours
from pushplan.plans.execution import Execution
from pushplan.plans.result import Run
from pushplan.util import colours
from pushplan.util.arrays import FloatArray
from pushplan.util.printable import cut

_BLOCK = 2
"""What is drawn anew falls on blocks of so many pixels: video has one colour for four of them."""

_LINE = 4
"""Half of the widest line, and of the sharpest corner that two lines make, pixels at most."""

_NOW, _GAP = 300, 24
"""Width kept for what is said of the present moment, and between two names, pixels."""

PixelBox = tuple[int, int, int, int]
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
        self._chain, self._execution = run.scenario.chain, execution
        low, high = min(0.0, float(execution.margins.min())), max(1e-3, float(execution.margins.max()))
        self._margins = low - 0.05 * (high - low), high + 0.05 * (high - low)
        self._contacts = PushedContacts(self._chain, execution)
        self._paints = body_colours(self._chain)
        self._marks = colours.contact_colours(len(self._chain.contacts))
        self._scene = FilmScene(run)
        self._font = self._scene.font
        self._background = self._scene.picture()
        self._draw_plot(ImageDraw.Draw(self._background))
        self.still = self._background.reduce(FINE)
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
        parts = [Patch(b[0] // FINE, b[1] // FINE, self._canvas.crop(b).reduce(FINE)) for b in boxes]
        for box in boxes:
            self._canvas.paste(self._background.crop(box), box)
        return parts

    def _draw_chain(self, pen: ImageDraw.ImageDraw, time: float) -> PixelBox:
        pose, _ = self._execution.place_at(time)
        outlines = self._execution.outlines_at(self._chain, time)
        bodies = [self._scene.world(outline) for outline in outlines]
        for corners, paint in zip(bodies, self._paints, strict=True):
            pen.polygon(corners, paint, INK, FINE)
        drawn = [point for body in bodies for point in body]
        touching = self._draw_contacts(pen, time, pose) if self._execution.loads is None else []
        return _box([*drawn, *touching])

    def _draw_contacts(self, pen: ImageDraw.ImageDraw, time: float, pose: FloatArray) -> Points:
        """Draw segments, forces and friction cones, and return all their points."""
        drawn: Points = []
        for shapes, mark in zip(self._contacts.at(np.array([self._sample(time)])), self._marks, strict=True):
            segment = self._scene.world(se2.transform_points(pose, shapes.segment))
            pen.line(segment, mark, 3 * FINE)
            drawn += segment
            if shapes.shafts is not None and shapes.heads is not None:
                shaft = self._scene.world(se2.transform_points(pose, shapes.shafts[0]))
                head = self._scene.world(se2.transform_points(pose, shapes.heads[0]))
                pen.line(shaft, mark, 2 * FINE)
                pen.polygon(head, mark)
                drawn += [*shaft, *head]
            for cone in shapes.cones[0]:
                edges = self._scene.world(se2.transform_points(pose, cone[[1, 0, 2]]))
                pen.line(edges, mark, FINE)
                drawn += edges
        return drawn

    def _sample(self, time: float) -> int:
        """Return the last sample at or before a time."""
        return max(0, int(np.searchsorted(self._execution.t, time, side="right")) - 1)

    def _plot(self, t: FloatArray, margins: FloatArray) -> Points:
        """Return the place in the picture of margins (k,) at times (k,)."""
        low, high = self._margins
        last = float(self._execution.t[-1]) or 1.0
        x = 60.0 + (WIDTH - 80.0) * t / last
        y = HEIGHT - 14.0 - (PLOT - 50.0) * (margins - low) / (high - low)
        return [(FINE * float(a), FINE * float(b)) for a, b in zip(x, y, strict=True)]

    def _draw_plot(self, pen: ImageDraw.ImageDraw) -> None:
        t, margins = self._execution.t, self._execution.margins
        pen.line(self._plot(t[[0, -1]], np.zeros(2)), colours.SLIPS, FINE)
        for k, mark in enumerate(self._marks):
            pen.line(self._plot(t, margins[:, k]), mark, 2 * FINE)
        self._name(pen, worst_contacts(self._execution))

    def _name(self, pen: ImageDraw.ImageDraw, contacts: list[int]) -> None:
        """Write the names of contacts above the plot, each cut to its share of the width."""
        place, room = FINE * 60, FINE * (WIDTH - 60 - _NOW) / len(contacts) - FINE * _GAP
        for k in contacts:
            name = self._cut(pen, self._chain.contact_name(k), room)
            pen.text((place, FINE * (HEIGHT - PLOT + 8)), name, self._marks[k], self._font)
            place += int(pen.textlength(name, self._font)) + FINE * _GAP

    def _cut(self, pen: ImageDraw.ImageDraw, name: str, room: float) -> str:
        """Return a name, its middle left out where it is wider than `room` pixels."""
        whole, kept = name, len(name)
        while kept > 2 and pen.textlength(name, self._font) > room:
            kept -= 1
            name = cut(whole, kept)
        return name

    def _draw_now(self, pen: ImageDraw.ImageDraw, time: float) -> tuple[PixelBox, PixelBox]:
        now = self._plot(np.array([time, time]), np.array(self._margins))
        pen.line(now, INK, FINE)
        smallest = float(self._execution.margins[self._sample(time)].min())
        text = f"{time:6.2f} s    smallest margin {smallest:.3f}"
        place = (FINE * (WIDTH - 20), FINE * (HEIGHT - PLOT + 8))
        pen.text(place, text, INK, self._font, anchor="ra")
        left, top, right, bottom = pen.textbbox(place, text, self._font, anchor="ra")
        return _box(now), _box([(left, top), (right, bottom)])


def _box(points: Points) -> PixelBox:
    """Return the box around points and the lines through them; it falls on whole blocks of the picture."""
    size = FINE * _BLOCK
    low, high = np.min(points, axis=0) - FINE * _LINE, np.max(points, axis=0) + FINE * _LINE
    most = np.array([WIDTH, HEIGHT]) // _BLOCK
    x, y = np.clip(np.floor(low / size), 0, most - 1).astype(int) * size
    right, bottom = np.clip(np.ceil(high / size), 1, most).astype(int) * size
    return int(x), int(y), int(right), int(bottom)
