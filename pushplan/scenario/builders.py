"""Builds scenarios in Python, with objects, plate, obstacles and goal as arguments instead of a YAML file.

The values pass the same checks as a file, and messages name the same places (`objects[1].mass`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pushplan.scenario.file import scenario_from_document
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import Obstacle
from pushplan.util.names import SCENARIO_FORMAT

Document = dict[str, Any]
"""Part of a scenario in the form of a file."""


def box(name: str, length: float, width: float, mass: float, **more: object) -> Document:
    """Return an object with a rectangular outline about its frame's origin.

    Args:
        name: Name of the object.
        length: Length along x, the direction of the push, m.
        width: Width along y, m.
        mass: Mass, kg.
        more: Other keys of an object in a file: `support`, `center_of_mass`, `floor_friction`, `offset`, `pose`.
    """
    return {"name": name, "shape": {"box": [length, width]}, "mass": mass, **more}


def polygon(name: str, outline: ArrayLike, mass: float, **more: object) -> Document:
    """Return an object with the outline (v, 2) in its own frame, m; see `box` for `more`."""
    return {"name": name, "shape": {"polygon": _numbers(outline)}, "mass": mass, **more}


def plate(width: float, friction: float | str, **more: object) -> Document:
    """Return a pusher.

    Args:
        width: Width of the plate, m.
        friction: Friction coefficient between plate and objects, or a friction angle as text, e.g. `"14 deg"`.
        more: Other keys of `pusher` in a scenario file: `thickness`, `contact_height`, `drive`, `limits`.
    """
    return {"width": width, "friction": friction, **more}


def build_scenario(
    name: str,
    objects: Sequence[Mapping[str, Any]],
    pusher: Mapping[str, Any],
    goal: ArrayLike,
    *,
    floor_friction: float | str,
    contact_friction: float | str | None = None,
    of: str | None = None,
    obstacles: Iterable[Obstacle | ArrayLike] = (),
    start: ArrayLike = (0.0, 0.0, 0.0),
    attachments: Mapping[str, bytes] | None = None,
    **more: object,
) -> Scenario:
    """Return a checked scenario.

    Args:
        name: Name of the scenario.
        objects: Objects from the pusher outward, created by `box` and `polygon`.
        pusher: Pusher, created by `plate`.
        goal: Goal pose (3,) (x, y, theta) of the object `of` in the world.
        floor_friction: Friction coefficient between floor and objects, or a friction angle as text.
        contact_friction: Friction coefficient between objects, or a friction angle as text; required for several.
        of: Name of the object that the goal is for; None for the chain frame.
        obstacles: Outlines (v, 2) in the world, m, or the obstacles of another scenario or of a map.
        start: Start pose (3,) of the chain frame in the world.
        attachments: Contents of the pressure maps that objects name.
        more: Other keys of a file, e.g. `workspace={"x": [0, 4], "y": [0, 3]}`, `stability={"margin": 0.01}`,
            `robot={"footprint": {"box": [0.42, 0.285], "pose": [-0.21, 0, 0]}}`.

    Raises:
        ScenarioError: If the scenario is invalid, with all errors.
    """
    standing = [one.document() if isinstance(one, Obstacle) else {"polygon": _numbers(one)} for one in obstacles]
    document = {
        "format": SCENARIO_FORMAT,
        "name": name,
        "floor": {"friction": floor_friction},
        "objects": list(objects),
        "contacts": {} if contact_friction is None else {"friction": contact_friction},
        "pusher": pusher,
        "start": start,
        "goal": {"pose": goal} if of is None else {"pose": goal, "of": of},
        "obstacles": standing,
        **more,
    }
    return scenario_from_document(document, Path(f"{name}.json"), attachments)


def _numbers(values: ArrayLike) -> Any:
    return np.asarray(values, dtype=np.float64).tolist()
