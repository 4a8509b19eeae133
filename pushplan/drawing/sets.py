"""Pictures of stable sets, contacts and friction cones in the chain frame.

A stable set is drawn as regions of the centre of rotation (COR), as in Fig. 9 of Harada et al. 2006.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon
from shapely.geometry.base import BaseGeometry

from pushplan.drawing import palette
from pushplan.drawing.figure import HALO, SMALL, axes_at, draw_footer, equal_ticks, figure_for, outline_width
from pushplan.drawing.floor import polygon_patches
from pushplan.drawing.palette import FAINT, INK, TURNS
from pushplan.geometry.se2 import transform_points
from pushplan.mechanics.chain import BodyKind, Chain
from pushplan.mechanics.contacts import friction_cone
from pushplan.sets.cor import Window
from pushplan.sets.stable_set import StableSet, default_window, grown
from pushplan.util.printable import cut

TURN_NAMES = {+1: "left turns", -1: "right turns"}
LINE_STYLES: tuple[Any, ...] = ("solid", "dashed", "dotted", "dashdot", (0, (6, 1, 1, 1, 1, 1)))
"""Line styles of the outlines of the sets, in order; the first set is also filled."""

# The layout, in inches.
_WIDTH, _MAX_HEIGHT, _LEGEND_WIDTH, _LEFT, _AXIS = 4.4, 7.5, 3.2, 0.7, 0.52

_ACROSS = 14
"""Number of letters up to which a name is written across the push; along the push it can have twice as many."""
_DASHED: Any = (0, (4, 2))
_NAMED = 2
"""Largest number of contacts for which each has a label."""
_LONG = 12.0
"""Shortest contact that has a label, points."""
_OVER = 36.0
"""Space that the label of the friction cones needs above them, points."""
_LABEL: Any = {"fontsize": SMALL, "bbox": HALO, "zorder": 9.0}


def plot_stable_sets(chain: Chain, sets: Sequence[StableSet], path: str | Path, window: Window | None = None) -> None:
    """Draw the COR regions of stable sets over one another, with the chain and its friction cones.

    Args:
        chain: The chain that all sets belong to.
        sets: Stable sets; the first is filled, the others are outlines with different line styles.
        path: File to write, with the suffix .png, .svg or .pdf.
        window: (xmin, ymin, xmax, ymax) to show in the chain frame, m; by default the chain and the tightest
            turns to both sides.

    Raises:
        PlotError: For any other suffix.
    """
    window = default_window(chain, sets) if window is None else window
    size = np.array([window[2] - window[0], window[3] - window[1]])
    width, height = size * min(_WIDTH / size[0], _MAX_HEIGHT / size[1])
    with figure_for(path, _LEFT + max(width, _LEGEND_WIDTH) + 0.15, height) as figure:
        bottom = draw_footer(figure, _LEFT, _set_keys(chain, sets)) + _AXIS
        figure.set_size_inches(figure.get_figwidth(), bottom + height + 0.15)
        _draw_with_chain(axes_at(figure, _LEFT, bottom, width, height), chain, sets, window)


def draw_set(axes: Axes, chain: Chain, stable: StableSet) -> None:
    """Draw a stable set with the chain and its friction cones, in the chain frame, without axis labels."""
    window = default_window(chain, [stable])
    _draw_with_chain(axes, chain, [stable], window)
    axes.set(xlabel="", ylabel="", anchor="NW")
    axes.set_title("stable centres of rotation [m]", loc="left", fontsize=9.0)
    for sense, name in TURN_NAMES.items():
        inside = _beyond(stable.cor_region(sense, window), chain, sense, window)
        if not inside.is_empty:
            at = inside.representative_point()
            axes.text(at.x, at.y, name.replace(" ", "\n"), color=TURNS[sense], ha="center", va="center", **_LABEL)
    _label_contacts(axes, chain)
    _label_drive(axes, chain, stable, window)


def _label_drive(axes: Axes, chain: Chain, stable: StableSet, window: Window) -> None:
    """Label the line of turning centres of a wheeled drive, on its side with more room, right of the chain."""
    drive, right = chain.pusher.drive, min(float(body.outline[:, 1].min()) for body in chain.bodies)
    for line in drive.turning_centres(window[3] - window[1])[1:]:
        y = 0.5 * (right + window[1])
        x = float(line[0, 0] + (line[1] - line[0])[0] * (y - line[0, 1]) / (line[1] - line[0])[1])
        side = "right" if x > 0.5 * (window[0] + window[2]) - 0.2 * (window[2] - window[0]) else "left"
        place: Any = {"xytext": (-4.0 if side == "right" else 4.0, 0.0), "textcoords": "offset points"}
        shown = stable.cor_region(-1, window).intersects(shapely.LineString(line))
        words = "the drive\nturns about\nthis line" + ("" if shown else ",\nstable only\nfarther out")
        axes.annotate(words, (x, y), ha=side, va="center", color=INK, annotation_clip=True, **place, **_LABEL)


def _beyond(region: BaseGeometry, chain: Chain, sense: int, window: Window) -> BaseGeometry:
    """Return the part of a region beside the chain, halfway to the window's edge or farther; else all of it."""
    xmin, ymin, xmax, ymax = window
    y = np.concatenate([obj.outline_chain[:, 1] for obj in chain.objects])
    low, high = (0.5 * (y.max() + ymax), ymax) if sense > 0 else (ymin, 0.5 * (ymin + y.min()))
    part = region.intersection(shapely.box(xmin, low, xmax, high))
    return region if part.is_empty else part


