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
    from pushplan.closed_loop import ClosedLoopRun, run_closed_loop
    from pushplan.control.controller import Controller
    from pushplan.control.sensor import Sensor
    from pushplan.control.settings import ControlSettings
    from pushplan.drawing.run import plot_plan
    from pushplan.drawing.scenario import plot_scenario
    from pushplan.drawing.sets import plot_stable_sets
    from pushplan.drawing.speeds import plot_admissible_speeds
    from pushplan.errors import (
        ChainError,
        EmptyStableSetError,
        Finding,
        ImportedFileError,
        OutputError,
        PlanningError,
        PushplanError,
        RunLogError,
        ScenarioError,
        SupportError,
        TimingError,
        UndefinedEcofError,
    )
    from pushplan.examples import example_names, example_text
    from pushplan.execution import Execution, StabilityLoss
    from pushplan.following.follower import Command, Follower, FollowerState
    from pushplan.identify import identify
    from pushplan.logging.messages.recorded import RecordedRun
    from pushplan.logging.reader import read_run, read_runs
    from pushplan.mechanics.chain import Chain, Contact, Drive, Limits, PushedObject, Pusher
    from pushplan.mechanics.contacts.friction import cof, ecof, friction_wrench
    from pushplan.mechanics.dynamics.admissible_speeds import AdmissibleSpeeds, SpeedWindow, admissible_speeds
    from pushplan.mechanics.dynamics.contact_dynamics import DynamicRows, dynamic_margins, dynamic_rows
    from pushplan.mechanics.sphere import TurningRadii
    from pushplan.mechanics.support import (
        FeetSupport,
        PressureMapSupport,
        Support,
        UniformSupport,
        UnknownSupport,
    )
    from pushplan.mechanics.worst_case.interval_chain import IntervalChain
    from pushplan.path import PushPath
    from pushplan.plan import plan
    from pushplan.push_queries import PushQueries
    from pushplan.queries import Queries
    from pushplan.reading.imported.outlines import read_csv_outlines, read_svg_outlines
    from pushplan.reading.imported.ros_map import RosMap, read_ros_map
    from pushplan.reading.scenario_check import check_scenario
    from pushplan.reading.scenario_file import load_scenario, scenario_from_document, scenario_from_text
    from pushplan.reading.several_objects import SeveralObjects, load_several_objects
    from pushplan.rearrangement.plan import Leg, Rearrangement, Rearranging
    from pushplan.recording import IncompleteLogError
    from pushplan.result import Diagnosis, PlanResult, ProgressPoint, Run
    from pushplan.run import run
    from pushplan.scenario import Scenario
    from pushplan.scenario_parts import (
        CircleObstacle,
        Goal,
        PlannerSettings,
        PolygonObstacle,
        Snapped,
        Snapping,
        StabilitySettings,
        Uncertainty,
        Workspace,
    )
    from pushplan.sim.identify.course import Course
    from pushplan.sim.identify.identification import Estimate, Identification
    from pushplan.sim.identify.identify import identify_courses
    from pushplan.sim.kinematic import simulate_rigid
    from pushplan.sim.slip.report import ContactLoss, Mode, SlipReport
    from pushplan.sim.slip.settings import SlipSettings
    from pushplan.sim.slip.simulate import simulate
    from pushplan.sim.slip.simulator import SlipSimulator
    from pushplan.sim.trials.result import Trials
    from pushplan.sim.trials.uncertain import TrialUncertainty
    from pushplan.sim.worlds.kick import Kick
    from pushplan.sim.worlds.world import World
    from pushplan.stable_sets.grid_cor_set import GridCorSet, grid_cor_set
    from pushplan.stable_sets.interval_set import stable_set_over
    from pushplan.stable_sets.named import stable_set
    from pushplan.stable_sets.robust_set import RobustSet, WorstCase
    from pushplan.stable_sets.stable_set import StableSet
    from pushplan.tolerance.tolerance import Tolerance
    from pushplan.trajectory import Trajectory
    from pushplan.trial import trial

    __version__: str

