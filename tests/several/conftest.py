"""A box or a row of boxes in a room, and a robot elsewhere in it."""

from collections.abc import Callable
from typing import Any

import pytest

from pushplan.scenario.file import scenario_from_document
from pushplan.scenario.model import Scenario

DRIVES: dict[str, Any] = {
    "car": {"car": {"axle": [-0.3, 0.0, 0.0], "min_radius": 1.0}},
    "differential": {"differential": {"axle": [-0.3, 0.0, 0.0]}},
    "omnidirectional": "omnidirectional",
}

Problem = Callable[..., Scenario]


def problem_document(drive: str = "car", boxes: int = 1, **changes: Any) -> dict[str, Any]:
    """Return a scenario's document: boxes of 15 cm at (1, 1), the robot 1 m behind them; sections can be changed."""
    objects = [{"name": f"b{k}", "shape": {"box": [0.15, 0.15]}, "mass": 1.0} for k in range(boxes)]
    document = {
        "format": "pushplan/1",
        "name": "several",
        "floor": {"friction": 0.3},
        "objects": objects,
        "contacts": {"friction": 0.3},
        "pusher": {"width": 0.2, "friction": 0.5},
        "robot": {
            "footprint": {"box": [0.4, 0.28], "pose": [-0.215, 0.0, 0.0]},
            "drive": DRIVES[drive],
            "start": [0.0, 1.0, 0.0],
        },
        "start": [1.0, 1.0, 0.0],
        "goal": {"pose": [1.0, 2.0, 0.0], "of": "b0"},
        "pushes": {"most": 3},
        "workspace": {"x": [-2.0, 4.0], "y": [-2.0, 4.0]},
    }
    for section, value in changes.items():
        known = document.get(section)
        merged = {**known, **value} if isinstance(known, dict) and isinstance(value, dict) else value
        document[section] = merged
    return document


@pytest.fixture(scope="session")
def problem() -> Problem:
    """Return a factory of multi-push scenarios; see `problem_document`."""
    return lambda drive="car", boxes=1, **changes: scenario_from_document(problem_document(drive, boxes, **changes))
