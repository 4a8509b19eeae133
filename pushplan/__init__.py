"""Plan how a robot pushes a chain of objects over a floor to a goal pose without anything slipping.

The mechanics are those of Harada, Nishiyama, Murakami and Kaneko, "Pushing manipulation for multiple objects", 2006.
Every name is loaded when it is first used, so that `import pushplan` costs next to nothing.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

_HOMES = {
    "mechanics.chain": "Chain Contact Drive Limits PushedObject Pusher",
    "errors": "ChainError EmptyStableSetError Finding ImportedFileError OutputError PlanningError PushplanError "
    "RunLogError ScenarioError SupportError TimingError UndefinedEcofError",
    "mechanics.contacts.friction": "cof ecof friction_wrench",
    "sim.follower": "Command Follower FollowerState",
    "logging.old.reader": "read_run read_runs",
    "logging.old.messages.recorded": "RecordedRun",
    "plans.path": "PushPath",
    "recording": "IncompleteLogError",
    "plan": "plan",
    "push_queries": "PushQueries",
    "planners.planner": "Planner",
    "queries": "Queries",
    "drawing.plans": "plot_plan plot_scenario",
    "drawing.sets": "plot_admissible_speeds plot_stable_sets",
    "plans.result": "Diagnosis PlanResult ProgressPoint Run",
    "run": "run",
    "scenario.model": "Scenario",
    "scenario.drawings": "read_csv_outlines read_svg_outlines",
    "scenario.maps": "RosMap read_ros_map",
    "scenario.check": "check_scenario",
    "scenario.file": "example_names example_text load_scenario scenario_from_document scenario_from_text",
    "rearrangement.plan": "Leg Rearrangement Rearranging",
    "scenario.parts": "CircleObstacle Goal PlannerSettings PolygonObstacle Snapped Snapping StabilitySettings "
    "Uncertainty Workspace",
    "plans.execution": "Execution StabilityLoss",
    "identify": "identify",
    "sim.identify.course": "Course",
    "sim.identify.result": "Estimate Identification",
    "sim.identify.identify": "identify_courses",
    "sim.report": "ContactLoss ContactReport Mode",
    "sim.slip.simulator": "SlipSettings SlipSimulator simulate",
    "sim.physics.simulate": "simulate_in_physics",
    "sim.world": "World",
    "sim.control.course": "Kick",
    "closed_loop": "ClosedLoopRun run_closed_loop",
    "sim.control.controller": "Controller",
    "sim.control.sensing": "Sensor",
    "sim.control.settings": "ControlSettings",
    "mechanics.sphere": "TurningRadii",
    "sets.named": "stable_set",
    "sets.stable_set": "StableSet",
    "mechanics.support": "FeetSupport PressureMapSupport Support UniformSupport UnknownSupport",
    "plans.robustness": "Robustness",
    "plans.trajectory": "Trajectory",
    "trial": "trial",
    "sim.trials": "TrialUncertainty Trials",
    "mechanics.dynamics.admissible_speeds": "AdmissibleSpeeds SpeedWindow admissible_speeds",
    "mechanics.dynamics.contact_dynamics": "DynamicRows dynamic_margins dynamic_rows",
    "mechanics.intervals": "IntervalChain",
    "sets.grid_cor_set": "GridCorSet grid_cor_set",
    "sets.interval_set": "stable_set_over",
    "sets.robust_set": "RobustSet WorstCase",
}
_HOME_OF = {name: f"pushplan.{home}" for home, names in _HOMES.items() for name in names.split()}

if TYPE_CHECKING:  # each name `as` itself: what checkers take for exported without a list of its own
    from pushplan.closed_loop import ClosedLoopRun as ClosedLoopRun
    from pushplan.closed_loop import run_closed_loop as run_closed_loop
    from pushplan.drawing.plans import plot_plan as plot_plan
    from pushplan.drawing.plans import plot_scenario as plot_scenario
    from pushplan.drawing.sets import plot_admissible_speeds as plot_admissible_speeds
    from pushplan.drawing.sets import plot_stable_sets as plot_stable_sets
    from pushplan.errors import ChainError as ChainError
    from pushplan.errors import EmptyStableSetError as EmptyStableSetError
    from pushplan.errors import Finding as Finding
    from pushplan.errors import ImportedFileError as ImportedFileError
    from pushplan.errors import OutputError as OutputError
    from pushplan.errors import PlanningError as PlanningError
    from pushplan.errors import PushplanError as PushplanError
    from pushplan.errors import RunLogError as RunLogError
    from pushplan.errors import ScenarioError as ScenarioError
    from pushplan.errors import SupportError as SupportError
    from pushplan.errors import TimingError as TimingError
    from pushplan.errors import UndefinedEcofError as UndefinedEcofError
    from pushplan.identify import identify as identify
    from pushplan.logging.old.messages.recorded import RecordedRun as RecordedRun
    from pushplan.logging.old.reader import read_run as read_run
    from pushplan.logging.old.reader import read_runs as read_runs
    from pushplan.mechanics.chain import Chain as Chain
    from pushplan.mechanics.chain import Contact as Contact
    from pushplan.mechanics.chain import Drive as Drive
    from pushplan.mechanics.chain import Limits as Limits
    from pushplan.mechanics.chain import PushedObject as PushedObject
    from pushplan.mechanics.chain import Pusher as Pusher
    from pushplan.mechanics.contacts.friction import cof as cof
    from pushplan.mechanics.contacts.friction import ecof as ecof
    from pushplan.mechanics.contacts.friction import friction_wrench as friction_wrench
    from pushplan.mechanics.dynamics.admissible_speeds import AdmissibleSpeeds as AdmissibleSpeeds
    from pushplan.mechanics.dynamics.admissible_speeds import SpeedWindow as SpeedWindow
    from pushplan.mechanics.dynamics.admissible_speeds import admissible_speeds as admissible_speeds
    from pushplan.mechanics.dynamics.contact_dynamics import DynamicRows as DynamicRows
    from pushplan.mechanics.dynamics.contact_dynamics import dynamic_margins as dynamic_margins
    from pushplan.mechanics.dynamics.contact_dynamics import dynamic_rows as dynamic_rows
    from pushplan.mechanics.intervals import IntervalChain as IntervalChain
    from pushplan.mechanics.sphere import TurningRadii as TurningRadii
    from pushplan.mechanics.support import FeetSupport as FeetSupport
    from pushplan.mechanics.support import PressureMapSupport as PressureMapSupport
    from pushplan.mechanics.support import Support as Support
    from pushplan.mechanics.support import UniformSupport as UniformSupport
    from pushplan.mechanics.support import UnknownSupport as UnknownSupport
    from pushplan.plan import plan as plan
    from pushplan.planners.planner import Planner as Planner
    from pushplan.plans.execution import Execution as Execution
    from pushplan.plans.execution import StabilityLoss as StabilityLoss
    from pushplan.plans.path import PushPath as PushPath
    from pushplan.plans.result import Diagnosis as Diagnosis
    from pushplan.plans.result import PlanResult as PlanResult
    from pushplan.plans.result import ProgressPoint as ProgressPoint
    from pushplan.plans.result import Run as Run
    from pushplan.plans.robustness import Robustness as Robustness
    from pushplan.plans.trajectory import Trajectory as Trajectory
    from pushplan.push_queries import PushQueries as PushQueries
    from pushplan.queries import Queries as Queries
    from pushplan.rearrangement.plan import Leg as Leg
    from pushplan.rearrangement.plan import Rearrangement as Rearrangement
    from pushplan.rearrangement.plan import Rearranging as Rearranging
    from pushplan.recording import IncompleteLogError as IncompleteLogError
    from pushplan.run import run as run
    from pushplan.scenario.check import check_scenario as check_scenario
    from pushplan.scenario.drawings import read_csv_outlines as read_csv_outlines
    from pushplan.scenario.drawings import read_svg_outlines as read_svg_outlines
    from pushplan.scenario.file import example_names as example_names
    from pushplan.scenario.file import example_text as example_text
    from pushplan.scenario.file import load_scenario as load_scenario
    from pushplan.scenario.file import scenario_from_document as scenario_from_document
    from pushplan.scenario.file import scenario_from_text as scenario_from_text
    from pushplan.scenario.maps import RosMap as RosMap
    from pushplan.scenario.maps import read_ros_map as read_ros_map
    from pushplan.scenario.model import Scenario as Scenario
    from pushplan.scenario.parts import CircleObstacle as CircleObstacle
    from pushplan.scenario.parts import Goal as Goal
    from pushplan.scenario.parts import PlannerSettings as PlannerSettings
    from pushplan.scenario.parts import PolygonObstacle as PolygonObstacle
    from pushplan.scenario.parts import Snapped as Snapped
    from pushplan.scenario.parts import Snapping as Snapping
    from pushplan.scenario.parts import StabilitySettings as StabilitySettings
    from pushplan.scenario.parts import Uncertainty as Uncertainty
    from pushplan.scenario.parts import Workspace as Workspace
    from pushplan.sets.grid_cor_set import GridCorSet as GridCorSet
    from pushplan.sets.grid_cor_set import grid_cor_set as grid_cor_set
    from pushplan.sets.interval_set import stable_set_over as stable_set_over
    from pushplan.sets.named import stable_set as stable_set
    from pushplan.sets.robust_set import RobustSet as RobustSet
    from pushplan.sets.robust_set import WorstCase as WorstCase
    from pushplan.sets.stable_set import StableSet as StableSet
    from pushplan.sim.control.controller import Controller as Controller
    from pushplan.sim.control.course import Kick as Kick
    from pushplan.sim.control.sensing import Sensor as Sensor
    from pushplan.sim.control.settings import ControlSettings as ControlSettings
    from pushplan.sim.follower import Command as Command
    from pushplan.sim.follower import Follower as Follower
    from pushplan.sim.follower import FollowerState as FollowerState
    from pushplan.sim.identify.course import Course as Course
    from pushplan.sim.identify.identify import identify_courses as identify_courses
    from pushplan.sim.identify.result import Estimate as Estimate
    from pushplan.sim.identify.result import Identification as Identification
    from pushplan.sim.physics.simulate import simulate_in_physics as simulate_in_physics
    from pushplan.sim.report import ContactLoss as ContactLoss
    from pushplan.sim.report import ContactReport as ContactReport
    from pushplan.sim.report import Mode as Mode
    from pushplan.sim.slip.simulator import SlipSettings as SlipSettings
    from pushplan.sim.slip.simulator import SlipSimulator as SlipSimulator
    from pushplan.sim.slip.simulator import simulate as simulate
    from pushplan.sim.trials import Trials as Trials
    from pushplan.sim.trials import TrialUncertainty as TrialUncertainty
    from pushplan.sim.world import World as World
    from pushplan.trial import trial as trial

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
    """Return the public names, loaded or not."""
    return sorted({*globals(), *_HOME_OF, "__version__"})


class _Package(ModuleType):
    """Keeps `pushplan.plan` the function: importing the module `pushplan.plan` would put the module in its place."""

    def __setattr__(self, name: str, value: object) -> None:
        if isinstance(value, ModuleType) and _HOME_OF.get(name) == value.__name__:
            value = getattr(value, name)
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
