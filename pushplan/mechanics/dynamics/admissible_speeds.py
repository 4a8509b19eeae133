"""How fast a chain may be pushed along a twist: the exact polygon of speeds and accelerations without slip."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pushplan.errors import PushplanError
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.dynamics.contact_dynamics import DynamicRows, dynamic_rows
from pushplan.util.arrays import FloatArray, frozen


class SpeedWindow(NamedTuple):
    """Where an unbounded polygon is cut off: speed_squared bounds s'^2, acceleration s'' to both sides."""

    speed_squared: float = 4.0
    acceleration: float = 20.0


@dataclass(frozen=True, eq=False)
class AdmissibleSpeeds:
    """The convex polygon of (s'^2, s'') at which no contact slips or tips, along one twist.

    Attributes:
        vertices: (v, 2) corners, columns s'^2 and s'', counter-clockwise; none where nothing is admissible. The
            conditions are strict: the inside is admissible, the boundary is the limit.
        rows: The half-planes that bound it, beside the window.
        window: What cuts off unbounded directions.
    """

    vertices: FloatArray
    rows: DynamicRows
    window: SpeedWindow

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", frozen(self.vertices, (None, 2), "vertices"))


def admissible_speeds(chain: Chain, twist: ArrayLike, window: SpeedWindow | None = None) -> AdmissibleSpeeds:
    """Return the speeds and accelerations along a constant body twist at which every contact holds.

    Args:
        chain: The loads must be known.
        twist: (3,) in the chain frame, per unit of the path parameter s.
        window: What to cut off, in units of s.

    Raises:
        PushplanError: On a twist that is zero, not finite or not (3,), or a window without an inside.
        SupportError: When a load is not known.
    """
    window = SpeedWindow() if window is None else window
    if not min(window) > 0.0 or not np.isfinite(window).all():
        raise PushplanError(f"the window is {tuple(window)}; both bounds must be finite and > 0")
    rows = dynamic_rows(chain, twist)
    u, a = window
    vertices = np.array([[0.0, -a], [u, -a], [u, a], [0.0, a]])
    planes = np.stack([rows.alpha, rows.gamma, rows.beta], axis=-1).reshape(-1, 3)
    for plane in planes:
        vertices = _clipped(vertices, plane)
    return AdmissibleSpeeds(vertices, rows, window)


def _clipped(vertices: FloatArray, plane: FloatArray) -> FloatArray:
    """The part of a convex polygon (v, 2) where plane[0] + plane[1:] . x >= 0 (Sutherland and Hodgman 1974)."""
    value = plane[0] + vertices @ plane[1:]
    kept = []
    for here, there, f, g in zip(
        vertices, np.roll(vertices, -1, axis=0), value, np.roll(value, -1), strict=True
    ):
        if f >= 0.0:
            kept.append(here)
        if f * g < 0.0:
            kept.append(here + (f / (f - g)) * (there - here))
    return np.array(kept).reshape(-1, 2)
