"""What stands still in a film of a run: the room from above, start and goal, the path; or why there is none."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from pushplan.logging.messages.recorded import RecordedRun
from pushplan.logging.view.scene import ghosts, obstacle_outline
from pushplan.logging.view.window import shown_path, shown_ways, window
from pushplan.plans.result import Run
from pushplan.util import colours
from pushplan.util.arrays import FloatArray

WIDTH, HEIGHT = 1280, 960
"""Size of a picture, pixels; even, as video encoders want it."""

PLOT = 220
"""Height of the part below the room, pixels."""

FINE = 2
"""Pictures are drawn so many times larger and then reduced, which smooths their edges."""

GROUND, INK, FAINT, RULE, TREE = "#fbfaf7", "#23262b", "#6f747c", "#dcdad3", "#b9c9e6"

Points = list[tuple[float, float]]

_LETTERS, _LINE = 110, 24
"""Letters in a line of words, and its height, pixels."""


class FilmScene:
    """The room of a run as a picture, `FINE` times as large as it is shown, and where points of the floor are."""

    def __init__(self, run: Run | RecordedRun) -> None:
        self._run = run
        view = window(run.scenario, run.plan)
        self._middle = 0.5 * np.array([view.xmin + view.xmax, view.ymin + view.ymax])
        room = np.array([WIDTH, HEIGHT - PLOT])
        self._scale = 0.97 * float((room / [view.xmax - view.xmin, view.ymax - view.ymin]).min())
        self.font = ImageFont.load_default(15 * FINE)

    def world(self, points: FloatArray) -> Points:
        """Return the place in the picture of points (k, 2) in the world."""
        middle = np.array([0.5 * WIDTH, 0.5 * (HEIGHT - PLOT)])
        place = FINE * (middle + self._scale * (points - self._middle) * [1.0, -1.0])
        return [(float(x), float(y)) for x, y in place]

    def picture(self) -> Image.Image:
        """Return the room, with nothing in the part below it."""
        image = Image.new("RGB", (FINE * WIDTH, FINE * HEIGHT), GROUND)
        pen = ImageDraw.Draw(image)
        self._draw_room(pen)
        for outlines, paint in self._ghosts():
            for outline in outlines:
                pen.polygon(self.world(outline), None, paint, FINE)
        for way in shown_ways(self._run.plan):
            colour, width = (colours.ALONE, FINE) if way.alone else (self._way_colour, 2 * FINE)
            pen.line(self.world(way.points), colour, width, joint="curve")
        pen.line([(0, FINE * (HEIGHT - PLOT)), (FINE * WIDTH, FINE * (HEIGHT - PLOT))], RULE, FINE)
        return image

    def picture_with_words(self) -> Image.Image:
        """Return the room and, in the part below, why nothing moves in it, in the size in which it is shown."""
        image = self.picture()
        pen, top = ImageDraw.Draw(image), HEIGHT - PLOT + 14
        for sentence in self._words():
            for line in textwrap.wrap(sentence, _LETTERS):
                pen.text((FINE * 24, FINE * top), line, INK, self.font)
                top += _LINE
        return image.reduce(FINE)

    @property
    def _solved(self) -> bool:
        return self._run.plan is not None and self._run.plan.path is not None

    @property
    def _way_colour(self) -> str:
        return colours.PATH if self._solved else colours.NEAREST

    def _words(self) -> list[str]:
        plan = self._run.plan
        if plan is None:
            return [f"{self._run.scenario.name}: the log ends before a plan"]
        state = "planned, but not executed" if plan.path is not None else "no plan"
        return [f"{self._run.scenario.name}: {state}", *plan.why_not]

    def _ghosts(self) -> Iterator[tuple[list[FloatArray], str]]:
        """Yield outlines in the world of what stands at start and goals, or comes nearest, and in which colour."""
        standing = ghosts(self._run.scenario)
        yield standing["start"], INK if self._run.execution is None else RULE
        yield standing["goal"], colours.GOAL
        path = shown_path(self._run.plan)
        if path is not None and not self._solved:
            yield self._run.scenario.chain.outlines_at(path.end), colours.NEAREST

    def _draw_room(self, pen: ImageDraw.ImageDraw) -> None:
        scenario, plan = self._run.scenario, self._run.plan
        if plan is not None and not self._solved:
            for branch in plan.tree[:, :, :2]:
                pen.line(self.world(branch), TREE, FINE // 2)
        if scenario.workspace is not None:
            pen.polygon(self.world(scenario.workspace.outline), None, RULE, 2 * FINE)
        for obstacle in scenario.obstacles:
            pen.polygon(self.world(obstacle_outline(obstacle)), FAINT)
