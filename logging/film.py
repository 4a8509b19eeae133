"""Export of a run as a film (MP4): the scene from above, and below it the margins over time."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from pushplan.drawing import palette
from pushplan.drawing.figure import broken, margin_ticks
from pushplan.drawing.floor import (
    draw_goals,
    draw_lines,
    draw_marks,
    draw_nearest,
    draw_outlines,
    draw_room,
    draw_tree,
)
from pushplan.drawing.palette import FAINT, INK
from pushplan.drawing.scene import Scene
from pushplan.geometry import se2
from pushplan.logging.recorded import RecordedRun
from pushplan.logging.shown import LoadContacts, contact_names, parts_of, pushed_at_samples, worst_contacts
from pushplan.plans.execution import Execution
from pushplan.plans.run import Run
from pushplan.util.arrays import FloatArray
from pushplan.util.files import write_whole
from pushplan.util.naming import optional
from pushplan.util.printable import cut

PICTURES_PER_SECOND = 25
STILL = 4.0
"""Length of the film of a run that was not executed, s."""

WIDTH, HEIGHT, DPI = 1280, 960, 100
"""Size of a picture, pixels; video encoders need even numbers."""

_FLOOR, _PLOT, _HEAD = (0.02, 0.25, 0.96, 0.68), (0.05, 0.05, 0.92, 0.15), (0.02, 0.965)
"""Left, bottom, width and height of floor and plot, and left and middle of the title, as shares of the picture."""

Picture = NDArray[np.uint8]
"""Picture (height, width, 3): red, green, blue."""


def write_mp4(run: Run | RecordedRun, path: Path | str, rate: float = 1.0) -> None:
    """Write a film of a run; without an execution, a still picture with the reason.

    Args:
        run: Run to show.
        path: Path of the film.
        rate: Simulated seconds in each second of the film, > 0.

    Raises:
        MissingExtraError: If av is not installed.
        OutputError: If the file cannot be written.
    """
    av = optional("av", "a film", "av", "mp4")
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "run.mp4"
        # With `faststart`, players can start before they have read the end of the file.
        with av.open(str(target), "w", options={"movflags": "+faststart"}) as container:
            how = {"crf": "20", "preset": "veryfast"}  # slower presets do not reduce the size of flat colours
            stream = container.add_stream("libx264", rate=Fraction(PICTURES_PER_SECOND), options=how)
            stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
            stream.codec_context.thread_count = 1  # leave the other processors to other programs
            for picture in pictures(run, rate):
                container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
            container.mux(stream.encode())
        write_whole(path, target.read_bytes())


def pictures(run: Run | RecordedRun, rate: float = 1.0) -> Iterator[Picture]:
    """Yield the pictures of a film, `PICTURES_PER_SECOND` for every `rate` simulated seconds."""
    execution = run.execution
    if execution is None or len(execution.t) == 0:
        still = Still(run).picture()
        yield from (still for _ in range(round(STILL * PICTURES_PER_SECOND)))
        return
    film, end = Film(run, execution, rate), float(execution.t[-1])
    for time in np.append(np.arange(0.0, end, rate / PICTURES_PER_SECOND), end):
        yield film.picture(float(time))


class Still:
    """Fixed part of a film: room, start, goals and path from above; without an execution, the reason below."""

    def __init__(self, run: Run | RecordedRun) -> None:
        self.run = run
        self.scene = Scene.of(run.scenario, run.plan, run.execution, run.events)
        figure = Figure(figsize=(WIDTH / DPI, HEIGHT / DPI), dpi=DPI, facecolor="white")
        self.canvas: Any = FigureCanvasAgg(figure)  # its methods are untyped
        self.floor, self.plot = figure.add_axes(_FLOOR), figure.add_axes(_PLOT)
        self._draw_floor(self.floor)
        figure.text(*_HEAD, cut(run.scenario.name, 60), color=INK, fontsize=15, va="center")
        if run.execution is None or len(run.execution.t) == 0:
            self._write_why(self.plot)

    def picture(self) -> Picture:
        """Return the picture of the current drawing."""
        self.canvas.draw()
        return self._pixels()

    def _pixels(self) -> Picture:
        return np.array(np.asarray(self.canvas.buffer_rgba())[:, :, :3])

    def _draw_floor(self, axes: Axes) -> None:
        scene, view = self.scene, self.scene.window
        axes.set(xlim=view[::2], ylim=view[1::2], aspect="equal", adjustable="box")
        axes.axis("off")
        draw_room(axes, scene)
        draw_goals(axes, scene)
        draw_outlines(axes, scene, scene.start, edgecolor=FAINT, linestyle="--", zorder=2.5)
        if not scene.lines:
            draw_tree(axes, scene)
            draw_nearest(axes, scene)
        draw_lines(axes, scene.lines)
        draw_marks(axes, scene)

    def _write_why(self, axes: Axes) -> None:
        plan = self.run.plan
        axes.axis("off")
        if plan is None:
            words = ["the log ends before a plan"]
        else:
            words = ["planned, but not executed" if plan.solved else "no plan", *plan.why_not]
        text = f"{self.run.scenario.name}: " + "\n".join(words)
        lines = [line for sentence in text.splitlines() for line in broken(sentence, 140)]
        axes.text(0.0, 1.0, "\n".join(lines), transform=axes.transAxes, color=INK, va="top", fontsize=12)


class Film(Still):
    """Pictures of an executed run; only the moving parts are redrawn, over the fixed part."""

    def __init__(self, run: Run | RecordedRun, execution: Execution, rate: float = 1.0) -> None:
        super().__init__(run)
        self._execution = execution
        self._contacts = LoadContacts(run.scenario, execution)
        self._names, self._parts = contact_names(run.scenario), parts_of(run)
        marks = palette.contact_colours(len(self._names))
        self._draw_margins(marks)
        bodies = [
            Polygon(np.zeros((3, 2)), facecolor=body.colour, edgecolor=INK, linewidth=0.8)
            for body in self.scene.bodies
        ]
        for body in bodies:
            self.floor.add_patch(body)
        lines = [self.floor.plot([], [], color=colour)[0] for colour in marks]
        now = self.plot.axvline(0.0, color=INK, linewidth=0.8)
        words = self.plot.text(1.0, 1.04, "", transform=self.plot.transAxes, ha="right", color=INK)
        figure = self.plot.figure
        figure.text(1.0 - _HEAD[0], _HEAD[1], f"speed x {rate:g}", color=FAINT, fontsize=12, ha="right", va="center")
        part = figure.text(0.5, _HEAD[1], "", color=INK, fontsize=12, ha="center", va="center")
        self._moving: list[Artist] = [*bodies, *lines, now, words, part]
        self._bodies, self._lines, self._now, self._words, self._part = bodies, lines, now, words, part
        for k, artist in enumerate(self._moving[:-3]):
            artist.set(zorder=4.0 + 0.01 * k)
        for artist in self._moving:
            artist.set_animated(True)
        self.canvas.draw()
        self._background = self.canvas.copy_from_bbox(self.canvas.figure.bbox)

    def picture(self, time: float = 0.0) -> Picture:
        """Return the picture at a simulated time, s."""
        execution = self._execution
        plate, _ = execution.poses_at(time)
        for patch, outline in zip(self._bodies, self.scene.outlines(self.scene.at(time)), strict=True):
            patch.set_xy(outline)
        sample = max(0, int(np.searchsorted(execution.t, time, side="right")) - 1)
        self._place_contacts(sample, plate)
        self._now.set_xdata([time, time])
        margin = self.scene.margins[sample]
        margin_text = "nothing is pushed" if np.isnan(margin) else f"smallest margin {margin:.3f}"
        self._words.set_text(f"{time:6.2f} s    {margin_text}")
        self._part.set_text(next((name for low, _, name in reversed(self._parts) if low <= time), ""))
        self.canvas.restore_region(self._background)
        for artist in self._moving:
            self.canvas.figure.draw_artist(artist)
        return self._pixels()

    def _place_contacts(self, sample: int, plate: FloatArray) -> None:
        """Draw segment, friction cones and force of each pushed contact as one line with gaps."""
        for line in self._lines:
            line.set_data([], [])
        ((load, _),) = pushed_at_samples(self.run, np.array([sample]))
        for shapes in () if load is None else self._contacts.at(load, np.array([sample])):
            parts = [shapes.segment, *(cone[[1, 0, 2]] for cone in shapes.cones[0])]
            if shapes.shafts is not None and shapes.heads is not None:
                parts += [shapes.shafts[0], shapes.heads[0][[1, 0, 2, 1]]]
            gap = np.full((1, 2), np.nan)
            points = [piece for part in parts for piece in (se2.transform_points(plate, part), gap)]
            self._lines[shapes.column].set_data(*np.concatenate(points).T)

    def _draw_margins(self, marks: list[str]) -> None:
        execution, axes = self._execution, self.plot
        for k, mark in enumerate(marks):
            axes.plot(execution.t, execution.margins[:, k], color=mark, linewidth=1.2)
        axes.axhline(0.0, color=palette.SLIPS, linewidth=0.8)
        kept = None if self.run.plan is None else self.run.plan.margin
        for event in self.scene.marks:
            axes.axvline(event.time, color=palette.EVENTS[event.kind], linewidth=1.0)
        axes.set_xlim(0.0, float(execution.t[-1]) or 1.0)
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(colors=FAINT)
        axes.set_ylabel("margin", color=FAINT)
        axes.annotate("s", (1.0, 0.0), (0, -4), "axes fraction", "offset points", color=FAINT, ha="right", va="top")
        margin_ticks(axes, kept)
        named = worst_contacts(execution)
        for place, k in enumerate(named):
            name = cut(self._names[k], 90 // len(named))
            left = 0.72 * place / len(named)
            axes.text(left, 1.04, name, transform=axes.transAxes, color=marks[k])
