"""Every use of a plan works for every kind of plan; exports of files are in `store/test_exports.py`.

Rows are uses, columns are kinds. Each cell checks the result against the execution or the plan. Unsupported uses give
a message.
"""

import re
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from conftest import Patch, there
from kinds import FAST
from matplotlib import image
from rough import rough_identification

import pushplan
from pushplan.bench.batch import Selection, run_suite
from pushplan.bench.executor import local_engine
from pushplan.bench.results import read_results
from pushplan.bench.store import ResultsFolder
from pushplan.bench.suite import suite_from_text
from pushplan.closed_loop import ClosedLoopRun, run_closed_loop
from pushplan.drawing.scene import Scene
from pushplan.logging.page import write_html
from pushplan.logging.tables import write_csv
from pushplan.planners.validator import Validator
from pushplan.plans.execution import Execution
from pushplan.plans.goals import worst_at_goal
from pushplan.plans.plan import Plan
from pushplan.plans.robustness import TrialUncertainty
from pushplan.plans.segment import Segment
from pushplan.scenario.model import Scenario
from pushplan.sim.control.settings import ControlSettings
from pushplan.sim.control.simulated_push import Disturbance
from pushplan.sim.physics.simulate import simulate_in_physics
from pushplan.trial import write_trial
from pushplan.util.arrays import FloatArray
from pushplan.verification import verify_log

KINDS = ("push", "multi-push", "rearrangement", "gathering", "partial", "block")
EVERY = pytest.mark.parametrize("kind", KINDS)
SETTINGS = ControlSettings(time_limit=60.0, rate=25.0)
"""Iterations end searches, independent of the machine; half of the usual step rate."""
LOOPS = tuple(f"{kind} in closed loop" for kind in KINDS)
CLOSED = pytest.mark.parametrize("kind", LOOPS)
GROWN = TemporaryDirectory(prefix="loops-")
"""Folder of the logs of closed loops, which grow with the run."""

EXECUTED = pytest.mark.parametrize("kind", [*KINDS, *LOOPS])


@dataclass(frozen=True)
class Made:
    scenario: Scenario
    plan: Plan
    execution: Execution
    loop: ClosedLoopRun | None = None


@cache
def made(kind: str) -> Made:
    if kind in LOOPS:
        whole = made(kind.split(" ")[0])
        index = 1 if len(whole.execution.names) > 1 else 0
        disturbance = Disturbance(0.5 * float(whole.execution.t[-1]), index, 0.0, 0.005, 0.0)
        log = Path(GROWN.name) / f"{kind}.mcap"
        loop = run_closed_loop(
            pushplan.scenario_from_text(FAST[kind.split(" ")[0]]),
            disturbances=[disturbance],
            plan=whole.plan,
            settings=SETTINGS,
            log=log,
        )
        assert loop.outcome == "arrived", loop.reason
        return Made(loop.plan.scenario, loop.plan, loop.execution, loop)
    scenario, several = pushplan.scenario_from_text(FAST[kind]), "rearrangement"
    assert scenario.kind == {"gathering": several, "partial": several, "block": "push"}.get(kind, kind)
    plan = pushplan.plan(scenario, seed=1, first=True, time_limit=60.0)
    assert plan.solved == (kind != "partial"), plan.reason
    assert set(plan.undelivered) == ({"stuck"} if kind == "partial" else set())
    return Made(plan.scenario, plan, there(plan.execution))


def names_of(segment: Segment) -> tuple[str, ...]:
    return () if segment.load is None else segment.load.names


def at_goals(scenario: Scenario, objects: FloatArray) -> bool:
    position, angle = worst_at_goal(scenario, objects)
    return position < 0.02 and angle < 0.05


@EVERY
def test_a_plan_is_timed_executed_and_judged(kind: str) -> None:
    one = made(kind)
    assert max(len(repr(shown)) for shown in (one.scenario, one.plan, *one.plan.segments)) < 120
    trajectory = there(one.plan.trajectory)
    assert one.plan.times[-1] == pytest.approx(trajectory.duration) == pytest.approx(one.execution.t[-1])
    for before, after in zip(one.plan.segments, one.plan.segments[1:], strict=False):
        np.testing.assert_allclose(before.path.end[:2], after.path.start[:2], atol=1e-7)
    np.testing.assert_allclose(one.execution.poses[-1, :2], trajectory.break_poses[-1, :2], atol=1e-6)
    assert one.execution.loss is None
    assert one.execution.goal_error[0] < 1e-6
    assert at_goals(one.scenario, one.execution.objects[-1])
    assert there(one.execution.min_margin) > 0.0
    for k, segment in enumerate(one.plan.segments):
        here, pushed = (
            one.execution.objects[one.execution.segment == k],
            names_of(segment) if segment.pushes else (),
        )
        for column, name in enumerate(one.execution.names):
            assert (np.ptp(here[:, column, :2], axis=0).max() > 1e-3) == (name in pushed)
    robustness = there(one.plan.robustness)
    assert robustness.known
    assert 0.0 < (robustness.contact_friction or 0.0) < 1.0


@EVERY
def test_the_validator_refuses_tampered_plans(kind: str) -> None:
    one = made(kind)
    judge, segments = Validator(one.scenario), one.plan.segments
    assert judge.flaw(segments, one.execution) == ""
    k = next(k for k, segment in enumerate(segments) if segment.pushes)
    path = segments[k].path
    longer = replace(path, lengths=np.append(path.lengths[:-1], path.lengths[-1] + 0.05))
    spoiled = (*segments[:k], replace(segments[k], path=longer, trajectory=None), *segments[k + 1 :])
    assert judge.flaw(spoiled, None) != ""
    last = max(k for k, segment in enumerate(segments) if segment.pushes)
    assert judge.flaw(segments[:last], None) != ""
    never = "is not flush" if kind == "gathering" else "misses the goal"
    assert never in judge.flaw((), None)


