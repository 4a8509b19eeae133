"""Poses and bounds as OMPL wants them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ompl import base as ob

from pushplan.arrays import FloatArray
from pushplan.geometry import se2


def bounds(ranges: Sequence[tuple[float, float]]) -> Any:
    """Return OMPL's bounds from the lowest and highest value of each coordinate."""
    made = ob.RealVectorBounds(len(ranges))
    for i, (low, high) in enumerate(ranges):
        made.setLow(i, low)
        made.setHigh(i, high)
    return made


def state_at(information: Any, pose: FloatArray) -> Any:
    """Return a state at a pose (3,), its angle wrapped; the space's states are those of SE(2)."""
    state = information.allocState()
    state.setX(float(pose[0]))
    state.setY(float(pose[1]))
    state.setYaw(float(se2.wrap_angle(pose[2])))
    return state
