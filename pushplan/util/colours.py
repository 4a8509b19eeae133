"""Colours that mean the same in every viewer, page and picture.

Bodies are pale or grey, contacts strong, so that neither is taken for the other on light and on dark ground.
"""

from __future__ import annotations

from colorsys import hls_to_rgb

ROBOT, PLATE = "#9aa6b5", "#59616b"
OBJECTS = ("#f3dfb6", "#cfe0ee", "#d9e7c9", "#ead5e6")
"""Of the objects in turn."""

GOAL, PATH, SMOOTHED, NEAREST, SLIPS = "#2f9a55", "#1f6fb2", "#2f9a55", "#b45f06", "#c8322b"
"""The goal, a planned path, the timed one, the path that comes nearest to a goal out of reach, a margin of 0."""

ALONE = "#7d8794"
"""The robot's own ways between pushes."""

_CONTACTS = ("#e0600b", "#8e3fb0", "#008b8b", "#c2186b", "#8a6d00", "#4a5fd0", "#5f8f1d", "#a04a35")
_TURN, _DEPTHS, _STRENGTH = 0.381966, (0.36, 0.5), 0.7
"""Of the golden angle: hues that are as far from each other as can be, however many there are."""


def contact_colours(count: int) -> list[str]:
    """Return a colour for each of `count` contacts, all different."""
    more = range(len(_CONTACTS), count)
    return [*_CONTACTS[:count], *(_hue(_TURN * k, _DEPTHS[k % len(_DEPTHS)]) for k in more)]


def object_colours(count: int) -> list[str]:
    """Return a colour for each of `count` objects, neighbours different."""
    return [OBJECTS[k % len(OBJECTS)] for k in range(count)]


def red_green_blue(colour: str) -> tuple[int, int, int]:
    """Return the parts, 0 to 255, of a colour written `#rrggbb`."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def _hue(hue: float, depth: float) -> str:
    return "#" + "".join(f"{round(255 * part):02x}" for part in hls_to_rgb(hue % 1.0, depth, _STRENGTH))
