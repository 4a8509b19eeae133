"""The force of pushing: against friction wrenches and Newton, over intervals, in plans, output and logs."""

import json
import runpy
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from conftest import Captured, ChainMaker, there
from several.conftest import problem_document
from test_dynamics import motions, widened, world, worlds

import pushplan
import pushplan.core.uncertain as uncertain
from pushplan.cli.main import main
from pushplan.errors import PushplanError
from pushplan.mechanics.chain import Limits, inertia_of
from pushplan.mechanics.contacts import friction_wrench
from pushplan.mechanics.dynamics import ContactDynamics, PushForce
from pushplan.mechanics.support import UnknownSupport
from pushplan.plans.judge import push_force
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.file import example_text, scenario_from_document
from pushplan.sets.force_limited_set import ForceLimitedSet, least_force, within_force
from pushplan.sets.named import stable_set
from pushplan.slip.world import World


@pytest.mark.parametrize("seed", range(4))
def test_force_is_friction_and_inertia_of_all_objects(make_chain: ChainMaker, seed: int) -> None:
    chain = make_chain.random(seed, 3, tree=seed > 1, feet=seed == 1)
    twists, rates = motions(chain, seed)
    force = PushForce(ContactDynamics(chain))
    total = -np.sum([friction_wrench(obj, twists)[:, :2] for obj in chain.objects], axis=0)
    assert force.steady(twists) == pytest.approx(np.hypot(*total.T))
    for obj in chain.objects:
        mass, (x, y), _ = inertia_of(obj)
        velocity, rate = (v[:, :2] + v[:, 2:] * [-y, x] for v in (twists, rates))
        total = total + mass * (rate + twists[:, 2:] * velocity[:, ::-1] * [-1.0, 1.0])
    assert force.moving(twists, rates) == pytest.approx(np.hypot(*total.T))


@pytest.mark.parametrize("seed", range(4))
def test_no_sample_exceeds_the_force_bound_and_the_heaviest_nearly_reaches_it(
    make_chain: ChainMaker, seed: int
) -> None:
    interval = widened(make_chain.random(seed, 1 + seed % 3, tree=seed == 3, feet=seed == 1))
    twists, rates = motions(interval.chain, seed)
    bound = PushForce(ContactDynamics(interval.chain, interval=interval))
    steady, moving = bound.steady(twists), bound.moving(twists, rates)
    heaviest = world(interval, interval.mass[:, 1], interval.floor_friction[:, 1])
    for chain in (*worlds(interval, seed), heaviest):
        exact = PushForce(ContactDynamics(chain))
        assert (exact.steady(twists) <= steady * (1.0 + 1e-9)).all()
        assert (exact.moving(twists, rates) <= moving * (1.0 + 1e-9)).all()
    # Friction points in the same direction within 90 deg, so no other sample needs more.
    assert (steady <= 1.005 * PushForce(ContactDynamics(heaviest)).steady(twists)).all()


def test_force_intervals_enclose_all_corners_tightly(make_chain: ChainMaker) -> None:
    interval = widened(make_chain.random(7, 2))
    twists, _ = motions(interval.chain, 7)
    found = uncertain.forces_of(ContactDynamics(interval.chain, interval=interval).loads, twists)
    off = []
    for masses in product(*interval.mass):
        for frictions in product(*interval.floor_friction):
            objects = world(interval, np.array(masses), np.array(frictions)).objects
            total = -np.sum([friction_wrench(obj, twists)[:, :2] for obj in objects], axis=0)
            off.append(np.hypot(*(total - found[:, :2]).T))
    assert (np.max(off, axis=0) <= found[:, 2] * (1.0 + 1e-9)).all()
    assert (np.max(off, axis=0) >= 0.7 * found[:, 2]).all()


def test_forces_of_unknown_loads_stay_below_the_bound_over_all_pressures(make_chain: ChainMaker) -> None:
    unknown = PushForce(ContactDynamics(make_chain.boxes(2, support=UnknownSupport), worst_case=True))
    known = PushForce(ContactDynamics(make_chain.boxes(2)))
    twists = np.array([[1.0, 0.0, 0.0], [1.0, 0.2, 3.0], [0.3, 0.1, -5.0], [0.2, 0.0, 20.0]])
    assert unknown.steady(twists)[0] == pytest.approx(known.steady(twists)[0])
    assert (unknown.steady(twists) >= known.steady(twists) * (1.0 - 1e-12)).all()
    assert (unknown.steady(twists) <= unknown.most_friction).all()


