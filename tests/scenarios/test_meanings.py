"""Scenario files mean what they meant: `meanings.json` holds texts and what an earlier version read in them.

Packaged scenarios, examples and those of the docs, as they were on 25 November 2026. The numbers are those of
`Scenario.resolved()` and of the chain; keys may be added, but none may change.
"""

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pushplan
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray

STATED: dict[str, Any] = json.loads(Path(__file__).with_name("meanings.json").read_text("utf-8"))
OFFICE = Path(__file__).parents[2] / "examples" / "office"
FEW = 20
"""Obstacles up to which each is compared; of a map, whose polygons are many, their number and sums."""


@pytest.mark.parametrize("name", STATED)
def test_a_file_of_before_means_the_same(name: str) -> None:
    text = "\n".join(STATED[name]["text"])
    maps = {file.name: file.read_bytes() for file in OFFICE.iterdir() if "map: " in text}
    scenario = pushplan.scenario_from_text(text, "__frozen.yaml", maps)
    if "movable" not in STATED[name]:
        assert list(_changed(STATED[name]["meaning"], _meaning(scenario))) == []
        return
    assert [body for body in scenario.bodies if body not in scenario.goals] == STATED[name]["movable"]
    for body, meant in STATED[name]["meaning"].items():
        assert list(_changed(meant, _meaning(scenario.alone(body)))) == []


def _changed(before: Any, now: Any, place: str = "") -> Iterator[str]:
    """Yield the places at which what was read before is missing or another."""
    if isinstance(before, dict):
        for key, value in before.items():
            if not isinstance(now, dict) or key not in now:
                yield f"{place}.{key} is gone"
            else:
                yield from _changed(value, now[key], f"{place}.{key}")
    elif isinstance(before, list) and isinstance(now, list | tuple) and len(before) == len(now):
        for i, (one, other) in enumerate(zip(before, now, strict=True)):
            yield from _changed(one, other, f"{place}[{i}]")
    elif isinstance(before, float) and isinstance(now, float):
        if not math.isclose(before, now, rel_tol=1e-12, abs_tol=1e-12):
            yield f"{place}: {before!r} became {now!r}"
    elif before != now:
        yield f"{place}: {before!r} became {now!r}"


def _meaning(scenario: Scenario) -> dict[str, Any]:
    """Return the numbers of a scenario of one load."""
    chain, pusher, pushes = scenario.chain, scenario.chain.pusher, scenario.pushes
    meant = scenario.resolved()
    if meant["name"] == "__frozen":
        meant["name"] = ""
    if len(scenario.obstacles) > FEW:
        corners = np.concatenate(
            [getattr(obstacle, "outline", np.empty((0, 2))) for obstacle in scenario.obstacles]
        )
        sums = {"sum": _plain(corners.sum(axis=0)), "squares": _plain((corners**2).sum(axis=0))}
        meant["obstacles"] = {"count": len(scenario.obstacles), "corners": len(corners), **sums}
    meant["chain"] = {
        "contacts": [
            [c.pusher, c.pushed, _plain(c.right), _plain(c.left), c.friction] for c in chain.contacts
        ],
        "objects": [
            [
                obj.mass,
                obj.floor_friction,
                _plain(obj.outline),
                _plain(obj.pose_chain),
                type(obj.support).__name__,
                obj.support.known,
            ]
            for obj in chain.objects
        ],
        "plate": _plain(pusher.outline),
        "friction": pusher.friction,
        "footprint": [_plain(part) for part in pusher.footprint],
        "base": _plain(pusher.base_pose),
        "drive": [pusher.drive.kind, _plain(pusher.drive.axle), pusher.drive.min_radius],
        "contact_friction": _plain(scenario.contact_friction),
    }
    if scenario.interval is not None:
        interval = scenario.interval
        meant["interval"] = {
            "mass": _plain(interval.mass),
            "floor_friction": _plain(interval.floor_friction),
            "fractions": {str(k): _plain(spans) for k, spans in interval.fractions.items()},
            "pressures": {str(k): share for k, share in interval.pressures.items()},
        }
    goals = (scenario.goal,) if pushes is None else pushes.goals
    meant["goal_chain"] = [_plain(goal.pose_chain) for goal in goals]
    if pushes is not None:
        meant["robot_start"] = _plain(scenario.robot_start)
    return meant


def _plain(array: FloatArray | None) -> Any:
    return None if array is None else np.asarray(array, dtype=np.float64).tolist()
