"""Files of ReloPush (fluentrobotics/ReloPush, BSD-3-Clause, its `testdata` as JSON): blocks in a room, and a car.

The blocks are cubes of 0.15 m that may end in any of four orientations. The car has a footprint of 0.42 x 0.285 m,
its rear axle 0.30 m behind its front plate, and a least turning radius of 1.008 m. The room has 4.0 x 5.4 m. Masses
and frictions are not stated there; those here are common ones.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field, RootModel, model_validator

from pushplan.errors import Finding, ScenarioError
from pushplan.geometry import se2
from pushplan.scenario import fields as t
from pushplan.scenario.file import scenario_from_document
from pushplan.scenario.model import Scenario
from pushplan.scenario.source import MOST_BYTES, DocumentError, Source
from pushplan.scenario.units import fault, show
from pushplan.scenario.validation import validate
from pushplan.util.arrays import FloatArray

SIDE, AXLE, RADIUS = 0.15, 0.30, 1.008
"""Side of a block, how far the axle is behind the plate, and the least turning radius, m."""

ROOM = (4.0, 5.4)
"""Size of the room, m; the corner at its lower left is the origin."""

WALLS = {"loose": 0.5, "strict": 0.0}
"""How far outside of the room the walls are, m: the planner of ReloPush lets its robot leave the room."""


def _numbers(value: Any) -> list[float]:
    """Return the pose that the text `x,y,theta` states."""
    try:
        numbers = [float(word) for word in str(value).split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != 3:
        raise fault(show(value), "a text x,y,theta")
    return numbers


Poses = dict[str, t.Pose]


class Instance(t.Strict):
    """Blocks, where they shall go, and where the car is at first: poses [x, y, theta] in the room, m and rad."""

    blocks: Poses = Field(description="a mapping from names of blocks to poses [x, y, theta]")
    goals: Poses = Field(description="a mapping from names of goals to poses [x, y, theta]")
    assignment: dict[str, str] = Field(description="a mapping from names of blocks to names of goals")
    robot: Annotated[t.Pose, BeforeValidator(_numbers)] = Field(
        description="the pose of the axle, a text x,y,theta"
    )

    @model_validator(mode="after")
    def _known(self) -> Instance:
        for block, goal in self.assignment.items():
            if block not in self.blocks or goal not in self.goals:
                raise fault(
                    f"assigns '{block}' to '{goal}', one of which is nowhere", "names of blocks and goals"
                )
        return self

    @property
    def plate(self) -> FloatArray:
        """(3,) pose of the car's plate at first."""
        return se2.compose(np.array(self.robot), [AXLE, 0.0, 0.0])

    def target(self, block: str) -> FloatArray:
        """Return the goal (3,) of a block."""
        return np.array(self.goals[self.assignment[block]])

    def others(self, block: str) -> list[FloatArray]:
        """Return the poses (3,) of the other blocks."""
        return [np.array(pose) for name, pose in self.blocks.items() if name != block]


class _File(RootModel[tuple[Instance, ...]]):
    """One instance after the other."""


def read_instances(path: Path) -> tuple[Instance, ...]:
    """Return the instances of a file.

    Raises:
        ScenarioError: With everything found wrong and where.
    """
    try:
        with path.open("rb") as file:
            document = Source(file.read(MOST_BYTES + 1), path)
    except OSError as error:
        raise ScenarioError(str(path), [Finding("", f"cannot read the file: {error.strerror}")]) from error
    except DocumentError as error:
        raise ScenarioError(str(path), error.findings) from error
    stated = validate(_File, document)
    if stated is None:
        raise ScenarioError(str(path), document.findings)
    return stated.root


def block_scenarios(instance: Instance, name: str, walls: str = "loose") -> Iterator[tuple[str, Scenario]]:
    """Yield each block and the problem of bringing it home alone, the others in the way.

    Blocks that stand on the goal of another make it none: these are left out.

    Args:
        instance: All blocks.
        name: What the scenarios are called, with the block's name behind it.
        walls: Which of `WALLS`.

    Raises:
        ScenarioError: When a block or the robot is not free at first.
    """
    for block in instance.assignment:
        try:
            yield block, scenario_from_document(_stated(instance, block, f"{name}-{block}", walls))
        except ScenarioError as error:
            if not all(finding.where.startswith("goal") for finding in error.findings):
                raise


def _stated(instance: Instance, block: str, name: str, walls: str) -> Mapping[str, Any]:
    """Return the problem of a block as a scenario file states it."""
    start = se2.compose(np.array(instance.blocks[block]), [-0.5 * SIDE, 0.0, 0.0])
    stated = template(walls)
    return {
        **stated,
        "name": name,
        "robot": {**stated["robot"], "start": instance.plate},
        "start": start,
        "goal": {"pose": instance.target(block), "of": "block", "symmetry": 4},
        "obstacles": [{"box": [SIDE, SIDE], "pose": other} for other in instance.others(block)],
    }


def template(walls: str = "loose") -> dict[str, Any]:
    """Return what all instances have in common, as a scenario file states it; places in it stand for any."""
    out = WALLS[walls]
    return {
        "format": "pushplan/1",
        "name": "relopush",
        "floor": {"friction": 0.3},
        "objects": [{"name": "block", "shape": {"box": [SIDE, SIDE]}, "mass": 1.0}],
        "pusher": {"width": 0.285, "friction": 0.5, "thickness": 0.02},
        "robot": {
            "footprint": {"box": [0.42, 0.285], "pose": [-0.21, 0.0, 0.0]},
            "drive": {"car": {"axle": [-AXLE, 0.0, 0.0], "min_radius": RADIUS}},
            "start": [1.0, 1.0, 0.0],
        },
        "start": [1.5, 2.0, 0.0],
        "goal": {"pose": [2.0, 2.0, 0.0], "of": "block", "symmetry": 4},
        "workspace": {"x": [-out, ROOM[0] + out], "y": [-out, ROOM[1] + out]},
    }