@pytest.mark.parametrize(("share", "left"), [(1.001, "all"), (0.95, "part"), (0.9, "part"), (0.5, "none")])
def test_a_set_within_a_force(make_chain: ChainMaker, share: float, left: str) -> None:
    """A twist is inside if it is stable and within the force; the set is empty exactly if the least force is too
    large.
    """
    chain = make_chain.boxes(2)
    stable, force = stable_set(chain), PushForce(ContactDynamics(chain))
    limits = Limits(force=1.3 * share * force.most_friction, breakaway=1.3)
    if left == "none":
        assert share * force.most_friction < there(least_force(stable, force))
        with pytest.raises(PushplanError, match=r"takes at least .* to slide, 1\.3 times"):
            within_force(stable, force, limits)
        return
    found = within_force(stable, force, limits)
    assert (found is stable) == (left == "all")
    twists = np.random.default_rng(1).normal(size=(4000, 3)) * [0.3, 0.3, 3.0] + [1.0, 0.0, 0.0]
    allowed = force.steady(twists) <= share * force.most_friction
    assert (found.contains(twists) == (stable.contains(twists) & allowed)).all()
    assert (found.contains(twists).sum() < stable.contains(twists).sum()) == (left == "part")
    if isinstance(found, ForceLimitedSet):
        assert 0.0 < found.area() < stable.area()
        assert (found.contact_margins(twists) == stable.contact_margins(twists)).all()


def crates(**robot: Any) -> dict[str, Any]:
    return {**yaml.safe_load(example_text("two-crates")), "robot": {"limits": robot}}


# The crates need 4.544 N to 5.884 N to slide.


@pytest.mark.parametrize(("force", "breakaway", "binds"), [("10 N", 1.3, False), (7.7, 1.3, False), (6.2, 1.0, True)])
def test_plans_respect_the_force(force: Any, breakaway: float, binds: bool) -> None:
    stated = (crates(force="9 kN"), crates(force=force, breakaway=breakaway))
    free, plan = (
        pushplan.plan(scenario_from_document(one), seed=1, time_limit=60.0, iterations=500) for one in stated
    )
    assert plan.solved
    assert free.solved
    force_of, limit = push_force(plan.scenario, "ecof"), there(plan.force_limit)

    def needed(trajectory: Trajectory) -> float:
        times = np.linspace(0.0, trajectory.duration, 5001)[1:-1]
        return float(force_of.moving(trajectory.directions_at(times), trajectory.rates_at(times)).max())

    assert (needed(free.segments[0].contact_trajectory) > limit) == binds
    trajectory = plan.segments[0].contact_trajectory
    begin = breakaway * force_of.steady(trajectory.directions_at(np.zeros(1)))
    assert there(plan.max_force) == pytest.approx(max(needed(trajectory), begin[0]), rel=1e-3)
    assert there(plan.max_force) <= limit


@pytest.mark.parametrize(("force", "breakaway", "reason"), [
    ("1.3 lbf", 1.3, "at least 5.907 N: 4.544 N to slide, 1.3 times as much to break away; robot"),
    (4.7, 1.0, "at least 4.771 N: 4.544 N to slide, 1.05 times as much to speed up; robot"),
    (7.64, 1.3, "the straightest ones, take more force than robot.limits.force, 7.64 N: up to 7.649 N"),
])  # fmt: skip
def test_no_plan_exceeds_the_force_limit(force: Any, breakaway: float, reason: str) -> None:
    scenario = scenario_from_document(crates(force=force, breakaway=breakaway))
    with pytest.raises(PushplanError, match=reason):
        raise PushplanError(pushplan.plan(scenario, seed=1, time_limit=60.0, iterations=500).reason)


@pytest.mark.parametrize(("force", "gather", "loads"), [
    (6.0, "always", {"a", "ab", "abc"}), (4.0, "auto", {"a", "ab", "c"}), (2.5, "auto", {"a", "b", "c"}),
    (1.5, "auto", set()),
])  # fmt: skip
def test_a_row_too_heavy_together_is_pushed_in_groups_or_one_by_one(
    force: float, gather: str, loads: set[str]
) -> None:
    row = runpy.run_path(str(Path(__file__).parent / "several" / "test_gathering.py"))["DOCUMENT"]
    robot = {**row["robot"], "limits": {"force": force}}
    scenario = scenario_from_document({**row, "gather": gather, "robot": robot})
    if not loads:
        with pytest.raises(PushplanError, match=r"pushing 'a' takes at least 1\.912 N.*force is 1\.5 N"):
            pushplan.plan(scenario, seed=1)
        return
    plan = pushplan.plan(scenario, seed=1, time_limit=60.0, first=True)
    assert plan.solved
    needed = [
        (there(plan.execution).max_force(k), "".join(there(segment.load).names))
        for k, segment in enumerate(plan.segments)
        if segment.pushes
    ]
    assert {names for _, names in needed} == loads
    alone = "not gathered: no two of the objects can be pushed together (pushing 'a' and 'b' takes at least 3.825 N"
    assert any(note.startswith(alone) for note in plan.notes) == (force == 2.5)
    for most, names in needed:  # every object slides at 1.471 N
        assert most == pytest.approx(1.3 * 1.471 * len(names), rel=1e-3)