@EVERY
@pytest.mark.parametrize("engine", ["slip", "MuJoCo"])
def test_simulators_keep_every_contact_and_end_at_the_goals(kind: str, engine: str) -> None:
    one = made(kind)
    if engine == "slip":
        report = pushplan.simulate(one.plan, pushplan.World.from_scenario(one.scenario))
    else:
        pytest.importorskip("mujoco")
        report = simulate_in_physics(one.plan)
    assert report.kept, report.summaries
    assert at_goals(one.scenario, report.objects[-1])
    assert report.goal_errors(one.scenario).max() < 0.05
    order = [report.names.index(name) for name in one.execution.names]
    np.testing.assert_allclose(
        report.objects[-1][order, :2], one.execution.objects[-1, :, :2], atol=5e-3, err_msg=engine
    )


@EXECUTED
def test_a_picture_shows_the_path_and_the_final_poses(kind: str, tmp_path: Path) -> None:
    one = made(kind)
    events = () if one.loop is None else one.loop.events
    scene = Scene.of(one.scenario, one.plan, one.execution, events)
    for name, pose in zip(one.execution.names, one.execution.objects[-1], strict=True):
        place = next(k for k, body in enumerate(scene.bodies) if body.name == name)
        np.testing.assert_allclose(scene.end[place], pose, atol=1e-12)
    moved = {name for push in one.plan.pushes if push.load is not None for name in push.load.names}
    assert {name for line in scene.lines for name in line.load} == moved
    assert bool(scene.marks) == (kind in LOOPS)
    pushplan.plot_plan(one.plan, tmp_path / "run.png", one.execution, events)
    assert image.imread(tmp_path / "run.png").std() > 0.02


@EVERY
def test_trials_without_uncertainty_arrive_and_can_be_viewed(kind: str, tmp_path: Path) -> None:
    one = made(kind)
    nominal = TrialUncertainty(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    trials = pushplan.trial(one.plan, 2, uncertainty=nominal)
    assert trials.success == 1.0
    write_trial(trials, 0, tmp_path / "trial.mcap")
    read = pushplan.load_run(tmp_path / "trial.mcap")
    np.testing.assert_allclose(there(read.execution).objects[-1, :, :2], trials.object_poses[0][:, :2], atol=1e-12)


@CLOSED
def test_a_closed_loop_is_a_run_that_can_be_repeated_shown_and_verified(kind: str, tmp_path: Path) -> None:
    loop = there(made(kind).loop)
    assert pushplan.trial(loop.plan, 2).samples == 2
    report = verify_log(there(loop.log))
    assert report.matches, [check.text for check in report.mismatches]
    assert {"twist", "number of events"} <= {check.quantity for check in report.checks}
    back = pushplan.load_run(there(loop.log))
    write_csv(back, tmp_path / "loop.csv")
    columns = np.genfromtxt(tmp_path / "loop.csv", delimiter=",", names=True)
    np.testing.assert_allclose(columns["t"], loop.simulated.t, atol=1e-9)
    write_html(back, tmp_path / "loop.html")
    told = (tmp_path / "loop.html").read_text()
    assert all(event.text in told for event in loop.events)


@CLOSED
def test_a_closed_loop_brings_the_planned_objects_to_their_goals(kind: str) -> None:
    one, loop = made(kind), there(made(kind).loop)
    assert at_goals(one.scenario, one.execution.objects[-1])
    assert max(loop.goal_errors) < 0.018
    driven = np.hypot(*np.diff(loop.simulated.poses[:, :2], axis=0).T).sum()
    assert driven <= 2.0 * sum(s.path.travel for s in made(kind.split(" ")[0]).plan.segments) + 1.0
    drives = [event for event in loop.events if event.kind == "drive"]
    assert len(drives) >= sum(segment.kind == "transit" for segment in one.plan.segments)
    pushed = {k for k, row in enumerate(~np.isnan(one.execution.margins).T) if row.any()}
    assert {one.execution.names[k] for k in pushed} == {n for s in one.plan.pushes for n in names_of(s)}


def test_friction_is_identified_from_a_push(tmp_path: Path, monkeypatch: Patch) -> None:
    rough_identification(monkeypatch)
    scenario = pushplan.scenario_from_text(re.sub("robot: .*\n", "", FAST["multi-push"]))
    assert scenario.kind == "push"
    run_closed_loop(scenario, settings=SETTINGS).write(tmp_path / "loop.mcap")
    assert len(pushplan.identify([tmp_path / "loop.mcap"], seed=1).estimates) > 0


def test_a_batch_runs_every_kind(tmp_path: Path) -> None:
    for kind in KINDS:
        (tmp_path / f"{kind}.yaml").write_text(FAST[kind])
    suite = suite_from_text(
        f"format: pushplan-suite/1\nproblems: [{', '.join(f'{kind}.yaml' for kind in KINDS)}]\n"
        "planners: [{name: auto, first: true}]\nseeds: 1\nlimits: {time: 60 s}\n",
        tmp_path / "suite.yaml",
    )
    folder = ResultsFolder(tmp_path / "results")
    with folder.locked(), local_engine(1, folder.scratch) as engine:
        run_suite(suite, folder, engine, Selection(), None, "test")
    done = read_results(tmp_path / "results").done
    assert done["outcome"].tolist() == ["no plan" if kind == "partial" else "ok" for kind in KINDS]
    assert done["undelivered"].tolist() == [int(kind == "partial") for kind in KINDS]
    assert (done["solution_length"] > 0.1).all()