_HOMES = {
    "mechanics.chain": "Chain Contact Drive Limits PushedObject Pusher",
    "errors": "ChainError EmptyStableSetError Finding ImportedFileError OutputError PlanningError PushplanError "
    "RunLogError ScenarioError SupportError TimingError UndefinedEcofError",
    "examples": "example_names example_text",
    "mechanics.contacts.friction": "cof ecof friction_wrench",
    "following.follower": "Command Follower FollowerState",
    "logging.reader": "read_run read_runs",
    "logging.messages.recorded": "RecordedRun",
    "path": "PushPath",
    "recording": "IncompleteLogError",
    "plan": "plan",
    "push_queries": "PushQueries",
    "queries": "Queries",
    "drawing.run": "plot_plan",
    "drawing.scenario": "plot_scenario",
    "drawing.sets": "plot_stable_sets",
    "result": "Diagnosis PlanResult ProgressPoint Run",
    "run": "run",
    "scenario": "Scenario",
    "reading.imported.outlines": "read_csv_outlines read_svg_outlines",
    "reading.imported.ros_map": "RosMap read_ros_map",
    "reading.scenario_check": "check_scenario",
    "reading.scenario_file": "load_scenario scenario_from_document scenario_from_text",
    "reading.several_objects": "SeveralObjects load_several_objects",
    "rearrangement.plan": "Leg Rearrangement Rearranging",
    "scenario_parts": "CircleObstacle Goal PlannerSettings PolygonObstacle Snapped Snapping StabilitySettings "
    "Uncertainty Workspace",
    "execution": "Execution StabilityLoss",
    "identify": "identify",
    "sim.identify.course": "Course",
    "sim.identify.identification": "Estimate Identification",
    "sim.identify.identify": "identify_courses",
    "sim.kinematic": "simulate_rigid",
    "sim.slip.report": "ContactLoss Mode SlipReport",
    "sim.slip.settings": "SlipSettings",
    "sim.slip.simulate": "simulate",
    "sim.slip.simulator": "SlipSimulator",
    "sim.worlds.world": "World",
    "sim.worlds.kick": "Kick",
    "closed_loop": "ClosedLoopRun run_closed_loop",
    "control.controller": "Controller",
    "control.sensor": "Sensor",
    "control.settings": "ControlSettings",
    "mechanics.sphere": "TurningRadii",
    "stable_sets.named": "stable_set",
    "stable_sets.stable_set": "StableSet",
    "mechanics.support": "FeetSupport PressureMapSupport Support UniformSupport UnknownSupport",
    "tolerance.tolerance": "Tolerance",
    "trajectory": "Trajectory",
    "trial": "trial",
    "sim.trials.result": "Trials",
    "sim.trials.uncertain": "TrialUncertainty",
    "drawing.speeds": "plot_admissible_speeds",
    "mechanics.dynamics.admissible_speeds": "AdmissibleSpeeds SpeedWindow admissible_speeds",
    "mechanics.dynamics.contact_dynamics": "DynamicRows dynamic_margins dynamic_rows",
    "mechanics.worst_case.interval_chain": "IntervalChain",
    "stable_sets.grid_cor_set": "GridCorSet grid_cor_set",
    "stable_sets.interval_set": "stable_set_over",
    "stable_sets.robust_set": "RobustSet WorstCase",
}
_HOME_OF = {name: f"pushplan.{home}" for home, names in _HOMES.items() for name in names.split()}

__all__ = [
    "AdmissibleSpeeds",
    "Chain",
    "ChainError",
    "CircleObstacle",
    "ClosedLoopRun",
    "Command",
    "Contact",
    "ContactLoss",
    "ControlSettings",
    "Controller",
    "Course",
    "Diagnosis",
    "Drive",
    "DynamicRows",
    "EmptyStableSetError",
    "Estimate",
    "Execution",
    "FeetSupport",
    "Finding",
    "Follower",
    "FollowerState",
    "Goal",
    "GridCorSet",
    "Identification",
    "ImportedFileError",
    "IncompleteLogError",
    "IntervalChain",
    "Kick",
    "Leg",
    "Limits",
    "Mode",
    "OutputError",
    "PlanResult",
    "PlannerSettings",
    "PlanningError",
    "PolygonObstacle",
    "PressureMapSupport",
    "ProgressPoint",
    "PushPath",
    "PushQueries",
    "PushedObject",
    "Pusher",
    "PushplanError",
    "Queries",
    "Rearrangement",
    "Rearranging",
    "RecordedRun",
    "RobustSet",
    "RosMap",
    "Run",
    "RunLogError",
    "Scenario",
    "ScenarioError",
    "Sensor",
    "SeveralObjects",
    "SlipReport",
    "SlipSettings",
    "SlipSimulator",
    "Snapped",
    "Snapping",
    "SpeedWindow",
    "StabilityLoss",
    "StabilitySettings",
    "StableSet",
    "Support",
    "SupportError",
    "TimingError",
    "Tolerance",
    "Trajectory",
    "TrialUncertainty",
    "Trials",
    "TurningRadii",
    "Uncertainty",
    "UndefinedEcofError",
    "UniformSupport",
    "UnknownSupport",
    "Workspace",
    "World",
    "WorstCase",
    "__version__",
    "admissible_speeds",
    "check_scenario",
    "cof",
    "dynamic_margins",
    "dynamic_rows",
    "ecof",
    "example_names",
    "example_text",
    "friction_wrench",
    "grid_cor_set",
    "identify",
    "identify_courses",
    "load_scenario",
    "load_several_objects",
    "plan",
    "plot_admissible_speeds",
    "plot_plan",
    "plot_scenario",
    "plot_stable_sets",
    "read_csv_outlines",
    "read_ros_map",
    "read_run",
    "read_runs",
    "read_svg_outlines",
    "run",
    "run_closed_loop",
    "scenario_from_document",
    "scenario_from_text",
    "simulate",
    "simulate_rigid",
    "stable_set",
    "stable_set_over",
    "trial",
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
