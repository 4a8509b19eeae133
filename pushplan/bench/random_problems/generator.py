"""Random push problems as scenario files, the same text for the same seed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pushplan.bench.random_problems.chain import random_chain
from pushplan.bench.random_problems.parameters import ProblemParameters, Range
from pushplan.bench.random_problems.robot import robot_beside
from pushplan.bench.random_problems.scenario_yaml import scenario_yaml
from pushplan.bench.random_problems.world import random_world


def generate(parameters: ProblemParameters, seed: int) -> str:
    """Return the text of a scenario file with a random problem.

    The chain can be pushed straight ahead and around to both sides; start and goal are free by construction.
    Whether a way leads from one to the other is left to chance.

    Args:
        parameters: What the problem is like.
        seed: Of the random numbers, >= 0.

    Raises:
        GeneratorError: When the parameters leave no room for a problem.
    """
    rng = np.random.Generator(np.random.PCG64(seed))
    sections, chain, radius = random_chain(rng, parameters)
    world = random_world(rng, chain, enlarged(parameters, radius))
    stated: dict[str, object] = {
        "name": f"random {seed}",
        **sections,
        "start": world.start.tolist(),
        "goal": {"pose": world.goal.tolist()},
        "workspace": {"x": [0.0, world.side], "y": [0.0, world.side]},
        "obstacles": world.obstacles,
    }
    if parameters.robot is not None:
        stated |= robot_beside(rng, stated, chain, parameters.robot)
    text = scenario_yaml(stated)
    drive = chain.pusher.drive.kind
    return f"# {len(chain.objects)} objects, {len(world.obstacles)} obstacles, {drive}; seed {seed}\n{text}"


def enlarged(parameters: ProblemParameters, radius: float) -> ProblemParameters:
    """Return parameters with workspace and obstacles as much larger as a chain's turns are wider than asked for."""
    factor = max(1.0, radius / parameters.turning_radius)
    workspace, size = parameters.workspace, parameters.obstacle_size
    return replace(parameters, workspace=_scaled(workspace, factor), obstacle_size=_scaled(size, factor))


def _scaled(extent: Range, factor: float) -> Range:
    return factor * extent[0], factor * extent[1]
