"""The picture of identified friction and loads: 95 % intervals within the ranges that were searched."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from pushplan.drawing.figure import axes_at, draw_footer, figure_for
from pushplan.drawing.palette import FAINT, INK, PATH
from pushplan.util.printable import cut

if TYPE_CHECKING:
    from pushplan.sim.identify.measured_push import Estimate

# The layout, in inches.
_LEFT, _WIDTH, _ROW, _TOP, _RIGHT = 1.9, 3.2, 0.3, 0.4, 1.7
_LETTERS = 28
"""Largest number of letters of a name."""
_ENDS: Any = {"fontsize": 6.5, "color": FAINT, "va": "center"}


def plot_estimates(estimates: Sequence[Estimate], path: str | Path) -> None:
    """Draw a row for each estimate: its interval and median within the range that was searched.

    Args:
        estimates: Estimates of `pushplan.identify`.
        path: File to write, with the suffix .png, .svg or .pdf.

    Raises:
        PlotError: For any other suffix.
    """
    height = _ROW * len(estimates)
    keys = [
        Patch(facecolor=PATH, alpha=0.6, label="95 % interval"),
        Line2D([], [], color=INK, marker="|", linestyle="none", label="median"),
        Patch(facecolor=FAINT, alpha=0.25, label="range of the search"),
    ]
    with figure_for(path, _LEFT + _WIDTH + _RIGHT, height) as figure:
        bottom = draw_footer(figure, 0.15, keys) + 0.15
        figure.set_size_inches(figure.get_figwidth(), bottom + height + _TOP)
        axes = axes_at(figure, _LEFT, bottom, _WIDTH, height)
        axes.set(xlim=(0.0, 1.0), ylim=(len(estimates) - 0.5, -0.5), xticks=[])
        axes.set_yticks(range(len(estimates)), [cut(one.unknown.name, _LETTERS) for one in estimates])
        axes.tick_params(axis="y", length=0)
        axes.spines[:].set_visible(False)
        axes.set_title("identified from pushes", loc="left", pad=8.0)
        for row, one in enumerate(estimates):
            axes.barh(row, 1.0, height=0.5, color=FAINT, alpha=0.25)
            axes.text(0.01, row, f"{one.unknown.low:.3g}", ha="left", **_ENDS)
            axes.text(0.99, row, f"{one.unknown.high:.3g}", ha="right", **_ENDS)
            words = "not determined"
            if one.determined:
                low, median, high = one.unknown.share(np.array([one.low, one.median, one.high]))
                axes.barh(row, high - low, left=low, height=0.5, color=PATH, alpha=0.6)
                axes.plot([median, median], [row - 0.3, row + 0.3], color=INK, linewidth=1.2)
                words = f"{one.median:.3g} ({one.low:.3g} to {one.high:.3g})"
            axes.text(1.03, row, words, va="center", fontsize=8.0, color=INK)
