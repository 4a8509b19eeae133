"""OMPL's geometric RRT (LaValle and Kuffner 2001) over the chain as Dubins' car."""

from __future__ import annotations

from typing import Any

from ompl import geometric as og

from pushplan.planners import dubins
from pushplan.planners.session import Session

GOAL_BIAS = 0.2
"""Share of the samples that are the goal."""


def search(session: Session, box: tuple[float, float, float, float], heading_length: float) -> None:
    """Run RRT, anew after every path, until the session is finished; see `dubins.search`."""
    del heading_length  # distances are those of Dubins' car
    dubins.search(session, box, _make, anew=True)


def _make(information: Any) -> Any:
    planner = og.RRT(information)
    planner.setGoalBias(GOAL_BIAS)
    return planner
