"""A film of a run (MP4): frames of the drawing from above, and under it the margins up to that time."""

from __future__ import annotations

import tempfile
import textwrap
from collections.abc import Iterable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from pushplan.drawing import palette
from pushplan.drawing.floor import draw_room, draw_tree
from pushplan.drawing.palette import FAINT, INK
from pushplan.drawing.scene import Scene
from pushplan.geometry import se2
from pushplan.logging.old.messages.recorded import RecordedRun
from pushplan.logging.old.view.contacts import PushedContacts, worst_contacts
from pushplan.logging.old.view.scene import ghosts
from pushplan.logging.old.view.shapes import body_colours
from pushplan.logging.old.view.window import shown_path, shown_ways, window
from pushplan.plans.execution import Execution
from pushplan.plans.result import Run
from pushplan.util.arrays import FloatArray
from pushplan.util.extras import optional
from pushplan.util.files import write_whole
from pushplan.util.printable import cut

PICTURES_PER_SECOND = 25
STILL = 4.0
"""Length of the film of a run that was not executed, s."""

WIDTH, HEIGHT, DPI = 1280, 960, 100
"""Size of a picture, pixels; even, as video encoders want it."""

_FLOOR, _PLOT = (0.0, 0.25, 1.0, 0.75), (0.05, 0.05, 0.92, 0.15)
"""Left, bottom, width and height of the parts, as shares of the picture."""

Picture = NDArray[np.uint8]
"""(height, width, 3): red, green, blue."""


def write_mp4(run: Run | RecordedRun, path: Path | str, rate: float = 1.0) -> None:
    """Write a film of a run; of one that was not executed, a picture that says why.

    Args:
        run: What to show.
        path: The file.
        rate: Simulated seconds in each second of the film, > 0.

    Raises:
        MissingExtraError: When av is not installed.
        OutputError: When the file cannot be written.
    """
    av = optional("av", "a film", "av", "mp4")
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "run.mp4"
        _encode(av, pictures(run, rate), target)
        write_whole(path, target.read_bytes())


def pictures(run: Run | RecordedRun, rate: float = 1.0) -> Iterator[Picture]:
    """Yield the pictures of a film, `PICTURES_PER_SECOND` for every `rate` simulated seconds."""
    execution = run.execution
    if execution is None or len(execution.t) == 0:
        still = Still(run).picture()
        yield from (still for _ in range(round(STILL * PICTURES_PER_SECOND)))
        return
    film, end = Film(run, execution), float(execution.t[-1])
    for time in np.append(np.arange(0.0, end, rate / PICTURES_PER_SECOND), end):
        yield film.picture(float(time))


def _encode(av: Any, pictures: Iterable[Picture], target: Path) -> None:
    """Encode pictures to a file that players can start before they have read its end."""
    with av.open(str(target), "w", options={"movflags": "+faststart"}) as container:
        how = {"crf": "20", "preset": "veryfast"}  # of flat colours, slower presets make no smaller film
        stream = container.add_stream("libx264", rate=Fraction(PICTURES_PER_SECOND), options=how)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        stream.codec_context.thread_count = 1  # others may want the processors
        for picture in pictures:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode())


class Still:
    """What stands still in a film: the room from above, start and goals, the path; below, why nothing moves."""

    def __init__(self, run: Run | RecordedRun) -> None:
        self.run = run
        figure = Figure(figsize=(WIDTH / DPI, HEIGHT / DPI), dpi=DPI, facecolor="white")
        self.canvas: Any = FigureCanvasAgg(figure)  # whose methods have no types
        self.floor, self.plot = figure.add_axes(_FLOOR), figure.add_axes(_PLOT)
        self._draw_floor(self.floor)
        if run.execution is None or len(run.execution.t) == 0:
            self._write_why(self.plot)

    def picture(self) -> Picture:
        """Return the picture as it is drawn now."""
        self.canvas.draw()
        return self._pixels()

    def _pixels(self) -> Picture:
        return np.array(np.asarray(self.canvas.buffer_rgba())[:, :, :3])

    def _draw_floor(self, axes: Axes) -> None:
        scenario, plan = self.run.scenario, self.run.plan
        view = window(scenario, plan)
        axes.set(xlim=(view.xmin, view.xmax), ylim=(view.ymin, view.ymax), aspect="equal", adjustable="box")
        axes.axis("off")
        scene = Scene.of(scenario, None if plan is None else plan.as_plan(scenario))
        draw_room(axes, scene)
        solved = plan is not None and plan.path is not None
        if plan is not None and not solved:
            draw_tree(axes, scene)
        for name, outlines in ghosts(scenario).items():
            colour = FAINT if name == "start" else palette.GOAL
            axes.add_collection(PolyCollection(outlines, facecolors="none", edgecolors=colour, zorder=2.5))
        path = shown_path(plan)
        if path is not None and not solved:
            ends = scenario.chain.outlines_at(path.end)
            axes.add_collection(
                PolyCollection(ends, facecolors="none", edgecolors=palette.NEAREST, zorder=2.6)
            )
        for way in shown_ways(plan):
            colour = palette.ALONE if way.alone else palette.PATH if solved else palette.NEAREST
            axes.plot(*way.points.T, color=colour, linewidth=0.8 if way.alone else 1.6, zorder=2.7)

    def _write_why(self, axes: Axes) -> None:
        plan = self.run.plan
        axes.axis("off")
        if plan is None:
            words = ["the log ends before a plan"]
        else:
            words = ["planned, but not executed" if plan.path is not None else "no plan", *plan.why_not]
        text = f"{self.run.scenario.name}: " + "\n".join(words)
        lines = [line for sentence in text.splitlines() for line in textwrap.wrap(sentence, 140)]
        axes.text(0.0, 1.0, "\n".join(lines), transform=axes.transAxes, color=INK, va="top", fontsize=12)


