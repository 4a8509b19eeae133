"""What happens in the world of `pushplan run`, as the user asks for it."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from pushplan.cli.steps.named_numbers import number, pairs
from pushplan.scenario import units

if TYPE_CHECKING:
    from pushplan.scenario.model import Scenario
    from pushplan.sim.control.sensor import Sensor
    from pushplan.sim.worlds.kick import Kick

_TIME = {"s": 1.0, "ms": 1e-3}
_RATE = {"Hz": 1.0}
SENSOR = {"rate": _RATE, "delay": _TIME, "position": units.LENGTH, "angle": units.ANGLE}
"""What a sensor is like, and the units of its numbers; plain numbers are Hz, s, m and rad."""
KICK = {"time": _TIME, "x": units.LENGTH, "y": units.LENGTH, "turn": units.ANGLE}
"""What a kick is like beside its object; plain numbers are s, m and rad."""


def sensor(text: str) -> Sensor:
    """Return what `--sensor` says; argparse's `type`."""
    from pushplan.errors import PushplanError
    from pushplan.sim.control.sensor import Sensor

    try:
        return Sensor(
            **{name: number(name, value, SENSOR[name]) for name, value in pairs(text, SENSOR, "VALUE")}
        )
    except PushplanError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def kick(text: str) -> dict[str, Any]:
    """Return what `--kick` says, the object by its name; argparse's `type`."""
    found: dict[str, Any] = dict.fromkeys(KICK, 0.0)
    for name, value in pairs(text, [*KICK, "object"], "VALUE"):
        found[name] = value if name == "object" else number(name, value, KICK[name])
    for needed in ("time", "object"):
        if not found.get(needed):
            raise argparse.ArgumentTypeError(f"'{text}' does not state the {needed} of the kick")
    return found


def kicks_of(scenario: Scenario, asked: list[dict[str, Any]]) -> list[Kick]:
    """Return kicks with the indices of their objects.

    Raises:
        ChainError: When there is no such object.
    """
    from pushplan.sim.worlds.kick import Kick

    return [
        Kick(one["time"], scenario.chain.index_of(one["object"]), one["x"], one["y"], one["turn"])
        for one in asked
    ]
