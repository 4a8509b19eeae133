"""Trials in words: what the user asks for, the table of what came out, the JSON object."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING

from pushplan.cli.steps.named_numbers import number, pairs
from pushplan.cli.terminal.numbers import angle_text, length_text
from pushplan.scenario import units

if TYPE_CHECKING:
    from pushplan.sim.trials.result import Trials
    from pushplan.sim.trials.uncertain import TrialUncertainty

UNITS = {
    **dict.fromkeys(("contact_friction", "floor_friction", "mass", "load"), units.FRACTION),
    "position": units.LENGTH,
    "angle": units.ANGLE,
}
"""What may be uncertain, and the units of its numbers; plain numbers are shares, m and rad."""


def uncertainty(text: str) -> TrialUncertainty:
    """Return what `--uncertainty` says; argparse's `type`."""
    from pushplan.errors import PushplanError
    from pushplan.sim.trials.uncertain import TrialUncertainty

    found = {name: number(name, value, UNITS[name]) for name, value in pairs(text, UNITS, "NUMBER")}
    try:
        return TrialUncertainty(**{**dict.fromkeys(UNITS, 0.0), **found})
    except PushplanError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def rows(trials: Trials) -> list[tuple[str, str]]:
    """Return label and value of the numbers of trials, for people."""
    position, angle = _percentiles(trials)
    of = trials.scenario.goal.of or "worst object"
    failed = ", ".join(f"{name} {count}" for name, count in trials.first_failures.items())
    found = [
        ("worlds", trials.uncertainty.words if trials.uncertainty else _stated(trials)),
        ("contacts held", f"in {100.0 * trials.held:.1f} %"),
        ("first to move", failed or "none"),
        (f"{of} off", f"median {_off(position[0], angle[0])}, 90 % within {_off(position[1], angle[1])}"),
        ("at most", _off(position[2], angle[2])),
    ]
    return [*found, ("jammed", f"{trials.jammed.sum()}")] if trials.jammed.any() else found


def _percentiles(trials: Trials) -> list[list[float]]:
    """Return median, 90th percentile and maximum of the position's and the angle's error, m and rad."""
    import numpy as np

    found: list[list[float]] = np.percentile(trials.goal_errors, [50, 90, 100], axis=0).T.tolist()
    return found


def _stated(trials: Trials) -> str:
    from pushplan.sim.trials.uncertain import TrialUncertainty

    if trials.scenario.interval is None:
        return TrialUncertainty().words
    default = TrialUncertainty()
    aside = f"objects aside ±{1e3 * default.position:.3g} mm and turned ±{degrees(default.angle):.3g} deg"
    return f"the scenario's intervals, {aside}"


def _off(position: float, angle: float) -> str:
    return f"{length_text(position)} / {angle_text(angle)}"


def document(trials: Trials, worst: Path | None) -> dict[str, object]:
    """Return the JSON object of trials."""
    position, angle = _percentiles(trials)
    return {
        "scenario": trials.scenario.name,
        "solved": True,
        "samples": trials.samples,
        "seed": trials.seed,
        "uncertainty": None if trials.uncertainty is None else asdict(trials.uncertainty),
        "arrived": int(trials.arrived.sum()),
        "success": trials.success,
        "interval": list(trials.interval),
        "held": trials.held,
        "jammed": int(trials.jammed.sum()),
        "first_failures": trials.first_failures,
        "failures": [
            {
                "sample": i,
                "contact": trials.scenario.chain.contact_name(loss.contact),
                "mode": loss.mode.name.lower(),
                "time": loss.time,
                "point": loss.point,
            }
            for i, loss in enumerate(trials.losses)
            if loss is not None
        ],
        "goal_error": {
            name: {"median": values[0], "p90": values[1], "max": values[2]}
            for name, values in (("position", position), ("angle", angle))
        },
        "worst": {"sample": trials.worst, "log": worst},
    }
