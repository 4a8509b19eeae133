"""OMPL's control KPIECE1 (Sucan and Kavraki 2008) on the stable set."""

from __future__ import annotations

from ompl import control as oc

from pushplan.planners import control_planners
from pushplan.planners.session import Session


def search(session: Session, box: tuple[float, float, float, float], heading_length: float) -> None:
    """Run KPIECE1 until the session is finished; see `control_planners.search`."""
    control_planners.search(session, box, heading_length, oc.KPIECE1)