@pytest.mark.parametrize(
    ("force", "reason"),
    [(8.0, ""), (7.0, "b0 rear: pushing 'b0' and 'b1' takes at least 7.64"), (4.0, "at least 5.203 N")],
)
def test_multi_push_plans_respect_the_force(force: float, reason: str) -> None:
    scenario = scenario_from_document(problem_document("car", 2, robot={"limits": {"force": force}}))
    if reason:
        with pytest.raises(PushplanError, match=reason):
            pushplan.plan(scenario, seed=1)
        return
    plan = pushplan.plan(scenario, seed=1, time_limit=60.0, first=True)
    assert plan.solved
    assert plan.force_words == "needs up to 7.65 N of 8 N"


def test_output_log_and_page_show_the_force(tmp_path: Path, capsys: Captured) -> None:
    file, log = tmp_path / "crates.yaml", tmp_path / "crates.mcap"
    file.write_text(json.dumps(crates(force=10.0)))
    assert main(["plan", str(file), "-o", str(log), "--first"]) == 0
    run = pushplan.load_run(log)
    words = there(run.plan).force_words
    assert words == f"needs up to {there(run.plan).max_force:.3g} N of 10 N"
    assert words in capsys.readouterr().out
    assert words in log.with_suffix(".html").read_text()
    assert words in run.lines[-1].text
    execution = there(run.execution)
    slipped = replace(execution, wrenches=np.tile([3.0, 4.0, 0.0], (len(execution.t), 1)))
    assert slipped.force_words(8.0) == "pushed with up to 5 N of 8 N"  # it does not include the breakaway force
    assert main(["replay", str(log), "--verify", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["force_limit"] == 10.0
    assert document["max_force"] == document["segments"][0]["max_force"] == there(run.plan).max_force
    file.write_text(json.dumps(crates(force=5.8)))
    assert main(["check", str(file)]) == 2
    assert "robot.limits.force: pushing 'near' and 'far' takes at least 5.907 N" in capsys.readouterr().err


def test_forces_match_the_impulses_of_the_engine() -> None:
    """Over 50 ms, within 5 % in steady pushing; at the start the contacts take up their load."""
    pytest.importorskip("mujoco")
    from pushplan.sim.physics.simulator import HARD, PhysicsSimulator, sliding_speed

    near = {**crates(force=10.0), "goal": {"pose": [0.5, 0.1, 20.0 * np.pi / 180.0]}, "obstacles": []}
    plan = pushplan.plan(scenario_from_document(near), seed=1, time_limit=60.0, first=True)
    (segment,), chain, steps = plan.segments, plan.scenario.chain, round(0.05 / HARD.time_step)
    trajectory = segment.contact_trajectory
    at = HARD.time_step * np.arange(int(trajectory.duration / 0.05) * steps + 1)
    frames, middle = trajectory.poses_at(at), np.add(at[:-1], 0.5 * HARD.time_step, dtype=np.float64)
    engine = PhysicsSimulator(World.from_chain(chain, frames[0]), HARD, sliding_speed(chain, frames, HARD.time_step))
    found = np.hypot(*engine.move_along(frames)[:, :2].reshape(-1, steps, 2).mean(axis=1).T)
    twists, rates = trajectory.directions_at(middle), trajectory.rates_at(middle)
    needed = push_force(plan.scenario, plan.stable_set).moving(twists, rates).reshape(-1, steps).mean(axis=1)
    changing = np.abs(rates * [1.0, 1.0, chain.characteristic_length]).max(axis=1).reshape(-1, steps).max(axis=1)
    steady = (changing < 0.02) & (np.arange(len(found)) >= 2)
    assert steady.sum() > 20
    assert np.abs(found / needed - 1.0)[steady].max() < 0.05
