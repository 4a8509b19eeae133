"""Trials: Monte Carlo samples, rates with intervals, the command, its picture and its log."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import Captured, there

import pushplan
from pushplan.cli.main import main
from pushplan.logging.page import render
from pushplan.logging.reader import load_run
from pushplan.logging.recorded import RecordedRun
from pushplan.mechanics.dynamics import dynamic_margins
from pushplan.planner import plan
from pushplan.plans.execution import TrialEnd
from pushplan.plans.plan import Plan
from pushplan.plans.robustness import TrialUncertainty
from pushplan.plans.run import Run
from pushplan.sim.report import ContactLoss, contact_motion, motions_of
from pushplan.sim.slip import slip
from pushplan.sim.trials import INERTIA, Trials, execute_trials, inertia_loss, sampled_world
from pushplan.slip.world import World
from pushplan.trial import write_trial
from pushplan.verification import verify_run

TEN = [file.stem for file in sorted((Path(pushplan.__file__).parent / "scenarios").glob("*.yaml"))][-10:]
SLIPPERY = TrialUncertainty(contact_friction=0.6, load=0.3, position=2e-3)


@pytest.fixture(scope="module")
def planned() -> Plan:
    return plan(pushplan.load_scenario("two-crates"), seed=1, first=True, time_limit=600.0)


@pytest.fixture(scope="module")
def trials(planned: Plan) -> Trials:
    return execute_trials(planned, 30, SLIPPERY, seed=3)


def test_the_same_seed_gives_the_same_samples_with_any_number_of_threads(planned: Plan, trials: Trials) -> None:
    again = execute_trials(planned, 6, SLIPPERY, seed=3, jobs=1)
    assert (again.object_poses == trials.object_poses[:6]).all()
    other = execute_trials(planned, 6, SLIPPERY, seed=4)
    assert not np.allclose(other.object_poses, again.object_poses)


def test_statistics_of_trials_match_their_reports(trials: Trials) -> None:
    assert 0 < trials.arrived.sum() < trials.samples
    low, high = trials.interval
    assert low < trials.success < high
    assert sum(trials.first_failures.values()) == sum(bool(end.contact) for end in trials.ends)
    report = trials.report(trials.worst)
    assert (report.objects[-1] == trials.object_poses[trials.worst]).all()
    loss, end = report.loss, trials.ends[trials.worst]
    assert isinstance(loss, ContactLoss)
    for name in ("object", "contact", "time", "point"):
        assert getattr(loss, name) == getattr(end, name)
    assert not report.arrived(trials.scenario)


def test_contacts_hold_in_a_sample_only_with_inertia() -> None:
    """Against margins at every sample of the trajectory, for each object of ten plans."""
    held = lost = 0
    for name in TEN:
        found = plan(pushplan.load_scenario(name), seed=1, first=True, iterations=2_000, time_limit=60.0)
        assert found.solved, name
        tried = execute_trials(found, 4, TrialUncertainty(contact_friction=0.3, position=0.0, angle=0.0), seed=2)
        assert tried.with_inertia
        for end in tried.ends:
            least = np.inf
            for segment in found.segments:
                if segment.pushes and segment.load is not None:
                    own, chain = segment.contact_trajectory, tried.world(end.sample).pushed(segment.load.chain)
                    least = min(least, dynamic_margins(chain, own.directions, own.rates_at(own.t)).min())
            assert not (least < 0.0 and not end.contact), (name, end.sample)
            assert end.mode != INERTIA or least <= 0.0
            held, lost = held + (not end.contact), lost + (end.mode == INERTIA)
    assert held > 0
    assert lost > 0


def test_two_crates_do_not_hold_beyond_their_robustness_to_friction(planned: Plan) -> None:
    stated, robust = World.from_scenario(planned.scenario), there(there(planned.robustness).contact_friction)
    for factor, slips in ((robust + 1e-3, False), (robust - 1e-3, True)):
        world = stated.with_contact_friction(factor)
        assert slip(planned, world).loss is None
        assert (inertia_loss(planned, world) is not None) == slips


def test_objects_with_pose_errors_touch_and_do_not_overlap() -> None:
    scenario = pushplan.load_scenario("parallel-stacks")
    rng = np.random.default_rng(5)
    for _ in range(20):
        world = sampled_world(scenario, TrialUncertainty(position=3e-3, angle=0.03), rng)
        motions = motions_of(world.chain, world.start[None], world.object_poses[None])
        slide, opening, turn = contact_motion(world.chain, motions, None)
        assert np.abs(slide).max() <= 5e-3
        assert (opening >= -1e-12).all()
        assert np.abs(turn).max() <= 0.03


def test_the_outcome_of_each_sample_is_logged(planned: Plan, tmp_path: Path) -> None:
    """The log grows with each sample, so that a kill loses none, and is verified by new trials."""
    log, halves = tmp_path / "trials.mcap", list[RecordedRun]()

    def ended(end: TrialEnd) -> None:
        if end.sample == 4:
            halves.append(load_run(log.with_name("trials.mcap.partial"), messages=True))

    pushplan.trial(planned, 8, uncertainty=SLIPPERY, seed=3, jobs=1, log=log, progress=ended)
    again = execute_trials(planned, 8, SLIPPERY, seed=3)
    for run, outcome, count in ((halves[0], "cut off", 5), (load_run(log, messages=True), "tried", 8)):
        assert (run.outcome, len(run.trials)) == (outcome, count)
        assert [end.arrived for end in run.trials] == again.arrived[:count].tolist()
        np.testing.assert_array_equal([end.objects for end in run.trials], again.object_poses[:count])
        assert [end.contact for end in run.trials] == [end.contact for end in again.ends[:count]]
        assert verify_run(run).matches
    wrong = replace(run.trials[1], arrived=not run.trials[1].arrived)
    report = verify_run(replace(run, trials=(run.trials[0], wrong, *run.trials[2:])))
    assert [check.text for check in report.mismatches] == ["trials: arrived: 1 samples differ"]


def test_the_page_of_trials_shows_every_sample_and_the_tolerances_that_failed(trials: Trials) -> None:
    run = Run(trials.scenario, trials.plan, trials.plan.execution, trials=trials.ends)
    text = render(run).partition('type="application/json">')[2].partition("</script>")[0]
    page = json.loads(text)
    arrived = int(trials.arrived.sum())
    assert page["summary"][0].startswith(f"{arrived} of 30 samples arrive")
    assert f"Position tolerance missed in {trials.missed['position']}." in page["summary"]
    assert sum(one["arrived"] for one in page["trials"]) == arrived
    np.testing.assert_allclose(page["trials"][0]["objects"], trials.object_poses[trials.worst], atol=1e-5)
    failed = [one["words"] for one in page["trials"] if not one["arrived"]]
    assert all("tolerance missed" in words or "jammed" in words for words in failed)
    assert sum("position tolerance missed" in words for words in failed) == trials.missed["position"]


def test_the_log_of_a_sample_is_verified_in_its_world(trials: Trials, tmp_path: Path) -> None:
    write_trial(trials, trials.worst, tmp_path / "worst.mcap")
    run = load_run(tmp_path / "worst.mcap", messages=True)
    report = verify_run(run)
    assert report.matches
    assert "wrench" in {check.quantity for check in report.checks}
    words = {**run.fields, "pushplan.trial": {**run.fields["pushplan.trial"], "seed": "4"}}
    assert not verify_run(replace(run, fields=words)).matches
    write_trial(replace(trials, simulator=lambda plan, world: slip(plan, world)), 0, tmp_path / "other.mcap")
    report = verify_run(load_run(tmp_path / "other.mcap", messages=True))
    assert report.matches
    assert "object motion (in a world that the log does not hold)" in report.not_compared


def test_the_command_prints_rates_and_writes_a_picture_and_the_worst_sample(
    tmp_path: Path, capsys: Captured, planned: Plan, trials: Trials
) -> None:
    log, picture, worst = tmp_path / "run.mcap", tmp_path / "t.png", tmp_path / "w.mcap"
    write_trial(trials, 0, log)
    words = f"trial {log} --samples 8 --seed 3 --plot {picture} --worst {worst}".split()
    words += ["--uncertainty", "contact_friction=60%, load=30%, position=2mm", "--json"]
    assert main([*words, "-o", str(tmp_path / "trials.mcap")]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["samples"] == 8
    assert told["arrived"] == int(told["success"] * 8)
    assert told["interval"][0] <= told["success"] <= told["interval"][1]
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert main(["replay", str(tmp_path / "trials.mcap"), "--plot", str(tmp_path / "again.png")]) == 0
    assert (tmp_path / "again.png").read_bytes() == picture.read_bytes()
    recorded = load_run(worst)
    assert recorded.outcome in ("arrived", "missed")
    assert recorded.fields["pushplan.trial"]["sample"] == str(told["worst"]["sample"])
