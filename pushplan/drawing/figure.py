"""Figures in one quiet style, with their key below; without time stamps: the same data give the same bytes."""

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
    "svg.fonttype": "none",  # text that can be searched and edited
    "figure.dpi": 100.0,
}
_DPI = 200
_METADATA: Mapping[str, Mapping[str, None]] = {  # nothing that differs from run to run
    ".png": {"Software": None},
    ".svg": {"Date": None, "Creator": None},
    ".pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}

SMALL = 6.5
"""Size of the smallest letters, points."""

_EDGE, _BETWEEN = 0.04, 0.06
"""Below the key, and between key and sentence, inches."""
_KEY: Any = {"handlelength": 1.4, "columnspacing": 1.4, "handletextpad": 0.5, "borderaxespad": 0.0}
_BODY = 12.0
"""Least width of a body over that of its outline."""
_PIECES = 24  # of the scale of margins in a key
_TICKS, _TICK = 9, 0.3  # most of them on an axis; inches that each takes
_CROWDED = 0.14
"""Of an axis of margins, what lies between two labels that would touch."""
_UNBROKEN = "\N{NO-BREAK SPACE}"
_LETTER, _PROSE = 0.57, 0.53
"""Mean width of a letter of the font over its height: in names, and in sentences with their spaces."""


class Picture(bytes):
    """A PNG file, which notebooks show."""

    def __repr__(self) -> str:
        """Say what it is in a line."""
        return f"<Picture of {len(self)} bytes>"

    def _repr_png_(self) -> bytes:
        return bytes(self)


@contextmanager
def figure_for(target: str | Path | BytesIO, width: float, height: float) -> Iterator[Figure]:
    """Yield a figure of `width` x `height` inches and write it to a file (PNG, SVG or PDF), or as PNG, afterwards.

    Raises:
        PlotError: On a suffix that is none of these.
        OutputError: When the file cannot be written.
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
    """The entry of a key for the colours of margins."""

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


def margin_ticks(axes: Axes, kept: float | None) -> None:
    """Name margins on the vertical axis, each in its colour on the fixed scale, and draw the one kept."""
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
    """Return how many letters of so many points fit beside one another over the width of axes."""
    return letters_in(axes.get_window_extent().width / axes.figure.dpi, points)


def letters_in(inches: float, points: float) -> int:
    """Return how many letters of so many points fit beside one another into a width, inches."""
    return int(72.0 * inches / (_LETTER * points))


def narrowest(axes: Axes, outlines: Sequence[FloatArray]) -> float:
    """Return the width of the narrowest outline, points, in axes whose place and limits are set already."""
    low, high = axes.get_xlim()
    inches = axes.get_window_extent().width / axes.figure.dpi
    return float(72.0 * inches * min(np.ptp(one, axis=0).min() for one in outlines) / abs(high - low))


def outline_width(axes: Axes, outlines: Sequence[FloatArray]) -> float:
    """Return the width of lines around outlines, points, that leaves small bodies their colour."""
    return float(np.clip(narrowest(axes, outlines) / _BODY, 0.25, 0.9))


def broken(sentence: str, letters: int, **options: Any) -> list[str]:
    """Return a sentence in lines of so many letters; between a number and its unit none begins."""
    whole = re.sub(r"(?<=\d) (?=%|(?:deg|rad|mm|cm|m|s|N|kg)\b)", _UNBROKEN, sentence)
    return [line.replace(_UNBROKEN, " ") for line in textwrap.wrap(whole, letters, **options)]


def draw_footer(figure: Figure, left: float, entries: Sequence[Artist], sentence: str = "") -> float:
    """Draw the key at the figure's lower edge, and a sentence above it; return the height of both, inches.

    Args:
        figure: Its width is final; its height may still change.
        left: Where both begin, inches.
        entries: Of the key; they take as few rows as the figure's width allows.
        sentence: Broken into lines where it is longer than the figure is wide.
    """
    top = float(_key(figure, left, entries).get_window_extent().y1) / figure.dpi if entries else _EDGE
    if not sentence:
        return top
    letters = int(72.0 * (figure.get_figwidth() - 1.5 * left) / (_PROSE * 7.0))
    style: Any = {"fontsize": 7.0, "color": INK, "va": "bottom", "transform": figure.dpi_scale_trans}
    text = figure.text(left, top + _BETWEEN, "\n".join(broken(sentence, letters)), **style)
    return float(text.get_window_extent().y1) / figure.dpi


def _key(figure: Figure, left: float, entries: Sequence[Artist]) -> Legend:
    """Return the key in as few rows as the figure has room for, all of them about equally long."""
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
