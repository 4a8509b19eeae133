"""A planner of OMPL that picks its states at random."""

from __future__ import annotations

from typing import Any

from ompl import control


def patient_rrt(space_information: Any) -> Any:
    """Return an RRT with a small goal bias."""
    planner = control.RRT(space_information)
    planner.setGoalBias(0.02)
    return planner
