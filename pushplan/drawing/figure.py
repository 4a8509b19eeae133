"""Figures in one quiet style, written without time stamps: the same data give the same bytes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, MultipleLocator

from pushplan.drawing.format import check_picture_path
from pushplan.util.files import write_whole

INK = "#2f3338"
"""Text and the outlines that matter."""
FAINT = "#9aa1a9"
"""Axes and what stays in the background."""
HALO = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.75}
"""Behind letters in a picture."""

_STYLE: Any = {  # Any, because the type of the keys differs between versions of Matplotlib
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9.0,
    "mathtext.fontset": "dejavusans",
    "text.color": INK,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.7,
    "axes.titlesize": 10.0,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "hatch.linewidth": 0.5,
    "svg.hashsalt": "pushplan",
    "figure.dpi": 100.0,
}
_DPI = 200
_METADATA: Mapping[str, Mapping[str, None]] = {  # nothing that differs from run to run
    ".png": {"Software": None},
    ".svg": {"Date": None, "Creator": None},
    ".pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}

_TICKS, _TICK = 9, 0.3  # most of them on an axis; inches that each takes
_LETTER = 0.62
"""Mean width of a letter of the font over its height."""


@contextmanager
def figure_for(path: str | Path, width: float, height: float) -> Iterator[Figure]:
    """Yield a figure of `width` x `height` inches and write it to `path` (PNG, SVG or PDF) afterwards.

    Raises:
        PlotError: On a suffix that is none of these.
        OutputError: When the file cannot be written.
    """
    path = check_picture_path(path)
    with matplotlib.rc_context(_STYLE):
        figure = Figure(figsize=(width, height))
        yield figure
        kind, picture = path.suffix.lower(), BytesIO()
        figure.savefig(picture, format=kind.removeprefix("."), dpi=_DPI, metadata=dict(_METADATA[kind]))
        write_whole(path, picture.getvalue())


def axes_at(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """Return new axes at a place given in inches."""
    total_width, total_height = figure.get_size_inches()
    place = (left / total_width, bottom / total_height, width / total_width, height / total_height)
    return figure.add_axes(place)


def equal_ticks(axes: Axes, extent: float) -> None:
    """Give both axes ticks at the same spacing, about nine of them over `extent`, fewer where numbers would touch."""
    box, x, y = axes.get_window_extent(), np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())
    inches = extent * min(box.width / x, box.height / y) / axes.figure.dpi
    count = int(np.clip(inches / _TICK, 2, _TICKS))
    ticks = MaxNLocator(count, steps=[1, 2, 5, 10]).tick_values(0.0, extent)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MultipleLocator(float(ticks[1] - ticks[0])))


def letters_across(axes: Axes, points: float) -> int:
    """Return how many letters of so many points fit beside one another over the width of axes."""
    inches = axes.get_window_extent().width / axes.figure.dpi
    return int(72.0 * inches / (_LETTER * points))
