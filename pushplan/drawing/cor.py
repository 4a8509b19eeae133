"""Stable sets as regions of the centre of rotation (COR) in the chain frame, as in Fig. 9 of Harada et al. 2006."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline

from pushplan.drawing.figure import FAINT, equal_ticks
from pushplan.sets.cor.cor_region import Window

SENSES = {+1: "#2c6fa6", -1: "#c0622d"}
"""Colour of the CORs of counter-clockwise and of clockwise turns."""
SENSE_NAMES = {+1: "counter-clockwise turns", -1: "clockwise turns"}
LINE_STYLES: tuple[Any, ...] = ("solid", "dashed", "dotted", "dashdot", (0, (6, 1, 1, 1, 1, 1)))
"""Outline of the first set (which is filled as well), of the second, and so on."""


def draw_region(axes: Axes, region: shapely.Geometry, sense: int, rank: int = 0) -> None:
    """Draw a COR region of one sense; the set of rank 0 is filled, the others have a line style each."""
    if rank == 0:
        for patch in polygon_patches(region):
            patch.set(facecolor=SENSES[sense], alpha=0.22, linewidth=0.0, zorder=1.0)
            axes.add_patch(patch)
    style = LINE_STYLES[rank % len(LINE_STYLES)]
    for patch in polygon_patches(region):
        patch.set(
            fill=False, edgecolor=SENSES[sense], linestyle=style, linewidth=1.1, zorder=1.5 + 0.1 * rank
        )
        axes.add_patch(patch)


def polygon_patches(geometry: shapely.Geometry) -> Iterator[PathPatch]:
    """Yield a patch for each polygon of a geometry, holes kept open; lines and points are left out."""
    for part in shapely.get_parts(geometry):
        if isinstance(part, shapely.Polygon) and not part.is_empty:
            rings = [np.asarray(ring.coords)[:, :2] for ring in (part.exterior, *part.interiors)]
            yield PathPatch(Outline.make_compound_path(*(Outline(ring, closed=True) for ring in rings)))


def style_cor_axes(axes: Axes, window: Window) -> None:
    """Show `window` with equal axes, the chain frame's axes as hairlines, and labels."""
    axes.set_aspect("equal")
    axes.set_xlim(window[0], window[2])
    axes.set_ylim(window[1], window[3])
    equal_ticks(axes, max(window[2] - window[0], window[3] - window[1]))
    axes.axhline(0.0, color=FAINT, linewidth=0.5, zorder=0.5)
    axes.axvline(0.0, color=FAINT, linewidth=0.5, zorder=0.5)
    axes.set_xlabel("x in the chain frame [m]")
    axes.set_ylabel("y [m]")
