"""Forged logs that are otherwise sound: plans that are invalid in the stated scenario, or wrong numbers.

A forger has all of pushplan: the recorded plan was executed in the stated scenario, and digests and messages are
correct.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from kinds import FAST, WALL

import pushplan
from pushplan.closed_loop import ClosedLoopRun, run_closed_loop
from pushplan.errors import ScenarioError
from pushplan.logging.codec import load_of
from pushplan.logging.writer import RunLogWriter
from pushplan.plans.execution import Execution, TrialEnd
from pushplan.plans.path import PushPath
from pushplan.plans.plan import Plan
from pushplan.plans.robustness import TrialUncertainty
from pushplan.plans.run import Replan
from pushplan.plans.segment import Segment
from pushplan.plans.trajectory import Trajectory
from pushplan.run import record
from pushplan.scenario.file import example_text, load_scenario, scenario_from_document, scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.sim.control.simulated_push import Disturbance
from pushplan.sim.kinematic import execute
from pushplan.sim.trials import execute_trials
from pushplan.trial import TRIAL

Document = dict[str, Any]

GAP = "narrow-gap"


@cache
def honest(kind: str) -> Plan:
    """Return the first plan of a scenario of a kind."""
    scenario = load_scenario(kind) if kind == GAP else scenario_from_text(FAST[kind])
    plan = pushplan.plan(scenario, first=True, seed=1, time_limit=60.0, iterations=3000)
    assert plan.solved, plan.reason
    return plan


def _stated(plan: Plan, edit: Callable[[Document], object]) -> Plan:
    """Return a plan with another scenario, executed there as far as possible."""
    document = yaml.safe_load(plan.scenario.source)
    edit(document)
    scenario = scenario_from_document(document).settled(plan.segments[-1].after)
    return executed(replace(plan, scenario=scenario), scenario)


def executed(plan: Plan, scenario: Scenario) -> Plan:
    """Return a plan with the loads of a scenario, and its execution there."""
    segments = tuple(replace(s, load=_load(scenario, s)) for s in plan.segments)
    execution = execute(scenario, segments, plan.stable_set)
    return replace(plan, segments=segments, execution=replace(execution, loss=None))


def _load(scenario: Scenario, segment: Segment) -> Any:
    load = segment.load
    return None if load is None else load_of(scenario, load.names, load.face, load.offset, load.faces)


def _put(*keys: str, value: Any) -> Callable[[Document], object]:
    """Return a function that sets a value in a document."""

    def edit(document: Document) -> None:
        place = document
        for key in keys[:-1]:
            place = place.setdefault(key, {})
        place[keys[-1]] = value

    return edit


def _middle(plan: Plan, kind: str) -> list[float]:
    """Return the pose of the plate in the middle of the longest segment of a kind."""
    longest = max((s for s in plan.segments if s.kind == kind), key=lambda s: s.cost)
    return [float(value) for value in longest.path.poses_at([0.5 * longest.path.cost])[0][:2]]


def _obstacle(plan: Plan, kind: str) -> Plan:
    circle = {"circle": 0.03, "center": _middle(plan, kind)}
    return _stated(plan, lambda document: document.setdefault("obstacles", []).append(circle))


def _limit(name: str, share: float) -> Callable[[Plan], Plan]:
    """Return a function that sets a limit of the robot to a share of its largest used value."""

    def forge(plan: Plan) -> Plan:
        twists = np.abs(_trajectory(plan).twists)
        most = {"speed": float(np.hypot(*twists.T[:2]).max()), "angular_speed": float(twists[:, 2].max())}
        value = share * most.get(name, 1.0) if name in most else share
        return _stated(plan, _put("pusher", "limits", name, value=value))

    return forge


def _trajectory(plan: Plan) -> Trajectory:
    assert plan.trajectory is not None
    return plan.trajectory


def _segment(plan: Plan, change: Callable[[Segment], Segment], kind: str = "push") -> Plan:
    """Return a plan with its first segment of a kind changed."""
    k = next(k for k, segment in enumerate(plan.segments) if segment.kind == kind)
    segments = (*plan.segments[:k], change(plan.segments[k]), *plan.segments[k + 1 :])
    return replace(plan, segments=segments)


def _shorter_path(plan: Plan, share: float = 0.5) -> Plan:
    def change(segment: Segment) -> Segment:
        path = segment.path
        return replace(segment, path=PushPath(path.start, path.twists, share * path.lengths))

    made = _segment(plan, change)
    return replace(made, cost=None if made.cost is None else made.segments[0].cost)


def _straight_path(plan: Plan) -> Plan:
    """State a straight path for the motion, and its cost."""

    def change(segment: Segment) -> Segment:
        twists, path = segment.path.twists, segment.path
        return replace(segment, path=PushPath(path.start, twists[:1], path.lengths[:1]))

    made = _segment(plan, change)
    return replace(made, cost=made.segments[0].cost)


def _faster(plan: Plan) -> Plan:
    """State half of the duration: the same motion twice as fast."""

    def change(segment: Segment) -> Segment:
        t = segment.trajectory
        assert t is not None
        faster = replace(t, breaks=t.breaks / 2, coefficients=t.coefficients * [[2.0], [4.0], [8.0]])
        return replace(segment, trajectory=faster)

    return executed(_segment(plan, change), plan.scenario)


def _cut(plan: Plan, count: int) -> Plan:
    """Leave out the last segments."""
    return executed(replace(plan, segments=plan.segments[:-count]), plan.scenario)


def _without(plan: Plan, kind: str) -> Plan:
    """Leave out the first segment of a kind."""
    k = next(k for k, segment in enumerate(plan.segments) if segment.kind == kind)
    return executed(replace(plan, segments=(*plan.segments[:k], *plan.segments[k + 1 :])), plan.scenario)


def _robust(plan: Plan, factor: float) -> Plan:
    robustness = plan.robustness
    assert robustness is not None
    assert robustness.floor_friction is not None
    assert robustness.joint is not None
    return replace(
        plan,
        robustness=replace(
            robustness, floor_friction=factor * robustness.floor_friction, joint=factor * robustness.joint
        ),
    )


def _execution(plan: Plan, change: Callable[[Execution], Execution]) -> Plan:
    assert plan.execution is not None
    return replace(plan, execution=change(plan.execution))


def _shifted(pose: Any, by: float) -> Any:
    """Return a pose of a document moved along x; also the pose of a goal with further keys."""
    if isinstance(pose, dict):
        return {**pose, "pose": _shifted(pose["pose"], by)}
    return [pose[0] + by, *pose[1:]]


def _goal_moved(plan: Plan) -> Plan:
    def edit(document: Document) -> None:
        place, key = (document, "goal") if "goal" in document else (document["goals"], "other")
        key = "row" if "row" in place else key
        place[key] = _shifted(place[key], -0.05)

    return _stated(plan, edit)


def _start_moved(plan: Plan) -> Plan:
    def edit(document: Document) -> None:
        if "start" in document:
            document["start"] = _shifted(document["start"], -0.05)
        else:
            document["objects"][0]["pose"] = _shifted(document["objects"][0]["pose"], -0.05)

    return _stated(plan, edit)


def _robot_moved(plan: Plan) -> Plan:
    return _stated(plan, lambda d: d["robot"].update(start=_shifted(d["robot"]["start"], -0.05)))


def _object_added(plan: Plan) -> Plan:
    """Add one more object on the path."""
    pose = np.array([*_middle(plan, "transit"), 0.0])
    extra = {"name": "crate", "shape": {"box": [0.04, 0.04]}, "mass": 1.0, "pose": pose.tolist()}
    segments = tuple(
        replace(s, before={**s.before, "crate": pose}, after={**s.after, "crate": pose}) for s in plan.segments
    )
    return _stated(replace(plan, segments=segments), lambda document: document["objects"].append(extra))


def _drive(kind: str, **words: Any) -> Callable[[Plan], Plan]:
    def edit(document: Document) -> None:
        document["pusher"]["drive"] = {kind: {"axle": [-0.3, 0.0, 0.0], **words}}
        document.setdefault("robot", {})["base"] = [0.0, 0.0, 0.0]  # as for a robot without wheels

    return lambda plan: _stated(plan, edit)


def _weights(**words: float) -> Callable[[Plan], Plan]:
    return lambda plan: _stated(plan, lambda document: document.setdefault("pushes", {}).update(words))


def _largest(plan: Plan, keys: Sequence[str], values: Sequence[Any]) -> Plan:
    """Set the first of some values for which the scenario is valid."""
    for value in values:
        try:
            return _stated(plan, _put(*keys, value=value))
        except ScenarioError:
            continue
    raise AssertionError("none of the values can be")


def _fatter(plan: Plan) -> Plan:
    """Make the robot as large as start and goal allow."""
    boxes = [{"box": [size, size], "pose": [-0.5 * size, 0.0, 0.0]} for size in np.arange(2.0, 0.2, -0.05).tolist()]
    return _largest(plan, ["robot", "footprint"], boxes)


def _largest_clearance(plan: Plan) -> Plan:
    return _largest(plan, ["clearance"], (0.2, 0.1, 0.05, 0.048, 0.03))


def _walled(plan: Plan) -> Plan:
    """Make the workspace as small as start and goal allow."""
    lows = [[low, 9.0] for low in np.arange(0.5, -3.0, -0.02).tolist()]
    return _largest(plan, ["workspace", "y"], lows)


def _too_weak(plan: Plan) -> Plan:
    assert plan.max_force is not None
    return _stated(plan, _put("robot", "limits", "force", value=0.99 * plan.max_force))


def _first_object(**words: Any) -> Callable[[Plan], Plan]:
    return lambda plan: _stated(plan, lambda document: document["objects"][0].update(words))


def _margins(change: Callable[[Segment], Segment]) -> Callable[[Plan], Plan]:
    return lambda plan: _segment(plan, change)


@dataclass(frozen=True)
class Forgery:
    """A forgery of a run of a kind, and a function that writes its log."""

    kind: str
    name: str
    write: Callable[[Path], object]


EVERY: dict[str, Callable[[Plan], Plan]] = {
    "a goal that is missed": _goal_moved,
    "another start": _start_moved,
    "an obstacle on the way of a push": lambda plan: _obstacle(plan, "push"),
    "a speed limit that is not kept": _limit("speed", 0.1),
    "a force limit that is not kept": _too_weak,
    "a stated margin that is not kept": lambda plan: _stated(plan, _put("stability", value={"margin": 0.5})),
    "a slippery plate": lambda plan: _stated(plan, _put("pusher", "friction", value=0.01)),
    "a car that cannot turn so": _drive("car", min_radius=30.0),
    "half of the cost": lambda plan: replace(plan, cost=0.5 * (plan.cost or 0.0)),
    "more robustness": lambda plan: _robust(plan, 3.0),
    "a larger margin": lambda plan: replace(plan, margin=0.5, margin_asked=0.5),
    "a push with a larger margin": _margins(lambda s: replace(s, margin=0.9 * s.margin + 0.01)),
    "a push with a larger smallest margin": _margins(lambda s: replace(s, min_margin=0.9)),
    "a path half as long as its motion": _shorter_path,
    "half of the duration": _faster,
    "larger margins in the execution": lambda plan: _execution(plan, lambda e: replace(e, margins=e.margins + 0.01)),
    "objects elsewhere": lambda plan: _execution(plan, lambda e: replace(e, objects=e.objects + 0.01)),
    "a reason why there is none": lambda plan: replace(plan, reason="no plan was found in time"),
    "another objective": lambda plan: replace(plan, objective="margin"),
}
"""Forgeries of plans of any kind."""

OWN: dict[str, dict[str, Callable[[Plan], Plan]]] = {
    "push": {
        "a bound that makes it optimal": lambda plan: replace(plan, lower_bound=plan.duration),
        "a straight path": _straight_path,
        "an acceleration limit that is not kept": _limit("acceleration", 0.05),
        "an angular speed limit that is not kept": _limit("angular_speed", 0.1),
        "stops at every corner": lambda plan: _stated(plan, _put("trajectory", value="exact")),
        "loads that may be others": lambda plan: _stated(
            replace(plan, stable_set="robust"), _put("stability", value={"set": "robust"})
        ),
        "a clearance that is not kept": _largest_clearance,
        "a large robot": _fatter,
        "uncertain friction": lambda plan: _stated(plan, _put("uncertainty", value={"contact_friction": "60 %"})),
        "objects that hardly stick": lambda plan: _stated(plan, _put("contacts", value={"friction": 0.01})),
        "an object turned into another": _first_object(shape={"box": [0.02, 0.05]}),
        "a differential drive": _drive("differential"),
        "a smaller goal error": lambda plan: _execution(plan, lambda e: replace(e, goal_error=(0.0, 0.1))),
    },
    GAP: {
        "a gap that is narrower": lambda plan: _stated(plan, _put("clearance", value=0.05)),
        "a workspace that is left": _walled,
        "an obstacle on the way of a push": lambda plan: _obstacle(plan, "push"),
        "half of the cost": lambda plan: replace(plan, cost=0.5 * (plan.cost or 0.0)),
    },
    "multi-push": {
        "the robot elsewhere at first": _robot_moved,
        "a face that is not allowed": lambda plan: _stated(plan, _put("pusher", "faces", value=["left"])),
        "an offset that is not allowed": lambda plan: _stated(plan, _put("pusher", "offsets", value=[0.01])),
        "another price of transits": _weights(transit_weight=1.0),
        "another approach": _weights(approach=0.1),
        "no retreat": lambda plan: _cut(plan, 1),
    },
    "rearrangement": {
        "a clearance that is not kept": _largest_clearance,
        "an obstacle on the way of a transit": lambda plan: _obstacle(plan, "transit"),
        "an object on the way of a transit": _object_added,
        "the robot elsewhere at first": _robot_moved,
        "one object left where it was": lambda plan: _cut(plan, 4),
        "no approach": lambda plan: _without(plan, "approach"),
        "another price of transits": _weights(transit_weight=0.5),
    },
    "gathering": {
        "a clearance that is not kept": _largest_clearance,
        "an obstacle on the way of a transit": lambda plan: _obstacle(plan, "transit"),
        "no close": lambda plan: _without(plan, "close"),
        "another order": lambda plan: _stated(
            plan, lambda d: d["goals"]["row"].update(order="given", of=[*reversed(_row_order(plan))])
        ),
        "the robot elsewhere at first": _robot_moved,
    },
}
"""Forgeries of plans of one kind."""


def _row_order(plan: Plan) -> tuple[str, ...]:
    last = plan.segments[-1]
    return plan.scenario.transport.row.order_at(plan.scenario.task.by_name, last.after, float(last.path.end[2]))


@cache
def _watched() -> ClosedLoopRun:
    """Return a closed loop in which an object is displaced."""
    document = {**yaml.safe_load(example_text("free-space")), "goal": {"pose": [0.5, 0.1, "15 deg"], "of": "far"}}
    return run_closed_loop(scenario_from_document(document), disturbances=[Disturbance(1.0, 1, 0.0, -5e-3, 0.05)])


def _closed_loop(**changes: Callable[[ClosedLoopRun], Any]) -> Callable[[Path], None]:
    """Return a function that writes the log of the closed loop with some fields changed."""
    return lambda path: replace(_watched(), **{name: of(_watched()) for name, of in changes.items()}).write(path)


def _replanned(run: ClosedLoopRun) -> tuple[Replan, ...]:
    """Return the replans, the first one with half of its cost."""
    first, *others = run.replans
    assert first.result is not None
    return (replace(first, result=replace(first.result, cost=0.5 * (first.result.cost or 0.0))), *others)


def _trials(change: Callable[[TrialEnd], TrialEnd]) -> Callable[[Path], None]:
    """Return a function that writes the log of trials with another outcome of the first one."""

    def write(path: Path) -> None:
        ends = list(execute_trials(honest("push"), 2, TrialUncertainty(contact_friction=0.6), seed=3).ends)
        ends[0] = change(ends[0])
        settings = {"planner": "auto", "set": "ecof", "seed": 1}
        words = {"seed": "3", "uncertainty": json.dumps(asdict(TrialUncertainty(contact_friction=0.6)))}
        with RunLogWriter.create(path, honest("push").scenario, settings) as log:
            log.note(TRIAL, {**words, "simulator": "slip"})
            log.plan(honest("push"))
            for end in ends:
                log.trial(end)
            log.finish("tried")

    return write


def _unsolved(change: Callable[[Plan], Plan]) -> Callable[[Path], None]:
    """Return a function that writes the log of an unsolved plan."""

    def write(path: Path) -> None:
        plan = pushplan.plan(scenario_from_text(WALL), seed=1, time_limit=60.0, iterations=500)
        record(change(plan), log=path)

    return write


def _nearer(plan: Plan) -> Plan:
    assert plan.nearest is not None
    return replace(plan, nearest=replace(plan.nearest, error=(0.0, 0.0)))


def _elsewhere(run: ClosedLoopRun) -> Plan:
    """Return the first plan of a loop, with an obstacle on its path."""
    return replace(run.plan, cost=0.5 * (run.plan.cost or 0.0), segments=_shorter_path(run.plan).segments)


def _outcome(outcome: str) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        with RunLogWriter.create(path, honest("push").scenario, {}) as log:
            log.plan(honest("push"))
            log.finish(outcome)

    return write


RUNS: dict[str, dict[str, Callable[[Path], None]]] = {
    "closed loop": {
        "a path half as long as its motion": _closed_loop(plan=_elsewhere),
        "a speed limit that is not kept": _closed_loop(scenario=lambda run: _limit("speed", 0.1)(run.plan).scenario),
        "a replan with half of its cost": _closed_loop(replans=_replanned),
        "a replan less": _closed_loop(replans=lambda run: run.replans[1:]),
        "another event": _closed_loop(events=lambda run: (*run.events[:-1], replace(run.events[-1], text="there"))),
        "another outcome": _closed_loop(outcome=lambda run: "gave up"),
        "a slower plate": _closed_loop(
            simulated=lambda run: replace(run.simulated, twists=0.9 * run.simulated.twists)
        ),
    },
    "trials": {
        "one that arrives": _trials(lambda end: replace(end, arrived=not end.arrived)),
        "objects elsewhere": _trials(lambda end: replace(end, objects=end.objects + 0.01)),
        "no contact lost": _trials(lambda end: replace(end, contact="", object="")),
    },
    "no plan": {
        "a nearest path that is nearer": _unsolved(_nearer),
        "a cost": _unsolved(lambda plan: replace(plan, cost=1.0)),
        "a plan after all": _unsolved(lambda plan: replace(plan, reason="")),
        "an outcome that is better": _outcome("unsolved"),
    },
}
"""Forgeries of runs that are not a single executed plan."""


def _record(kind: str, forge: Callable[[Plan], Plan], path: Path) -> None:
    record(forge(honest(kind)), log=path)


FORGERIES = [
    *(
        Forgery(kind, name, partial(_record, kind, forge))
        for kind, own in OWN.items()
        for name, forge in {**(EVERY if kind != GAP else {}), **own}.items()
    ),
    *(Forgery(kind, name, write) for kind, own in RUNS.items() for name, write in own.items()),
]
