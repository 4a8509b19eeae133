"""A simulator of a wet floor with less friction than the world states."""

from __future__ import annotations

from pushplan.plans.plan import Plan
from pushplan.sim.report import ContactReport
from pushplan.sim.slip import slip
from pushplan.slip.world import World


def wet_floor(plan: Plan, world: World) -> ContactReport:
    """Execute a plan with a tenth of the contact friction."""
    return slip(plan, world.with_contact_friction(0.1))
