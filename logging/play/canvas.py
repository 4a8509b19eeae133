"""Dots of braille characters, 2 x 4 to each, that stand for a rectangle of the floor."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pushplan.logging.view.window import Window
from pushplan.util.arrays import BoolArray, FloatArray

_DOTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])
"""Bit of each of the 4 x 2 dots of a character."""


class Canvas:
    """A picture of `columns` x `lines` characters."""

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
        self.draw(np.concatenate([outline, outline[:1]]))

    def draw(self, points: FloatArray, every: int = 1) -> None:
        """Draw a line through points (k, 2), world frame; of its dots one in `every`."""
        places = self._scale * (points - self._corner) * [1.0, -1.0]
        lines = [
            a + np.linspace(0.0, 1.0, int(np.abs(b - a).max()) + 2)[:, None] * (b - a)
            for a, b in pairwise(places)
        ]
        dots = np.floor(np.concatenate(lines)).astype(int)
        new = np.append(True, np.any(np.diff(dots, axis=0), axis=1))
        dots = dots[new][::every]
        inside = ((dots >= 0) & (dots < self._dots.shape[::-1])).all(axis=1)
        self._dots[dots[inside, 1], dots[inside, 0]] = True

    def text(self) -> list[str]:
        """Return the lines of characters and wipe what is not to be kept."""
        rows, columns = self._dots.shape
        cells = self._dots.reshape(rows // 4, 4, columns // 2, 2)
        codes = 0x2800 + np.einsum("ijkl,jl->ik", cells, _DOTS)
        self._dots = self._kept.copy()
        return ["".join(map(chr, line)) for line in codes]