class Film(Still):
    """The pictures of a run that was executed: only what moves is drawn anew, over what stands still."""

    def __init__(self, run: Run | RecordedRun, execution: Execution) -> None:
        super().__init__(run)
        self._execution, chain = execution, run.scenario.chain
        self._contacts = PushedContacts(chain, execution) if execution.loads is None else None
        marks = palette.contact_colours(len(chain.contacts))
        self._draw_margins(marks)
        bodies = [
            Polygon(np.zeros((3, 2)), facecolor=paint, edgecolor=INK, linewidth=0.8)
            for paint in body_colours(chain)
        ]
        for body in bodies:
            self.floor.add_patch(body)
        lines = [] if self._contacts is None else [self.floor.plot([], [], color=c)[0] for c in marks]
        now = self.plot.axvline(0.0, color=INK, linewidth=0.8)
        words = self.plot.text(1.0, 1.04, "", transform=self.plot.transAxes, ha="right", color=INK)
        self._moving: list[Artist] = [*bodies, *lines, now, words]
        self._bodies, self._lines, self._now, self._words = bodies, lines, now, words
        for k, artist in enumerate(self._moving[:-2]):
            artist.set(zorder=4.0 + 0.01 * k)
        for artist in self._moving:
            artist.set_animated(True)
        self.canvas.draw()
        self._background = self.canvas.copy_from_bbox(self.canvas.figure.bbox)

    def picture(self, time: float = 0.0) -> Picture:
        """Return the picture at a simulated time, s."""
        execution = self._execution
        for patch, outline in zip(
            self._bodies, execution.outlines_at(self.run.scenario.chain, time), strict=True
        ):
            patch.set_xy(outline)
        sample = max(0, int(np.searchsorted(execution.t, time, side="right")) - 1)
        if self._contacts is not None:
            self._place_contacts(self._contacts, sample, execution.place_at(time)[0])
        self._now.set_xdata([time, time])
        margin = float(execution.margins[sample].min())
        self._words.set_text(f"{time:6.2f} s    smallest margin {margin:.3f}")
        self.canvas.restore_region(self._background)
        for artist in self._moving:
            self.canvas.figure.draw_artist(artist)
        return self._pixels()

    def _place_contacts(self, contacts: PushedContacts, sample: int, pose: FloatArray) -> None:
        """Draw segment, friction cones and force of each contact as one line with gaps."""
        for line, shapes in zip(self._lines, contacts.at(np.array([sample])), strict=True):
            parts = [shapes.segment, *(cone[[1, 0, 2]] for cone in shapes.cones[0])]
            if shapes.shafts is not None and shapes.heads is not None:
                parts += [shapes.shafts[0], shapes.heads[0][[1, 0, 2, 1]]]
            gap = np.full((1, 2), np.nan)
            points = [piece for part in parts for piece in (se2.transform_points(pose, part), gap)]
            line.set_data(*np.concatenate(points).T)

    def _draw_margins(self, marks: list[str]) -> None:
        execution, axes = self._execution, self.plot
        for k, mark in enumerate(marks):
            axes.plot(execution.t, execution.margins[:, k], color=mark, linewidth=1.2)
        axes.axhline(0.0, color=palette.SLIPS, linewidth=0.8)
        axes.set_xlim(0.0, float(execution.t[-1]) or 1.0)
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(colors=FAINT)
        named = worst_contacts(execution)
        for place, k in enumerate(named):
            name = cut(self.run.scenario.chain.contact_name(k), 90 // len(named))
            left = 0.72 * place / len(named)
            axes.text(left, 1.04, name, transform=axes.transAxes, color=marks[k])
