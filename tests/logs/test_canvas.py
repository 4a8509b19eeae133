"""Lines of dots in a terminal."""

from __future__ import annotations

import numpy as np
import pytest

from pushplan.logging.play.canvas import Canvas
from pushplan.logging.view.window import Window


@pytest.mark.parametrize("every", [1, 2, 4])
@pytest.mark.parametrize("angle", np.radians([0.0, 20.0, 45.0, 90.0, 135.0, 200.0, 315.0]))
def test_a_dotted_line_has_as_many_dots_at_every_slope(angle: float, every: int) -> None:
    canvas = Canvas(Window(-1.0, -1.0, 1.0, 1.0), 20, 10)
    canvas.draw(0.9 * np.outer([-1.0, 1.0], [np.cos(angle), np.sin(angle)]), every)
    dots = sum(bin(ord(letter) - 0x2800).count("1") for line in canvas.text() for letter in line)
    steps = 36.0 * max(abs(np.cos(angle)), abs(np.sin(angle)))  # at 20 dots a metre
    assert dots == pytest.approx(steps / every, abs=2)
