"""Scenarios without what the defaults add, for tests of searches and timing by themselves."""

from dataclasses import replace

from pushplan.scenario.file import load_scenario
from pushplan.scenario.model import Scenario

ARC_PRICE = 0.002
"""What an arc counts beside its length, m."""


def plain(scenario: Scenario) -> Scenario:
    """Return a scenario ranked by travel, with a margin of 0, quasi-static contacts and exact timing.

    Its paths are the hardest to time: few metres, sharp corners, twists on the boundary of the stable set.
    """
    pusher, stated = scenario.chain.pusher, scenario.stated["pusher"]
    limits = replace(pusher.limits, contact="quasi-static")
    words = {**stated, "limits": {**stated["limits"], "contact": "quasi-static"}}
    return replace(
        scenario,
        chain=replace(scenario.chain, pusher=replace(pusher, limits=limits)),
        stability=replace(scenario.stability, margin=0.0),
        planner=replace(scenario.planner, cost="travel", arc_price=ARC_PRICE),
        trajectory="exact",
        stated={**scenario.stated, "pusher": words},
    )


def load_plain(name: str) -> Scenario:
    """Return a packaged scenario, made `plain`."""
    return plain(load_scenario(name))
