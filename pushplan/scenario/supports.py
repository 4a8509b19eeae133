"""From what a scenario says about an object's load to its support model."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pushplan.errors import PushplanError, SupportError
from pushplan.geometry.polygon import area_moments
from pushplan.mechanics.support import (
    FeetSupport,
    PressureMapSupport,
    Support,
    UniformSupport,
    UnknownSupport,
)
from pushplan.mechanics.worst_case.interval_chain import fractions_within
from pushplan.scenario.intervals import foot_spans
from pushplan.scenario.schema.objects import Object, PlacedSupport
from pushplan.scenario.yaml.report import Report
from pushplan.util.arrays import FloatArray

ReadFile = Callable[[str], bytes]
"""Returns the bytes of a file that the scenario names; raises SupportError when it cannot."""


def make_support(
    stated: Object, outline: FloatArray, index: int, read: ReadFile, report: Report
) -> Support | None:
    """Return the support model of object `index` with the counter-clockwise `outline` (v, 2), or report why not."""
    center = None if stated.center_of_mass is None else np.array(stated.center_of_mass)
    try:
        if not isinstance(stated.support, PlacedSupport):
            return (UniformSupport if stated.support == "uniform" else UnknownSupport)(outline, center)
        return _placed(stated.support, outline, center, read)
    except PushplanError as error:
        about_center = "center_of_mass" in str(error) and center is not None
        report.add(("objects", index, "center_of_mass" if about_center else "support"), str(error))
        return None


def _placed(
    support: PlacedSupport, outline: FloatArray, center: FloatArray | None, read: ReadFile
) -> Support:
    """Return feet or a pressure map; the centre of feet without loads is the outline's centroid if not stated."""
    bare = support.feet is not None and len(support.feet[0]) == 2
    if center is not None and not bare:
        raise SupportError("center_of_mass follows from the stated loads; leave it out")
    if support.feet is None:
        name = support.pressure_map or ""
        return PressureMapSupport.from_bytes(read(name), name)
    spans = foot_spans(support)
    if spans is not None:
        positions = np.array([foot[:2] for foot in support.feet], dtype=np.float64)
        return FeetSupport(positions, fractions_within(np.array(spans)))
    feet = np.array(support.feet, dtype=np.float64)
    if bare:
        return FeetSupport(feet, None, area_moments(outline).centroid if center is None else center)
    return FeetSupport(feet[:, :2], feet[:, 2])
