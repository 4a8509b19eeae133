"""Outlines in pictures stay readable, however many and small the objects are."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from pushplan.drawing.chain import draw_chain, thinnest_in_points


def test_outlines_leave_small_objects_their_colour(make_chain: Any) -> None:
    """However small they are shown, the line is at most a twelfth of them, or as thin as can be printed."""
    chain = make_chain.boxes(3)
    for extent in (1.0, 5.0, 20.0, 100.0):
        axes = Figure(figsize=(4.0, 4.0), dpi=100).add_axes((0, 0, 1, 1))
        axes.set(xlim=(0.0, extent), ylim=(0.0, extent))
        draw_chain(axes, chain)
        thinnest = thinnest_in_points(axes, chain)
        smallest = min(np.ptp(one.outline, axis=0).min() for one in chain.objects)
        assert thinnest == pytest.approx(288.0 / extent * smallest)
        for patch in axes.patches:
            assert patch.get_linewidth() == pytest.approx(min(0.9, max(0.25, thinnest / 12.0)))
