"""A run played in a terminal: the chain from above in braille dots, and every contact's margin as a bar beside it."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable
from typing import TextIO

import numpy as np

from pushplan.errors import PushplanError
from pushplan.logging.messages.recorded import RecordedRun
from pushplan.logging.play.canvas import Canvas
from pushplan.logging.play.keyboard import keyboard
from pushplan.logging.play.playback import Playback
from pushplan.logging.play.transport import Transport
from pushplan.logging.view.contacts import MOST_NAMED, worst_contacts
from pushplan.logging.view.scene import ghosts, obstacle_outline
from pushplan.logging.view.window import Window, shown_ways, window
from pushplan.plans.execution import Execution
from pushplan.util.printable import cut, printable

PERIOD = 0.1
"""Between two pictures, s."""

_BESIDE, _GAP = 30, 2
"""Least room for bars beside the picture, and what is free between, characters."""

_NAME, _NUMBER = 0.5, 8
"""Share of a bar's line that its name takes at most; characters of the number behind it and the blanks."""

_PUSHED, _ALONE = 2, 4
"""Of the dots of a path one in so many is drawn, the chain pushed and the robot alone."""

_HELP = "space: pause   ←→: step   ↑↓: speed   q: quit"


def play_in_terminal(
    run: RecordedRun, stream: TextIO, play: Playback, wait: Callable[[float], str] | None = None
) -> None:
    """Play the execution of `run` on a terminal until it ends, `q` is pressed, or the user interrupts.

    Args:
        run: What to play.
        stream: The terminal.
        play: How.
        wait: Waits so many seconds for a key and returns it, or nothing; by default the terminal's keyboard.

    Raises:
        PushplanError: When nothing was executed.
    """
    execution = run.execution
    if execution is None or len(execution.t) == 0:
        raise PushplanError(f"{run.path}: nothing was executed, so there is nothing to play")
    transport = Transport(play, float(execution.t[-1]))
    stream.write("\x1b[?25l")  # hide the cursor
    try:
        if wait is None:
            with keyboard() as wait:
                _play(run, execution, stream, transport, wait)
        else:
            _play(run, execution, stream, transport, wait)
    finally:
        stream.write("\x1b[?25h\n")


def _play(
    run: RecordedRun, execution: Execution, stream: TextIO, transport: Transport, wait: Callable[[float], str]
) -> None:
    size, view = None, None
    while True:
        now = shutil.get_terminal_size()
        if view is None or now != size:  # the first time, and whenever the window has another size
            size, view = now, TerminalView(run, execution, now.columns - 1, now.lines - 1)
            stream.write("\x1b[2J")
        picture = view.picture(transport.now(), transport.paused)
        stream.write("\x1b[H" + picture.replace("\n", "\x1b[K\n") + "\x1b[J")
        stream.flush()
        if transport.finished:
            return
        transport.press(wait(PERIOD))


class TerminalView:
    """Draws a run in characters: bars beside the picture where there is room, else below.

    Args:
        run: What to draw.
        execution: Its execution.
        columns: Characters in a line.
        lines: Lines of a picture.
    """

    def __init__(self, run: RecordedRun, execution: Execution, columns: int, lines: int) -> None:
        self._chain, self._execution = run.scenario.chain, execution
        self._events = () if run.feedback is None else run.feedback.events
        view = window(run.scenario, run.plan)
        columns, lines = max(20, columns), max(8, lines)
        wide = _columns_for(view, lines - 1)
        self._beside = columns - wide - _GAP >= _BESIDE
        self._bar_width = columns - wide - _GAP if self._beside else columns
        room = lines - 3 if self._beside else max(1, min(MOST_NAMED, lines - 9))
        self._shown = worst_contacts(execution, room)
        rows = lines - 1 if self._beside else lines - 1 - len(self._shown) - self._unnamed
        self._canvas = Canvas(view, wide if self._beside else columns, rows)
        self._columns = columns
        self._draw_room(run)

    def _draw_room(self, run: RecordedRun) -> None:
        for obstacle in run.scenario.obstacles:
            self._canvas.trace(obstacle_outline(obstacle))
        for outline in ghosts(run.scenario)["goal"]:
            self._canvas.trace(outline)
        for way in shown_ways(run.plan):
            self._canvas.draw(way.points, every=_ALONE if way.alone else _PUSHED)
        self._canvas.keep()

    def picture(self, time: float, paused: bool = False) -> str:
        """Return the picture at a simulated time, s."""
        execution = self._execution
        for outline in execution.outlines_at(self._chain, time):
            self._canvas.trace(outline)
        i = max(0, int(np.searchsorted(execution.t, time, side="right")) - 1)
        drawn, bars = self._canvas.text(), self._bars(i)
        state = "  paused" if paused else ""
        clock = f"{time:8.2f} / {execution.t[-1]:.2f} s{state}{self._event(time)}"
        last = f"{clock}   {_HELP}" if len(clock) + len(_HELP) + 3 <= self._columns else clock
        if not self._beside:
            return "\n".join([*drawn, last[: self._columns], *bars])
        bars += [""] * (len(drawn) - len(bars))
        beside = (f"{left}{' ' * _GAP}{bar}".rstrip() for left, bar in zip(drawn, bars, strict=True))
        return "\n".join([*beside, last])

    def _event(self, time: float) -> str:
        """Return what a closed loop did last before a simulated time, s; empty where there is none."""
        told = [event for event in self._events if event.time <= time]
        return printable(f"   {told[-1].kind}: {told[-1].text}") if told else ""

    def _bars(self, i: int) -> list[str]:
        """Return the margin of each contact shown at a sample as a line."""
        names = [printable(self._chain.contact_name(k)) for k in self._shown]
        wide = min(max(map(len, names)), int(_NAME * self._bar_width))
        margins = self._execution.margins[i, self._shown]
        room = self._bar_width - wide - _NUMBER
        bars = [_bar(cut(name, wide).rjust(wide), m, room) for name, m in zip(names, margins, strict=True)]
        above = ["margin of each contact"] if self._beside else []
        more = f"and {len(self._chain.contacts) - len(names)} with larger margins"
        return [*above, *bars, *([more.rjust(self._bar_width)] if self._unnamed else [])]

    @property
    def _unnamed(self) -> bool:
        """Whether there are contacts for which there is no room."""
        return len(self._shown) < len(self._chain.contacts)


def _columns_for(view: Window, lines: int) -> int:
    """Return how many characters wide a picture of `lines` lines is that shows all of `view`."""
    return math.ceil(2.0 * lines * (view.xmax - view.xmin) / (view.ymax - view.ymin))


def _bar(name: str, margin: float, room: int) -> str:
    """Return a contact's margin as a bar; its length grows with the square root, so that small ones show."""
    full = round(room * math.sqrt(min(1.0, max(0.0, margin))))
    return f"{name} {'█' * full}{'·' * (room - full)} {margin:.4f}"
