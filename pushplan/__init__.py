"""Plan how a robot pushes a chain of objects over a floor to a goal pose without anything slipping.

The mechanics are those of Harada, Nishiyama, Murakami and Kaneko, "Pushing manipulation for multiple objects", 2006.
Every name is loaded when it is first used, so that `import pushplan` costs next to nothing.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pushplan.chain import Chain, Contact, Drive, Limits, PushedObject, Pusher
    from pushplan.errors import (
        ChainError,
        EmptyStableSetError,
        Finding,
        ImportedFileError,
        PlanningError,
        PushplanError,
        RunLogError,
        ScenarioError,
        SupportError,
        TimingError,
        UndefinedEcofError,
    )
    from pushplan.examples import example_names, example_text
    from pushplan.friction import cof, ecof, friction_wrench
    from pushplan.logging.reader import read_run
    from pushplan.logging.recorded import RecordedRun
    from pushplan.path import PushPath
    from pushplan.plan import plan
    from pushplan.plot_run import plot_plan
    from pushplan.plot_scenario import plot_scenario
    from pushplan.plot_sets import plot_stable_sets
    from pushplan.result import Diagnosis, PlanResult, ProgressPoint, Run
    from pushplan.run import run
    from pushplan.scenario import (
        Scenario,
        check_scenario,
        load_scenario,
        scenario_from_document,
        scenario_from_text,
    )
    from pushplan.scenario_parts import (
        CircleObstacle,
        Goal,
        PlannerSettings,
        PolygonObstacle,
        StabilitySettings,
        Workspace,
    )
    from pushplan.sim.kinematic import Execution, StabilityLoss, simulate
    from pushplan.sphere import TurningRadii
    from pushplan.stable_set import StableSet, stable_set
    from pushplan.support import FeetSupport, PressureMapSupport, Support, UniformSupport, UnknownSupport
    from pushplan.trajectory import Trajectory

    __version__: str

_HOMES = {
    "chain": "Chain Contact Drive Limits PushedObject Pusher",
    "errors": "ChainError EmptyStableSetError Finding ImportedFileError PlanningError PushplanError RunLogError "
    "ScenarioError SupportError TimingError UndefinedEcofError",
    "examples": "example_names example_text",
    "friction": "cof ecof friction_wrench",
    "logging.reader": "read_run",
    "logging.recorded": "RecordedRun",
    "path": "PushPath",
    "plan": "plan",
    "plot_run": "plot_plan",
    "plot_scenario": "plot_scenario",
    "plot_sets": "plot_stable_sets",
    "result": "Diagnosis PlanResult ProgressPoint Run",
    "run": "run",
    "scenario": "Scenario check_scenario load_scenario scenario_from_document scenario_from_text",
    "scenario_parts": "CircleObstacle Goal PlannerSettings PolygonObstacle StabilitySettings Workspace",
    "sim.kinematic": "Execution StabilityLoss simulate",
    "sphere": "TurningRadii",
    "stable_set": "StableSet stable_set",
    "support": "FeetSupport PressureMapSupport Support UniformSupport UnknownSupport",
    "trajectory": "Trajectory",
}
_HOME_OF = {name: f"pushplan.{home}" for home, names in _HOMES.items() for name in names.split()}

__all__ = [
    "Chain",
    "ChainError",
    "CircleObstacle",
    "Contact",
    "Diagnosis",
    "Drive",
    "EmptyStableSetError",
    "Execution",
    "FeetSupport",
    "Finding",
    "Goal",
    "ImportedFileError",
    "Limits",
    "PlanResult",
    "PlannerSettings",
    "PlanningError",
    "PolygonObstacle",
    "PressureMapSupport",
    "ProgressPoint",
    "PushPath",
    "PushedObject",
    "Pusher",
    "PushplanError",
    "RecordedRun",
    "Run",
    "RunLogError",
    "Scenario",
    "ScenarioError",
    "StabilityLoss",
    "StabilitySettings",
    "StableSet",
    "Support",
    "SupportError",
    "TimingError",
    "Trajectory",
    "TurningRadii",
    "UndefinedEcofError",
    "UniformSupport",
    "UnknownSupport",
    "Workspace",
    "__version__",
    "check_scenario",
    "cof",
    "ecof",
    "example_names",
    "example_text",
    "friction_wrench",
    "load_scenario",
    "plan",
    "plot_plan",
    "plot_scenario",
    "plot_stable_sets",
    "read_run",
    "run",
    "scenario_from_document",
    "scenario_from_text",
    "simulate",
    "stable_set",
]


def __getattr__(name: str) -> object:
    """Load a public name (PEP 562)."""
    if name == "__version__":
        from importlib.metadata import version

        value: object = version("pushplan")
    elif name in _HOME_OF:
        value = getattr(import_module(_HOME_OF[name]), name)
    else:
        raise AttributeError(f"module 'pushplan' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names, loaded or not."""
    return sorted({*globals(), *__all__})


class _Package(ModuleType):
    """Keeps `pushplan.plan` the function: importing the module `pushplan.plan` would put the module in its place."""

    def __setattr__(self, name: str, value: object) -> None:
        if isinstance(value, ModuleType) and _HOME_OF.get(name) == value.__name__:
            value = getattr(value, name)
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
