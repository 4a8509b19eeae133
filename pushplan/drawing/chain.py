"""The chain as people draw it: robot, plate, objects, contact segments and their friction cones."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from pushplan.drawing.figure import INK
from pushplan.drawing.palette import contact_colours
from pushplan.mechanics.body import BodyKind
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.friction_cone import friction_cone
from pushplan.util.arrays import FloatArray

PLATE_COLOUR = "#59616b"
ROBOT_COLOUR = "#8da2be"
OBJECT_COLOUR = "#efe6d2"
GOAL_COLOUR = "#e3b04b"
CONE_COLOUR = "#4f8a5b"
ORIGIN = np.zeros(3)
CARRIED_COLOURS = {BodyKind.ROBOT: ROBOT_COLOUR, BodyKind.PLATE: PLATE_COLOUR}
_BODY = 12.0
"""Least width of a body over that of its outline."""


def draw_chain(axes: Axes, chain: Chain, pose: FloatArray = ORIGIN, *, fill: str = OBJECT_COLOUR) -> None:
    """Draw robot, plate and objects, filled and outlined."""
    width = outline_width(axes, chain)
    for body, outline in zip(chain.bodies, chain.outlines_at(pose), strict=True):
        colour = CARRIED_COLOURS.get(body.kind, fill)
        axes.add_patch(Polygon(outline, facecolor=colour, edgecolor=INK, linewidth=width, zorder=3.0))


def outline_width(axes: Axes, chain: Chain) -> float:
    """Return the width of outlines, points, that leaves small bodies their colour."""
    return float(np.clip(thinnest_in_points(axes, chain) / _BODY, 0.25, 0.9))


def thinnest_in_points(axes: Axes, chain: Chain) -> float:
    """Return the width of the thinnest object, points, in axes whose place and limits are set already."""
    thinnest = min(float(np.ptp(obj.outline, axis=0).min()) for obj in chain.objects)
    low, high = axes.get_xlim()
    inches = axes.get_window_extent().width / axes.figure.dpi
    return float(72.0 * inches * thinnest / abs(high - low))


def draw_contacts(axes: Axes, chain: Chain) -> None:
    """Draw each contact segment, and the friction cone of the pushing force at both its ends, in the chain frame."""
    width = outline_width(axes, chain)
    for contact, colour in zip(chain.contacts, contact_colours(len(chain.contacts)), strict=True):
        ends = np.stack([contact.right, contact.left])
        axes.plot(*ends.T, color=colour, linewidth=2.2 * width, solid_capstyle="butt", zorder=5.0)
        for cone in friction_cone(contact, ends, 0.5 * contact.length):
            axes.add_patch(Polygon(cone, facecolor=CONE_COLOUR, alpha=0.35, linewidth=0.0, zorder=4.0))
            axes.plot(*cone[[1, 0, 2]].T, color=CONE_COLOUR, linewidth=0.9 * width, zorder=4.1)
