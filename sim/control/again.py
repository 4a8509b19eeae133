"""A recorded closed loop gone through once more: the same measurements have to lead to the same twists and events."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator

import numpy as np

from pushplan.errors import PushplanError, RunLogError
from pushplan.logging.recorded import RecordedRun
from pushplan.logging.verify import Check, check_way
from pushplan.plans.execution import Execution
from pushplan.plans.run import Feedback
from pushplan.sim.control.controller import Controller
from pushplan.sim.control.sensing import Measurements, Sensor
from pushplan.sim.control.settings import ControlSettings
from pushplan.util.arrays import FloatArray

CONTROL = "pushplan.control"
"""Metadata of a closed loop's log: its settings, its sensor and its disturbances, as JSON."""
ROUNDING = 1e-6
"""Difference (m/s, rad/s) of twists that angles of measurements, read from quaternions, may make."""


def check_closed_loop(run: RecordedRun) -> list[Check]:
    """Compare what a recorded run did with what its measurements lead to, and where the plate went with its twists.

    What the objects did cannot be made again: the world that they were in is not in the log.

    Raises:
        RunLogError: When the log is none of a closed loop, or its settings cannot be read.
    """
    if run.feedback is None or run.execution is None or run.plan is None:
        raise RunLogError(str(run.path), "it holds no closed loop")
    try:
        words = run.fields[CONTROL]
        told, sensor = json.loads(words["settings"]), Sensor(**json.loads(words["sensor"]))
        settings = None if told is None else ControlSettings(**told)
    except (KeyError, TypeError, ValueError, PushplanError) as error:
        raise RunLogError(str(run.path), f"the settings of the closed loop cannot be read: {error}") from error
    checks = [check_way(run.execution)]
    if settings is not None:
        controller = Controller(run.scenario, settings, plan=run.plan)
        twists = _twists(controller, run.execution, run.feedback, sensor)
        apart = np.abs(twists - run.execution.twists).max(axis=1)
        worst = int(np.argmax(apart))
        checks.append(Check("twist", float(apart[worst]), ROUNDING, float(run.execution.t[worst])))
        checks += _said(controller, run.feedback)
    return checks


def _twists(controller: Controller, execution: Execution, feedback: Feedback, sensor: Sensor) -> FloatArray:
    """Return the twists (m, 3) of the plate frame that the recorded measurements lead to."""
    seen = Measurements.recorded(sensor, feedback.measured)
    twists = []
    for now in execution.t:
        came = seen.arrived(float(now))
        twists.append(controller.step(float(now)) if came is None else controller.step(float(now), *came))
    return np.array(twists)


def _said(controller: Controller, feedback: Feedback) -> Iterator[Check]:
    """Compare events, and the paths that were planned."""
    told = [event for event in feedback.events if event.kind != "disturbance"]  # which no controller is told
    found, expected = ([(e.kind, e.text) for e in events] for events in (told, controller.events))
    differs = next((k for k, pair in enumerate(zip(found, expected, strict=False)) if pair[0] != pair[1]), None)
    if differs is not None:
        what = f"{': '.join(found[differs])!r} instead of {': '.join(expected[differs])!r}"
        yield Check("events", math.inf, 0.0, told[differs].time, what)
    else:
        yield Check("number of events", abs(len(found) - len(expected)), 0.0)
    yield Check("number of plans on the way", abs(len(feedback.replans) - len(controller.replans)), 0.0)
    for k, (recorded, made) in enumerate(zip(feedback.replans, controller.replans, strict=False)):
        yield Check(f"plan {k + 1} on the way", _apart(recorded.result, made.result), time=recorded.time)


def _apart(first: object, second: object) -> float:
    """Return by how much the ends of two plans' arcs differ; infinite where one has none or others."""
    knots = [getattr(getattr(plan, "path", None), "knots", None) for plan in (first, second)]
    if knots[0] is None or knots[1] is None:
        return 0.0 if knots[0] is knots[1] else math.inf
    same = knots[0].shape == knots[1].shape
    return float(np.abs(knots[0] - knots[1]).max()) if same else math.inf
