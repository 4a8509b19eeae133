"""Scenarios on four feet per object with known loads, so that plan and physics engine use the same ones."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from typing import Any

import numpy as np
import shapely

from pushplan.mechanics.chain import PushedObject
from pushplan.mechanics.support import FeetSupport
from pushplan.scenario.file import scenario_from_document
from pushplan.util.arrays import FloatArray

INSET = 0.1
"""Distance of the feet from the edge of an object, over its narrower side."""

FEET = 4


def on_feet(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return the document of a scenario with every object on four feet; centres of mass stay.

    Objects on four feet with known loads keep these.
    """
    changed: dict[str, Any] = deepcopy(dict(document))
    for stated, obj in zip(changed["objects"], scenario_from_document(document).chain.objects, strict=True):
        if isinstance(obj.support, FeetSupport) and obj.support.known and len(obj.support.positions) == FEET:
            continue
        stated.pop("center_of_mass", None)
        stated["support"] = {"feet": four_feet(obj).tolist()}
    return changed


def four_feet(obj: PushedObject) -> FloatArray:
    """Return feet (4, 3), x, y and load, near the four corners of an object, also if it is not convex.

    Each is the point of the outline without its rim that lies farthest along a diagonal. The loads are as even as the
    centre of mass allows.
    """
    sides = np.ptp(obj.outline, axis=0)
    core = shapely.Polygon(obj.outline).buffer(-INSET * sides.min(), join_style="mitre")
    points = shapely.get_coordinates(core)
    diagonals = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) / sides
    spots = points[np.argmax(points @ diagonals.T, axis=0)]
    conditions = np.vstack([np.ones(FEET), (spots - obj.support.center).T])
    off = np.array([1.0, 0.0, 0.0]) - conditions.mean(axis=1)
    loads = 1.0 / FEET + np.linalg.pinv(conditions) @ off
    return np.column_stack([spots, loads])
