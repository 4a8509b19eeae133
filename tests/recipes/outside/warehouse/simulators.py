"""A simulator: a wet floor, on which everything slides more easily than a world says."""

from __future__ import annotations

from pushplan.plans.plan import Plan
from pushplan.sim.report import ContactReport
from pushplan.sim.slip import slip
from pushplan.slip.world import World


def wet_floor(plan: Plan, world: World) -> ContactReport:
    """Execute a plan where contacts have a tenth of their friction."""
    return slip(plan, world.with_contact_friction(0.1))
