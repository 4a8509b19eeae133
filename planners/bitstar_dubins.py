"""OMPL's BIT* (Gammell, Srinivasa and Barfoot 2015) over the chain as Dubins' car."""

from __future__ import annotations

from typing import Any

from ompl import geometric as og

from pushplan.planners import dubins
from pushplan.planners.session import Session

REWIRE_FACTOR = 10.0
"""Factor of BIT*'s radius of neighbours, which is made for spaces without turning circles."""


def search(session: Session, box: tuple[float, float, float, float], heading_length: float) -> None:
    """Run BIT* until the session is finished; see `dubins.search`."""
    del heading_length  # distances are those of Dubins' car
    dubins.search(session, box, _make, anew=False)


def _make(information: Any) -> Any:
    planner = og.BITstar(information)
    planner.setStopOnSolnImprovement(True)
    planner.setUseKNearest(False)  # neighbours within a radius: ten times as many edges per second
    planner.setRewireFactor(REWIRE_FACTOR)
    return planner
