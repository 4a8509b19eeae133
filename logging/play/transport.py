"""A replay that keys steer, as those of `ros2 bag play` do: the simulated time at every moment of the wall clock."""

from __future__ import annotations

import time
from collections.abc import Callable

from pushplan.logging.play.playback import Playback

KEYS = {
    " ": "pause",
    "\x1b[C": "forward",
    "\x1b[D": "back",
    "\x1b[A": "faster",
    "\x1b[B": "slower",
    "q": "quit",
}
"""What a key does, by what a terminal sends: space, arrows right, left, up, down, q."""

STEP = 0.1
"""What an arrow goes forward or back, simulated s."""

_FASTER = 1.1


class Transport:
    """Where a replay is.

    Attributes:
        rate: Simulated seconds in each second.
        paused: Whether time stands still.
        finished: Whether the end was reached or `quit` pressed.

    Raises:
        PushplanError: When the run ends before it would begin.
    """

    def __init__(self, play: Playback, end: float, clock: Callable[[], float] = time.monotonic) -> None:
        self.rate, self.paused, self.finished = play.rate, False, False
        self._begin, self._stop = play.span(end)
        self._loop, self._clock = play.loop, clock
        self._from, self._since = self._begin, clock()

    def now(self) -> float:
        """Return the simulated time, s; in a loop it begins again when the end has been shown."""
        if self.paused or self.finished:
            return self._from
        simulated = self._from + self.rate * (self._clock() - self._since)
        if simulated < self._stop - 1e-9:
            return simulated
        self._seek(self._begin if self._loop else self._stop)
        self.finished = not self._loop
        return self._stop

    def press(self, key: str) -> None:
        """Do what a key of `KEYS` stands for; others do nothing."""
        match KEYS.get(key):
            case "pause":
                self._seek(self.now())
                self.paused = not self.paused
            case "forward":
                self._step(STEP)
            case "back":
                self._step(-STEP)
            case "faster":
                self._seek(self.now())
                self.rate *= _FASTER
            case "slower":
                self._seek(self.now())
                self.rate /= _FASTER
            case "quit":
                self.finished = True

    def _step(self, by: float) -> None:
        """Go forward or back, and stand still there."""
        self._seek(min(self._stop, max(self._begin, self.now() + by)))
        self.paused = True

    def _seek(self, simulated: float) -> None:
        self._from, self._since = simulated, self._clock()
