"""Scenarios from Python: objects, plate, obstacles and goal as arguments instead of a YAML file.

The values go through the same checks as a file's, and messages name the same places (`objects[1].mass`).
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
"""A part of a scenario in the form that it has in a file."""


def box(name: str, length: float, width: float, mass: float, **more: object) -> Document:
    """Return an object with a rectangular outline about its frame's origin.

    Args:
        name: Of the object.
        length: Along x, the direction of the push, m.
        width: Along y, m.
        mass: kg.
        more: Other keys of an object in a file: `support`, `center_of_mass`, `floor_friction`, `offset`, `pose`.
    """
    return {"name": name, "shape": {"box": [length, width]}, "mass": mass, **more}


def polygon(name: str, outline: ArrayLike, mass: float, **more: object) -> Document:
    """Return an object with the outline (v, 2) in its own frame, m; `more` as for `box`."""
    return {"name": name, "shape": {"polygon": _numbers(outline)}, "mass": mass, **more}


def plate(width: float, friction: float | str, **more: object) -> Document:
    """Return a pusher.

    Args:
        width: Of the plate, m.
        friction: Coefficient between plate and objects, or an angle as text, e.g. `"14 deg"`.
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
        name: Of the scenario.
        objects: From the pusher outward, made by `box` and `polygon`.
        pusher: Made by `plate`.
        goal: (3,) pose (x, y, theta) in the world to bring the object `of` to.
        floor_friction: Coefficient between floor and objects, or an angle as text.
        contact_friction: Likewise between objects; needed when there are several.
        of: Name of the object that the goal is stated for; None stands for the chain frame.
        obstacles: Outlines (v, 2) in the world, m, or the obstacles of another scenario or of a map.
        start: (3,) pose of the chain frame in the world.
        attachments: Contents of the pressure maps that objects name.
        more: Other keys of a file, e.g. `workspace={"x": [0, 4], "y": [0, 3]}`, `stability={"margin": 0.01}`,
            `robot={"footprint": {"box": [0.42, 0.285], "pose": [-0.21, 0, 0]}}`.

    Raises:
        ScenarioError: With everything found wrong.
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
