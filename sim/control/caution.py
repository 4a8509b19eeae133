"""Scenarios whose friction may be off: plans in them hold all the same."""

from __future__ import annotations

from dataclasses import replace

from pushplan.mechanics.chain import Chain
from pushplan.mechanics.intervals import IntervalChain
from pushplan.mechanics.perturb import with_contact_friction
from pushplan.scenario.model import Scenario

INTERVAL_SETS = ("ecof", "robust")
"""Stable sets that hold for intervals of floor friction."""


def cautious(scenario: Scenario, share: float, room: float = 0.0) -> Scenario:
    """Return the scenario with every coefficient of friction off by up to a share; one with intervals keeps them.

    Args:
        scenario: What is believed.
        share: From 0 to below 1.
        room: Clearance to keep at least, m.
    """
    scenario = replace(scenario, clearance=max(scenario.clearance, room))
    if share == 0.0 or scenario.interval is not None:
        return scenario
    chain = with_contact_friction(scenario.chain, 1.0 - share)
    if scenario.stability.set not in INTERVAL_SETS:
        return replace(scenario, chain=chain)
    spans = {
        obj.name: ((1.0 - share) * obj.floor_friction, (1.0 + share) * obj.floor_friction)
        for obj in chain.objects
    }
    return replace(scenario, chain=chain, interval=IntervalChain.from_ranges(chain, floor_friction=spans))


def with_chain(scenario: Scenario, chain: Chain) -> Scenario:
    """Return the scenario with another chain; where it states intervals, they hold for that."""
    interval = None if scenario.interval is None else replace(scenario.interval, chain=chain)
    return replace(scenario, chain=chain, interval=interval)
