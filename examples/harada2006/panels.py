"""What the figures share: panels of one size, the chain in them, and cones of directions at a centre of friction."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Polygon

from pushplan.drawing.figure import axes_at, figure_for
from pushplan.drawing.palette import CONE, INK, OBJECTS, PLATE, TURNS
from pushplan.drawing.sets import TURN_NAMES, style_cor_axes
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.contacts import carried_objects, cof, common_centers
from pushplan.scenario.file import load_scenario
from pushplan.sets.cor import Window
from pushplan.util.arrays import FloatArray

HERE = Path(__file__).parent
FAR = 10.0
"""Length of rays that leave every panel, m."""
_LEFT, _GAP, _AXIS, _TITLE = 0.62, 0.3, 0.42, 0.3
"""Inches: left of the panels, between them, below for the axis' label, above for the title."""


def chain_named(name: str) -> Chain:
    """Return the chain of a scenario beside this file."""
    return load_scenario(HERE / f"{name}.yaml").chain


def run(draw: Callable[[Path], None], script: str) -> None:
    """Draw a figure into the present folder, and say where; what its script does when it is run by itself."""
    path = Path(script).with_suffix(".png").name
    draw(Path(path))
    print(path)


@contextmanager
def row_of_panels(
    path: Path, window: Window, titles: Sequence[str], below: float, width: float
) -> Iterator[tuple[Figure, list[Axes]]]:
    """Yield a figure with panels side by side that show the same part of the chain frame; write it afterwards.

    Args:
        path: To write to.
        window: What each panel shows, m.
        titles: One for each.
        below: Height left free below the panels, inches.
        width: Of each, inches.
    """
    height = width * (window[3] - window[1]) / (window[2] - window[0])
    total = _LEFT + len(titles) * (width + _GAP)
    with figure_for(path, total, below + _AXIS + height + _TITLE) as figure:
        panels = []
        for i, title in enumerate(titles):
            axes = axes_at(figure, _LEFT + i * (width + _GAP), below + _AXIS, width, height)
            style_cor_axes(axes, window)
            axes.set_title(title, loc="left", fontsize=9.0)
            axes.set_xlabel("x [m]")
            if i > 0:
                axes.set_ylabel("")
                axes.tick_params(labelleft=False)
            panels.append(axes)
        yield figure, panels


def legend_below(figure: Figure, entries: Sequence[Artist], columns: int) -> None:
    """Put a legend at the bottom of a figure, in line with the first panel."""
    corner = (_LEFT / figure.get_figwidth(), 0.06 / figure.get_figheight())
    figure.legend(handles=entries, loc="lower left", bbox_to_anchor=corner, ncols=columns, borderaxespad=0.0)


def sense_entries() -> list[Artist]:
    """Return the legend's entries for the centres of rotation of either sense."""
    return [Patch(facecolor=TURNS[s], alpha=0.35, label=f"centres of {TURN_NAMES[s]}") for s in TURNS]


def draw_roles(axes: Axes, chain: Chain, pushed: Sequence[int]) -> None:
    """Draw the bodies under everything else: `pushed` objects as objects, all others as what pushes them."""
    outlines = [chain.pusher.outline, *(obj.outline_chain for obj in chain.objects)]
    for i, outline in enumerate(outlines, start=-1):
        colour = OBJECTS[0] if i in pushed else PLATE
        axes.add_patch(Polygon(outline, facecolor=colour, linewidth=0.0, zorder=0.8))
        axes.add_patch(Polygon(outline, fill=False, edgecolor=INK, linewidth=0.9, zorder=3.0))


def carried_center(chain: Chain, k: int) -> FloatArray:
    """Return the common centre of friction (2,) of the objects that contact k carries."""
    loads = np.array([obj.friction_load for obj in chain.objects])
    centers = np.array([cof(obj) for obj in chain.objects])
    return common_centers(carried_objects(chain), loads, centers)[k]


def allowed_directions(chain: Chain, k: int) -> FloatArray:
    """Return the right-most and left-most direction (2, 2) in which contact k may move what it carries.

    The paper's [C1] and [C2], or [C3] and [C4]: inside the friction cone, and through the segment when the force acts
    at the common centre of friction.
    """
    contact, center = chain.contacts[k], carried_center(chain, k)
    normal = np.arctan2(contact.normal[1], contact.normal[0])
    cone = np.arctan(contact.friction)
    from_left, from_right = (np.arctan2(*(center - end)[::-1]) for end in (contact.left, contact.right))
    ends = np.array([max(normal - cone, from_left), min(normal + cone, from_right)])
    return np.stack([np.cos(ends), np.sin(ends)], axis=1)


def draw_directions(axes: Axes, apex: FloatArray, directions: FloatArray, length: float) -> None:
    """Draw a cone of directions (2, 2) of motion at a point, and the point."""
    fan = np.concatenate([[apex], apex + length * directions])
    axes.add_patch(Polygon(fan, facecolor=CONE, alpha=0.45, linewidth=0.0, zorder=4.0))
    axes.plot(*fan[[1, 0, 2]].T, color=CONE, linewidth=1.1, zorder=4.1)
    axes.plot(*apex, marker="o", markersize=3.2, color=INK, zorder=6.0)


def wedge(apex: FloatArray, directions: FloatArray, sense: int) -> FloatArray:
    """Return the corners (3, 2) of a wedge of centres of rotation: directions of motion turned by +-90 degrees."""
    turned = sense * np.stack([-directions[:, 1], directions[:, 0]], axis=1)
    return np.concatenate([[apex], apex + FAR * turned])


def draw_wedge(axes: Axes, corners: FloatArray, sense: int, fill: bool) -> None:
    """Draw a wedge, filled or only its edges, dashed."""
    if fill:
        axes.add_patch(Polygon(corners, facecolor=TURNS[sense], alpha=0.22, linewidth=0.0, zorder=1.0))
    style = "solid" if fill else "dashed"
    axes.plot(*corners[[1, 0, 2]].T, color=TURNS[sense], linewidth=1.1, linestyle=style, zorder=1.5)
