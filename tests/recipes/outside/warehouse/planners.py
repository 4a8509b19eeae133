"""A planner: one of OMPL's that picks its states at random."""

from __future__ import annotations

from typing import Any

from ompl import control


def patient_rrt(space_information: Any) -> Any:
    """Return an RRT that seldom aims at the goal."""
    planner = control.RRT(space_information)
    planner.setGoalBias(0.02)
    return planner
