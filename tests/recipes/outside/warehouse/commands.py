"""A command that prints how far the objects of a scenario must go."""

from __future__ import annotations

import numpy as np

from pushplan import load_scenario
from pushplan.cli import parameters as p
from pushplan.cli.console import Console


@p.command
@p.scenario_argument
def distance(console: Console, scenario: str) -> int:
    """Print the straight distance from start to goal."""
    stated = load_scenario(scenario)
    far = float(np.hypot(*(stated.goal.pose_chain - stated.start)[:2]))
    console.say((stated.name, "bold"), f": {far:.3f} m")
    console.emit({"scenario": stated.name, "distance": far})
    return 0
