"""Plan how a robot pushes a chain of objects over a floor to a goal pose without slip.

The mechanics follow Harada, Nishiyama, Murakami and Kaneko, "Pushing manipulation for multiple objects", 2006.
`import pushplan` loads only the compiled core. Every other name is loaded on first use.
"""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

_HOMES = {
    # Scenarios
    "scenario.model": "Scenario",
    "scenario.file": "load_scenario scenario_from_document scenario_from_text example_names",
    "scenario.check": "check_scenario",
    # Planning
    "planner": "plan Planner",
    "plans.plan": "Plan",
    "plans.segment": "Segment",
    "plans.load": "Load",
    "plans.settings": "PlanSettings Observer",
    # Runs and logs
    "run": "run",
    "plans.execution": "Execution",
    "plans.run": "Run",
    "logging.reader": "load_run read_run",
    "verification": "verify_log",
    # Execution
    "sim.slip": "simulate",
    "slip.simulator": "SlipSimulator",
    "slip.world": "World",
    "trial": "trial",
    "identify": "identify",
    "sim.control.controller": "Controller",
    "sim.follower": "Follower",
    # Mechanics
    "mechanics.chain": "Chain",
    "sets.stable_set": "StableSet",
    "sets.named": "stable_set",
    "mechanics.contacts": "friction_wrench ecof",
    "plans.robustness": "Robustness",
    # Pictures
    "drawing.plans": "plot_plan plot_scenario",
    "drawing.sets": "plot_stable_sets",
    # Errors
    "errors": "PushplanError ScenarioError PlanningError EmptyStableSetError RunLogError",
}
_HOME_OF = {name: f"pushplan.{home}" for home, names in _HOMES.items() for name in names.split()}

if TYPE_CHECKING:  # type checkers treat a name imported `as` itself as exported
    from pushplan.drawing.plans import plot_plan as plot_plan
    from pushplan.drawing.plans import plot_scenario as plot_scenario
    from pushplan.drawing.sets import plot_stable_sets as plot_stable_sets
    from pushplan.errors import EmptyStableSetError as EmptyStableSetError
    from pushplan.errors import PlanningError as PlanningError
    from pushplan.errors import PushplanError as PushplanError
    from pushplan.errors import RunLogError as RunLogError
    from pushplan.errors import ScenarioError as ScenarioError
    from pushplan.identify import identify as identify
    from pushplan.logging.reader import load_run as load_run
    from pushplan.logging.reader import read_run as read_run
    from pushplan.mechanics.chain import Chain as Chain
    from pushplan.mechanics.contacts import ecof as ecof
    from pushplan.mechanics.contacts import friction_wrench as friction_wrench
    from pushplan.planner import Planner as Planner
    from pushplan.planner import plan as plan
    from pushplan.plans.execution import Execution as Execution
    from pushplan.plans.load import Load as Load
    from pushplan.plans.plan import Plan as Plan
    from pushplan.plans.robustness import Robustness as Robustness
    from pushplan.plans.run import Run as Run
    from pushplan.plans.segment import Segment as Segment
    from pushplan.plans.settings import Observer as Observer
    from pushplan.plans.settings import PlanSettings as PlanSettings
    from pushplan.run import run as run
    from pushplan.scenario.check import check_scenario as check_scenario
    from pushplan.scenario.file import example_names as example_names
    from pushplan.scenario.file import load_scenario as load_scenario
    from pushplan.scenario.file import scenario_from_document as scenario_from_document
    from pushplan.scenario.file import scenario_from_text as scenario_from_text
    from pushplan.scenario.model import Scenario as Scenario
    from pushplan.sets.named import stable_set as stable_set
    from pushplan.sets.stable_set import StableSet as StableSet
    from pushplan.sim.control.controller import Controller as Controller
    from pushplan.sim.follower import Follower as Follower
    from pushplan.sim.slip import simulate as simulate
    from pushplan.slip.simulator import SlipSimulator as SlipSimulator
    from pushplan.slip.world import World as World
    from pushplan.trial import trial as trial
    from pushplan.verification import verify_log as verify_log

    __version__: str
else:
    __all__ = ["__version__", *_HOME_OF]


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
    """Return all public names, including those that are not loaded yet."""
    return sorted({*globals(), *_HOME_OF, "__version__"})


class _Package(ModuleType):
    """Keeps `pushplan.trial` a function: importing the module `pushplan.trial` would replace it by the module."""

    def __setattr__(self, name: str, value: object) -> None:
        if isinstance(value, ModuleType) and _HOME_OF.get(name) == value.__name__:
            value = getattr(value, name)
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package

import_module("pushplan.util.interruption").import_uninterrupted("pushplan.core")

_CORE = Path(__file__).with_name("core")
if (_CORE / "module.cpp").is_file():  # in a checkout, the sources can be newer than the built core
    import_module("pushplan.util.checkout").require_present_core(_CORE)
