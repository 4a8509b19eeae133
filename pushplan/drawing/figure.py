"""Figures in one style with the key below; files hold no time stamps, so the same data give the same bytes."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.legend_handler import HandlerBase
from matplotlib.patches import Patch, Rectangle
from matplotlib.ticker import MaxNLocator, MultipleLocator

from pushplan.drawing import check_picture_path, palette
from pushplan.drawing.palette import FAINT, INK
from pushplan.util.arrays import FloatArray
from pushplan.util.files import write_whole

HALO = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.75}
"""Box behind text in a picture."""

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
    "svg.fonttype": "none",  # keeps text searchable and editable
    "figure.dpi": 100.0,
}
_DPI = 200
_METADATA: Mapping[str, Mapping[str, None]] = {  # removes the entries that differ from run to run
    ".png": {"Software": None},
    ".svg": {"Date": None, "Creator": None},
    ".pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}

SMALL = 6.5
"""Smallest font size, points."""

_EDGE, _BETWEEN = 0.04, 0.06
"""Gaps below the key and between key and sentence, inches."""
_KEY: Any = {"handlelength": 1.4, "columnspacing": 1.4, "handletextpad": 0.5, "borderaxespad": 0.0}
_BODY = 12.0
"""Smallest ratio of a body's width to the width of its outline."""
_PIECES = 24  # colours of the margin scale in a key
_TICKS, _TICK = 9, 0.3  # largest number of ticks on an axis, and the length that each needs, inches
_CROWDED = 0.14
"""Share of the margin axis below which two labels would touch."""
_UNBROKEN = "\N{NO-BREAK SPACE}"
_LETTER, _PROSE = 0.57, 0.53
"""Mean ratio of a letter's width to the font size: in names, and in sentences (with spaces)."""


class Picture(bytes):
    """A PNG file, which notebooks show."""

    def __repr__(self) -> str:
        """Return one line for consoles, without the bytes."""
        return f"<Picture of {len(self)} bytes>"

    def _repr_png_(self) -> bytes:
        return bytes(self)


@contextmanager
def figure_for(target: str | Path | BytesIO, width: float, height: float) -> Iterator[Figure]:
    """Yield a figure of `width` x `height` inches, then write it to a .png, .svg or .pdf file (or PNG to a buffer).

    Raises:
        PlotError: For any other suffix.
        OutputError: If the file cannot be written.
    """
    kind = ".png" if isinstance(target, BytesIO) else check_picture_path(target).suffix.lower()
    picture = target if isinstance(target, BytesIO) else BytesIO()
    with matplotlib.rc_context(_STYLE):
        figure = Figure(figsize=(width, height))
        yield figure
        figure.savefig(picture, format=kind.removeprefix("."), dpi=_DPI, metadata=dict(_METADATA[kind]))
        if not isinstance(target, BytesIO):
            write_whole(Path(target), picture.getvalue())


class MarginScale(Patch):
    """Entry of a key for the colours of margins."""

    def __init__(self) -> None:
        super().__init__(label=palette.MARGIN_WORDS)


class _ScaleHandler(HandlerBase):
    def create_artists(
        self, legend: Legend, orig_handle: Artist, x0: float, y0: float, width: float, height: float, *more: Any
    ) -> list[Artist]:
        del legend, orig_handle
        shares = np.arange(_PIECES) / _PIECES
        step, most = width / _PIECES, palette.MARGINS[-1][0]
        colours = [palette.margin_colour(float(most * share)) for share in shares]
        return [
            Rectangle((x0 + width * share, y0), step, height, color=colour, linewidth=0.0, transform=more[-1])
            for share, colour in zip(shares, colours, strict=True)
        ]


def axes_at(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """Return new axes; position and size are in inches."""
    total_width, total_height = figure.get_size_inches()
    place = (left / total_width, bottom / total_height, width / total_width, height / total_height)
    return figure.add_axes(place)


def equal_ticks(axes: Axes, extent: float) -> None:
    """Set ticks of equal spacing on both axes: about nine over `extent`, fewer if their labels would touch."""
    box, x, y = axes.get_window_extent(), np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())
    inches = extent * min(box.width / x, box.height / y) / axes.figure.dpi
    count = int(np.clip(inches / _TICK, 2, _TICKS))
    ticks = MaxNLocator(count, steps=[1, 2, 5, 10]).tick_values(0.0, extent)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MultipleLocator(float(ticks[1] - ticks[0])))


