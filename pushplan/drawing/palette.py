"""Colours with the same meaning in every picture, page, film, window and log.

Bodies are pale or grey, paths and contacts are strong colours: they differ on light and on dark backgrounds.
Margins have one fixed scale: red at 0 (a contact moves), amber at 0.05, green at 0.1, blue from 0.2 on.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from colorsys import hls_to_rgb
from itertools import pairwise

ROBOT, PLATE = "#9aa6b5", "#59616b"
OBJECTS = ("#f3dfb6", "#cfe0ee", "#d9e7c9", "#ead5e6", "#f6cfc0", "#cdeae6", "#e3dccb", "#d6d3f0")
"""Colours of the objects, in turn, if their names contain no colour."""

NAMED = {
    "red": "#f0a8a0",
    "orange": "#f7c794",
    "yellow": "#f6e795",
    "green": "#b5d8a4",
    "blue": "#a9c8ea",
    "purple": "#cdb6e4",
    "violet": "#cdb6e4",
    "pink": "#f4c3d7",
    "brown": "#cfb298",
    "white": "#f7f7f4",
    "grey": "#cdd1d6",
    "gray": "#cdd1d6",
    "black": "#8e9196",
}
"""Colours of objects whose names contain a colour, such as `red` or `red-box`."""

GOAL, PATH, SMOOTHED, NEAREST, SLIPS = "#2f9a55", "#1f6fb2", "#2f9a55", "#b45f06", "#c8322b"
"""The goal, a planned path, the timed path, the path nearest to an unreachable goal, and a margin of 0."""

ALONE, TREE = "#7d8794", "#7f9fd6"
"""The robot's transit between pushes; branches of a search tree."""

OBSTACLE, OBSTACLE_EDGE, WALL = "#b9bfc8", "#8b939d", "#8b939d"
"""Obstacles, their edges and the walls of the workspace. Unknown areas are hatched in these colours."""

BLOCKING = "#dc9a8e"
"""An obstacle that separates the start from the goal."""

SWEPT, CONE = "#f3eee2", "#4f8a5b"
"""Swept floor; friction cones."""

TURNS = {+1: "#2c6fa6", -1: "#c0622d"}
"""Centres of rotation of counter-clockwise (+1) and clockwise (-1) turns."""

INK, FAINT = "#2f3338", "#9aa1a9"
"""Text and main outlines; axes and background lines."""

EVENTS = {
    "disturbance": "#d3540f",
    "deviation": "#c2186b",
    "moved": "#a3265e",
    "replan": "#8e3fb0",
    "room": "#8a6d00",
    "stall": "#5b2a86",
    "unseen": "#7d8794",
    "gave up": SLIPS,
}
"""Events of a closed loop; other kinds of events have no mark."""

ARRIVED, MISSED = "#2f9a55", "#c8322b"
"""Trial samples that arrive, and samples that miss the tolerance."""

MARGINS = ((0.0, SLIPS), (0.05, "#e3a23c"), (0.1, "#4f9d8c"), (0.2, "#1d5f9c"))
"""Scale of margins: values and colours, interpolated linearly and constant beyond the ends."""

MARGIN_TICKS = (0.0, 0.05, 0.2)
"""Labelled margins on the scale."""

MARGIN_WORDS = "path by its margin: red 0, amber 0.05, blue from 0.2"
"""Label of the scale in a key."""

_CONTACTS = ("#e0600b", "#8e3fb0", "#008b8b", "#c2186b", "#8a6d00", "#4a5fd0", "#5f8f1d", "#a04a35")
_TURN, _DEPTHS, _STRENGTH = 0.381966, (0.36, 0.5), 0.7
"""Step of the hue (the golden angle, as a share of a turn, spreads any number of hues), lightnesses, saturation."""


def contact_colours(count: int) -> list[str]:
    """Return `count` different colours for contacts."""
    more = range(len(_CONTACTS), count)
    hues = [hls_to_rgb(_TURN * k % 1.0, _DEPTHS[k % len(_DEPTHS)], _STRENGTH) for k in more]
    return [*_CONTACTS[:count], *("#" + "".join(f"{round(255 * part):02x}" for part in hue) for hue in hues)]


def object_colours(names: Sequence[str]) -> list[str]:
    """Return a colour for each object: the one in its name, else the next one of `OBJECTS`."""
    turn = iter(range(len(names)))
    said = [next((word for word in re.split(r"[^a-z]+", name.lower()) if word in NAMED), None) for name in names]
    return [NAMED[word] if word else OBJECTS[next(turn) % len(OBJECTS)] for word in said]


def margin_colour(margin: float) -> str | None:
    """Return the colour of a margin on the fixed scale; None for NaN (nothing is pushed)."""
    if math.isnan(margin):
        return None
    for (low, first), (high, second) in pairwise(MARGINS):
        if margin <= high:
            return mixed(first, second, max(0.0, (margin - low) / (high - low)))
    return MARGINS[-1][1]


def margin_ticks(kept: float | None) -> list[float]:
    """Return the margins to label on an axis; the margin that a plan keeps replaces the nearest one of the scale."""
    if not kept:
        return list(MARGIN_TICKS)
    nearest = min(MARGIN_TICKS[1:], key=lambda tick: abs(tick - kept))
    return sorted({*MARGIN_TICKS, kept} - ({nearest} - {kept}))


def margins_title(kept: float | None, least: float, corrected: bool) -> str:
    """Return the title of margins over time: the margin that the plan keeps and the smallest one of the execution.

    Args:
        kept: Margin that the plan keeps; None if unknown.
        least: Smallest margin of the execution; NaN if nothing was pushed.
        corrected: Whether a closed loop corrected the motion.
    """
    if kept is None:
        return "margin"
    title = f"margin; the plan keeps {kept:.2g}"
    if not least < 0.999 * kept:
        return title
    return f"{title},\n{'corrections go' if corrected else 'this run goes'} down to {least:.2g}"


def mixed(first: str, second: str, share: float) -> str:
    """Return a mix of two colours with `share` (0 to 1) of the second."""
    pairs = zip(red_green_blue(first), red_green_blue(second), strict=True)
    return "#" + "".join(f"{round((1.0 - share) * a + share * b):02x}" for a, b in pairs)


def red_green_blue(colour: str) -> tuple[int, int, int]:
    """Return red, green and blue, 0 to 255, of a colour `#rrggbb`."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)