def _label_contacts(axes: Axes, chain: Chain) -> None:
    """Label the contacts if there are few, alternately below and above, and the first friction cone."""
    low = min(float(obj.outline_chain[:, 1].min()) for obj in chain.objects)
    high = max(float(obj.outline_chain[:, 1].max()) for obj in chain.objects)
    line: Any = {"arrowstyle": "-", "color": FAINT, "linewidth": 0.6}
    look: Any = {"textcoords": "offset points", "ha": "center", "arrowprops": line, "annotation_clip": True}
    long = _points(axes, min(contact.length for contact in chain.contacts)) > _LONG
    contacts = chain.contacts if len(chain.contacts) <= _NAMED and long else ()
    for k, (contact, colour) in enumerate(zip(contacts, palette.contact_colours(_NAMED), strict=False)):
        end, y = (contact.left, high) if k % 2 else (contact.right, low)
        place: Any = {"xytext": (0.0, 9.0 if k % 2 else -9.0), "va": "bottom" if k % 2 else "top"}
        place["xytext"] = (0.0, place["xytext"][1] + _points(axes, y - float(end[1])))
        axes.annotate(chain.contact_name(k), tuple(end), color=colour, **place, **look, **_LABEL)
    first = chain.contacts[0]
    cone = friction_cone(first, first.left, 0.5 * first.length)
    tip = cone[np.argmax(cone[:, 1])]
    over = _points(axes, axes.get_ylim()[1] - float(tip[1])) > _OVER
    place = {"xytext": (-26.0, 16.0), "va": "bottom"} if over else {"xytext": (22.0, -12.0), "va": "top"}
    axes.annotate("friction\ncone", tuple(tip), color=palette.CONE, **place, **look, **_LABEL)


def _points(axes: Axes, length: float) -> float:
    """Convert a length, m, to points."""
    return 72.0 * length * axes.get_window_extent().height / axes.figure.dpi / float(np.ptp(axes.get_ylim()))


def _draw_with_chain(axes: Axes, chain: Chain, sets: Sequence[StableSet], window: Window) -> None:
    draw_sets(axes, sets, window)
    draw_drive(axes, chain, sets[0], window)
    style_cor_axes(axes, window)  # before the chain: the width of its outlines depends on the scale
    width = outline_width(axes, [obj.outline for obj in chain.objects])
    objects = iter(palette.object_colours([obj.name for obj in chain.objects]))
    carried = {BodyKind.ROBOT: palette.ROBOT, BodyKind.PLATE: palette.PLATE}
    for body in chain.bodies:
        colour = carried.get(body.kind) or next(objects)
        axes.add_artist(Polygon(body.outline, facecolor=colour, edgecolor=INK, linewidth=width, zorder=3.0))
    draw_contacts(axes, chain)


def draw_sets(axes: Axes, sets: Sequence[StableSet], window: Window) -> None:
    """Draw the regions of both senses, clipped slightly outside the window to hide the clipped edge."""
    for rank, stable in enumerate(sets):
        for sense in TURNS:
            draw_region(axes, stable.cor_region(sense, grown(window, 0.05)), sense, rank)


def draw_drive(axes: Axes, chain: Chain, stable: StableSet, window: Window) -> None:
    """Draw the line of possible turning centres of a wheeled drive, thick where the turn is stable."""
    line: Any = {"color": INK, "linewidth": 0.8, "linestyle": _DASHED, "zorder": 2.0}
    far = float(np.hypot(window[2] - window[0], window[3] - window[1]))
    for sense, ends in zip(TURNS, chain.pusher.drive.turning_centres(far), strict=False):
        axes.plot(*ends.T, **line)
        own = stable.cor_region(sense, window).intersection(shapely.LineString(ends))
        for part in shapely.get_parts(own):
            if isinstance(part, shapely.LineString) and not part.is_empty:
                axes.plot(*part.xy, color=TURNS[sense], linewidth=2.4, solid_capstyle="butt", zorder=2.1)