def margin_ticks(axes: Axes, kept: float | None) -> None:
    """Set the ticks of a vertical margin axis, each in its colour, and draw the margin that the plan keeps."""
    ticks = palette.margin_ticks(kept)
    axes.set_yticks(ticks, [f"{tick:.2g}" for tick in ticks])
    labels = axes.get_yticklabels()
    for tick, label in zip(ticks, labels, strict=True):
        label.set_color(palette.margin_colour(tick) or INK)
    if ticks[1] < _CROWDED * axes.get_ylim()[1]:
        labels[0].set_verticalalignment("top")
        labels[1].set_verticalalignment("bottom")
    if kept is not None:
        axes.axhline(kept, color=INK, linewidth=0.7, linestyle=(0, (3, 2)), zorder=1.5)


def letters_across(axes: Axes, points: float) -> int:
    """Return how many letters of a font size, points, fit into the width of axes."""
    return letters_in(axes.get_window_extent().width / axes.figure.dpi, points)


def letters_in(inches: float, points: float) -> int:
    """Return how many letters of a font size, points, fit into a width, inches."""
    return int(72.0 * inches / (_LETTER * points))


def narrowest(axes: Axes, outlines: Sequence[FloatArray]) -> float:
    """Return the width of the narrowest outline, points; position and limits of the axes must be set."""
    low, high = axes.get_xlim()
    inches = axes.get_window_extent().width / axes.figure.dpi
    return float(72.0 * inches * min(np.ptp(one, axis=0).min() for one in outlines) / abs(high - low))


def outline_width(axes: Axes, outlines: Sequence[FloatArray]) -> float:
    """Return a line width for outlines, points, that keeps the colour of small bodies visible."""
    return float(np.clip(narrowest(axes, outlines) / _BODY, 0.25, 0.9))


def broken(sentence: str, letters: int, **options: Any) -> list[str]:
    """Wrap a sentence into lines of at most `letters`, never between a number and its unit."""
    whole = re.sub(r"(?<=\d) (?=%|(?:deg|rad|mm|cm|m|s|N|kg)\b)", _UNBROKEN, sentence)
    return [line.replace(_UNBROKEN, " ") for line in textwrap.wrap(whole, letters, **options)]


def draw_footer(figure: Figure, left: float, entries: Sequence[Artist], sentence: str = "") -> float:
    """Draw the key at the figure's lower edge, and a sentence above it; return the height of both, inches.

    Args:
        figure: Figure of final width; its height can still change.
        left: Left edge of both, inches.
        entries: Entries of the key, in as few rows as the figure's width allows.
        sentence: Text, wrapped to the figure's width.
    """
    top = float(_key(figure, left, entries).get_window_extent().y1) / figure.dpi if entries else _EDGE
    if not sentence:
        return top
    letters = int(72.0 * (figure.get_figwidth() - 1.5 * left) / (_PROSE * 7.0))
    style: Any = {"fontsize": 7.0, "color": INK, "va": "bottom", "transform": figure.dpi_scale_trans}
    text = figure.text(left, top + _BETWEEN, "\n".join(broken(sentence, letters)), **style)
    return float(text.get_window_extent().y1) / figure.dpi


def _key(figure: Figure, left: float, entries: Sequence[Artist]) -> Legend:
    """Return the key in as few rows of similar length as the figure's width allows."""
    for rows in range(1, len(entries) + 1):
        legend = figure.legend(
            handles=entries,
            ncols=-(-len(entries) // rows),
            loc="lower left",
            bbox_to_anchor=(left, _EDGE),
            bbox_transform=figure.dpi_scale_trans,
            handler_map={MarginScale: _ScaleHandler()},
            **_KEY,
        )
        if rows == len(entries) or legend.get_window_extent().x1 <= figure.bbox.x1:
            break
        legend.remove()
    return legend
