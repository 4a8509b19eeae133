"""A run played in a terminal: the chain from above in braille dots, and every contact's margin as a bar."""

from __future__ import annotations

import math
import shutil
from typing import TextIO

import numpy as np

from pushplan.basics.arrays import BoolArray, FloatArray
from pushplan.basics.printable import printable
from pushplan.errors import PushplanError
from pushplan.execution import Execution
from pushplan.geometry import se2
from pushplan.logging.messages.recorded import RecordedRun
from pushplan.logging.play.playback import Playback, ticks
from pushplan.logging.view.scene import obstacle_outline
from pushplan.logging.view.window import Window, window

PERIOD = 0.1
"""Between two pictures, s."""

_DOTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])
"""Bit of each of the 4 x 2 dots of a braille character."""

_BAR = 24


def play_in_terminal(run: RecordedRun, stream: TextIO, play: Playback) -> None:
    """Play the execution of `run` on a terminal until it ends or the user interrupts.

    Raises:
        PushplanError: When nothing was executed.
    """
    execution = run.execution
    if execution is None or len(execution.t) == 0:
        raise PushplanError(f"{run.path}: nothing was executed, so there is nothing to play")
    size = shutil.get_terminal_size()
    view = TerminalView(run, execution, size.columns - 1, size.lines - 1)
    stream.write("\x1b[?25l\x1b[2J")  # hide the cursor, wipe the screen
    try:
        for time in ticks(play, float(execution.t[-1]), PERIOD):
            stream.write("\x1b[H" + view.picture(time).replace("\n", "\x1b[K\n") + "\x1b[J")
            stream.flush()
    finally:
        stream.write("\x1b[?25h\n")


class TerminalView:
    """Draws a run in characters.

    Attributes:
        columns: Characters in a line.
        lines: Lines of a picture.
    """

    def __init__(self, run: RecordedRun, execution: Execution, columns: int, lines: int) -> None:
        self._chain, self._execution = run.scenario.chain, execution
        self._names = [printable(self._chain.contact_name(k)) for k in range(len(self._chain.contacts))]
        shown = min(len(self._names), max(1, lines - 8))
        self._names = self._names[:shown]
        self._canvas = _Canvas(window(run.scenario, run.plan), max(20, columns), max(6, lines - 1 - shown))
        for obstacle in run.scenario.obstacles:
            self._canvas.trace(obstacle_outline(obstacle))
        self._trace_chain(run.scenario.goal.pose_chain)
        self._canvas.keep()

    def picture(self, time: float) -> str:
        """Return the picture at a simulated time, s."""
        execution = self._execution
        pose = np.array([np.interp(time, execution.t, column) for column in execution.poses.T])
        self._trace_chain(pose)
        i = max(0, int(np.searchsorted(execution.t, time, side="right")) - 1)
        width = max(map(len, self._names))
        bars = [_bar(name.rjust(width), execution.margins[i, k]) for k, name in enumerate(self._names)]
        clock = f"{time:8.2f} / {execution.t[-1]:.2f} s"
        return "\n".join([self._canvas.text(), clock, *bars])

    def _trace_chain(self, pose: FloatArray) -> None:
        for body in self._chain.bodies:
            self._canvas.trace(se2.transform_points(pose, body.outline))


def _bar(name: str, margin: float) -> str:
    """Return a contact's margin as a bar; its length grows with the square root, so that small ones show."""
    full = round(_BAR * math.sqrt(min(1.0, max(0.0, margin))))
    return f"{name} {'█' * full}{'·' * (_BAR - full)} {margin:.4f}"


class _Canvas:
    """Dots, 2 x 4 to a character, that stand for a window of the floor."""

    def __init__(self, view: Window, columns: int, lines: int) -> None:
        self._dots = np.zeros((4 * lines, 2 * columns), dtype=np.bool_)
        self._kept: BoolArray = self._dots.copy()
        self._corner = np.array([view.xmin, view.ymax])
        self._scale = min(2 * columns / (view.xmax - view.xmin), 4 * lines / (view.ymax - view.ymin))

    def keep(self) -> None:
        """Let what is drawn now be part of every picture."""
        self._kept = self._dots.copy()

    def trace(self, outline: FloatArray) -> None:
        """Draw the closed line around a polygon (v, 2), world frame."""
        corners = self._scale * (outline - self._corner) * [1.0, -1.0]
        for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            steps = np.linspace(0.0, 1.0, int(np.abs(b - a).max()) + 2)
            dots = np.floor(a + steps[:, None] * (b - a)).astype(int)
            inside = ((dots >= 0) & (dots < self._dots.shape[::-1])).all(axis=1)
            self._dots[dots[inside, 1], dots[inside, 0]] = True

    def text(self) -> str:
        """Return the characters and wipe what is not to be kept."""
        rows, columns = self._dots.shape
        cells = self._dots.reshape(rows // 4, 4, columns // 2, 2)
        codes = 0x2800 + np.einsum("ijkl,jl->ik", cells, _DOTS)
        self._dots = self._kept.copy()
        return "\n".join("".join(map(chr, line)) for line in codes)