def draw_region(axes: Axes, region: shapely.Geometry, sense: int, rank: int = 0) -> None:
    """Draw a COR region of one sense; rank 0 is filled, each other rank has its own line style."""
    if rank == 0:
        for patch in polygon_patches(region):
            patch.set(facecolor=TURNS[sense], alpha=0.22, linewidth=0.0, zorder=1.0)
            axes.add_artist(patch)
    line: Any = {"fill": False, "edgecolor": TURNS[sense], "linestyle": LINE_STYLES[rank % len(LINE_STYLES)]}
    for patch in polygon_patches(region):
        patch.set(linewidth=1.1, zorder=1.5 + 0.1 * rank, **line)
        axes.add_artist(patch)


def style_cor_axes(axes: Axes, window: Window) -> None:
    """Show `window` at equal scale, with axis labels and the chain frame's axes as thin lines."""
    axes.set_aspect("equal")
    axes.set_xlim(window[0], window[2])
    axes.set_ylim(window[1], window[3])
    equal_ticks(axes, max(window[2] - window[0], window[3] - window[1]))
    axes.axhline(0.0, color=FAINT, linewidth=0.5, zorder=0.5)
    axes.axvline(0.0, color=FAINT, linewidth=0.5, zorder=0.5)
    axes.set_xlabel("x in the chain frame [m]")
    axes.set_ylabel("y [m]")


def draw_contacts(axes: Axes, chain: Chain) -> None:
    """Draw each contact segment with the friction cones of the pushing force at both ends, in the chain frame."""
    width = outline_width(axes, [obj.outline for obj in chain.objects])
    for contact, colour in zip(chain.contacts, palette.contact_colours(len(chain.contacts)), strict=True):
        ends = np.stack([contact.right, contact.left])
        axes.plot(*ends.T, color=colour, linewidth=2.2 * width, solid_capstyle="butt", zorder=5.0)
        for cone in friction_cone(contact, ends, 0.5 * contact.length):
            axes.add_artist(Polygon(cone, facecolor=palette.CONE, alpha=0.35, linewidth=0.0, zorder=4.0))
            axes.plot(*cone[[1, 0, 2]].T, color=palette.CONE, linewidth=0.9 * width, zorder=4.1)


def name_objects(axes: Axes, chain: Chain) -> None:
    """Write every object's name on it, in the chain frame; across the push if there are more than two."""
    turned, letters = (90.0, _ACROSS) if len(chain.objects) > 2 else (0.0, 2 * _ACROSS)
    style: Any = {"ha": "center", "va": "center", "fontsize": SMALL, "clip_on": True, "bbox": HALO, "color": INK}
    for obj in chain.objects:
        polygon = shapely.Polygon(obj.outline)
        inside = polygon.centroid if polygon.contains(polygon.centroid) else polygon.representative_point()
        x, y = transform_points(obj.pose_chain, np.array([inside.x, inside.y]))
        axes.text(float(x), float(y), cut(obj.name, letters), rotation=turned, zorder=8.0, **style)


def _set_keys(chain: Chain, sets: Sequence[StableSet]) -> list[Artist]:
    looks = {"robot": palette.ROBOT, "pusher": palette.PLATE, "objects": palette.object_colours([""])[0]}
    if not chain.pusher.footprint:
        del looks["robot"]
    bodies = [Patch(facecolor=colour, edgecolor=INK, label=name) for name, colour in looks.items()]
    bodies.append(Patch(facecolor=palette.CONE, alpha=0.4, label="friction cones"))
    styles = [
        Line2D(
            [],
            [],
            color=INK,
            linewidth=1.1,
            linestyle=LINE_STYLES[rank % len(LINE_STYLES)],
            label=f"stable set {each.name}",
        )
        for rank, each in enumerate(sets)
    ]
    words = chain.pusher.drive.turning_words
    drive = [Line2D([], [], color=INK, linewidth=0.8, linestyle=_DASHED, label=words)] if words else []
    turns = [Patch(facecolor=TURNS[sense], alpha=0.35, label=TURN_NAMES[sense]) for sense in TURNS]
    return [*turns, *bodies, *styles, *drive]
