"""The margin of a plan: what `auto` stands for, when it is lowered, and that this is said."""

import json
from dataclasses import replace
from functools import cache
from itertools import count
from pathlib import Path

import numpy as np
import pytest
from conftest import ChainMaker
from plain import load_plain

from pushplan.cli.main import main
from pushplan.errors import PlanningError
from pushplan.mechanics.chain import Chain, Drive
from pushplan.planners.controls import HALVINGS, MOST_MARGIN, automatic_margin
from pushplan.planners.planner import plan
from pushplan.plans.plan import Plan
from pushplan.scenario.builders import box, build_scenario, plate
from pushplan.scenario.file import load_scenario
from pushplan.scenario.model import Scenario
from pushplan.sets.named import stable_set
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray

ITERATIONS = 6000


def evenly(count: int) -> FloatArray:
    """Unit vectors (k, 3) evenly over the half of the sphere with x >= 0."""
    k = np.arange(count) + 0.5
    height, angle = 1.0 - 2.0 * k / count, np.pi * (1.0 + 5.0**0.5) * k
    flat = np.sqrt(1.0 - height**2)
    return np.stack([np.abs(flat * np.cos(angle)), flat * np.sin(angle), height], axis=1)


def largest_margin(stable: StableSet) -> float:
    """The largest margin of dense twists, and of denser ones around the best, thrice."""
    scale = np.array([1.0, 1.0, 1.0 / stable.chain.characteristic_length])
    center, radius, best = np.zeros(3), 1.0, -1.0
    for _ in range(4):
        near = center + radius * evenly(40_000) * np.linspace(0.1, 1.0, 40_000)[::-1, None]
        near = np.vstack([near, center - (near - center)]) if center.any() else near
        margins = stable.margin(near * scale)
        center, radius = near[int(margins.argmax())], 0.1 * radius
        best = max(best, float(margins.max()))
    return best


def made_by(drive: Drive) -> FloatArray:
    """Twists (k, 3) of the plate while the axle's middle moves forward along its own axis, and turns at any rate."""
    assert drive.axle is not None
    x, y, heading = drive.axle
    tightest = 1.0 / drive.min_radius if drive.min_radius > 0.0 else 100.0
    omega = np.concatenate([np.linspace(-1.0, 1.0, 40_001) * min(tightest, s) for s in (100.0, 3.0)])
    forward = np.array([np.cos(heading), np.sin(heading)])
    return np.column_stack([forward[0] + omega * y, forward[1] - omega * x, omega])


def slippery(make_chain: ChainMaker, friction: float) -> Chain:
    return make_chain.boxes(2, contact_friction=friction, pusher_friction=friction)


@pytest.mark.parametrize("friction", [0.02, 0.05, 0.09, 0.15, 0.5])
def test_auto_is_a_twentieth_or_half_of_the_largest_margin_there_is(
    make_chain: ChainMaker, friction: float
) -> None:
    chain = slippery(make_chain, friction)
    best = largest_margin(stable_set(chain))
    found = automatic_margin(stable_set(chain), chain.pusher.drive)
    assert min(MOST_MARGIN, 0.5 * best) - 1e-12 <= found <= min(0.05, 0.5 * best * 1.01)


@pytest.mark.parametrize("friction", [0.05, 0.1, 0.5])
@pytest.mark.parametrize("radius", [0.0, 0.6])
@pytest.mark.parametrize("aside", [0.0, 0.01])
def test_with_wheels_only_twists_that_these_make_count(
    make_chain: ChainMaker, friction: float, radius: float, aside: float
) -> None:
    chain = slippery(make_chain, friction)
    kind = "car" if radius else "differential"
    drive = Drive(kind, np.array([-0.2, aside, 0.0]), radius)
    best = float(stable_set(chain).margin(made_by(drive)).max())
    found = automatic_margin(stable_set(chain), drive)
    assert min(MOST_MARGIN, 0.5 * best) == pytest.approx(found, rel=0.01)


@cache
def u_turn(side: float = 2.6) -> Scenario:
    """Slippery boxes that have to turn round where only wide turns have half of the largest margin."""
    friction = 0.08
    return build_scenario(
        "u-turn",
        [box("near", 0.2, 0.3, 2.0), box("far", 0.2, 0.3, 2.0)],
        plate(0.3, friction),
        (0.6, side - 0.25, np.pi),
        floor_friction=0.3,
        contact_friction=friction,
        start=(0.6, 0.25, 0.0),
        workspace={"x": [0.0, 1.3 * side], "y": [0.0, side]},
    )


@cache
def turned(margin: float | None = None) -> Plan:
    return plan(u_turn(), margin=margin, time_limit=60.0, iterations=ITERATIONS)


def test_the_margin_is_lowered_in_halvings_until_there_is_a_path() -> None:
    result = turned()
    assert result.solved, result.reason
    assert result.margin_asked is not None
    assert result.margin is not None
    assert result.margin_asked == pytest.approx(automatic_margin(u_turn().stable_set(), Drive()))
    halvings = np.log2(result.margin_asked / result.margin)
    assert halvings == pytest.approx(round(float(halvings)), abs=1e-9)
    assert 1 <= halvings <= HALVINGS
    assert result.min_margin is not None
    assert result.margin < result.min_margin < result.margin_asked
    assert result.lowered == (
        f"margin {result.margin:.2g} instead of {result.margin_asked:.2g}: no path was found with more"
    )


def test_a_first_path_depends_on_no_limit() -> None:
    """Margins take turns: the first path is the same one, however long a search may take."""
    first, longer = (plan(u_turn(), time_limit=limit, first=True) for limit in (60.0, 6000.0))
    assert first.solved, first.reason
    assert first.margin is not None
    assert first.margin <= 0.5 * (first.margin_asked or 0.0)
    assert first.improvements[0].iterations == longer.improvements[0].iterations < ITERATIONS
    assert first.cost == longer.cost


def test_a_stated_margin_is_never_lowered() -> None:
    asked = turned().margin_asked
    assert asked is not None
    result = turned(asked)
    assert not result.solved
    assert (result.margin_asked, result.margin, result.lowered) == (asked, asked, "")
    kept = turned(turned().margin)
    assert kept.solved, kept.reason
    assert kept.lowered == ""


def test_all_margins_share_one_time_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """No margin helps, nothing proves it, and each of six searches would take as long as it is given."""
    looked = count()
    monkeypatch.setattr("time.perf_counter", lambda: 0.005 * next(looked))  # a clock that nothing else slows
    result = plan(u_turn(1.6), time_limit=1.5, planner="rrt")
    assert not result.solved
    assert (result.margin or 1.0) < (result.margin_asked or 0.0)
    assert 1.2 < result.planning_s < 3.0


@pytest.fixture(scope="module")
def u_turn_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("margins") / "u-turn.json"
    path.write_text(u_turn().to_json())
    return path


def test_the_output_and_the_json_say_that_the_margin_was_lowered(
    u_turn_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = str(tmp_path / "run.mcap")
    words = [
        "plan",
        str(u_turn_file),
        "--iterations",
        str(ITERATIONS),
        "--time-limit",
        "60",
        "--json",
        "-o",
        log,
    ]
    assert main(words) == 0
    said = capsys.readouterr()
    found, result = json.loads(said.out), turned()
    assert result.lowered
    assert result.lowered in " ".join(said.err.split())
    assert found["margin_asked"] == pytest.approx(result.margin_asked)
    assert found["margin"] == pytest.approx(result.margin)
    assert found["min_margin"] > found["margin"]
    assert found["min_dynamic_margin"] > 0.5 * found["margin"]
    assert main(["replay", log]) == 0
    assert result.lowered in " ".join(capsys.readouterr().out.split())


def test_a_margin_of_zero_needs_quasi_static_contacts() -> None:
    said = "a margin of 0 leaves the contacts nothing to spare for inertia"
    with pytest.raises(PlanningError, match=said):
        plan(load_scenario("free-space"), margin=0.0)
    with pytest.raises(PlanningError, match=said):
        plan(load_scenario("free-space").with_margin(0.0))
    result = plan(load_plain("free-space"), time_limit=60.0, iterations=2000)
    assert result.solved
    assert result.margin == result.margin_asked == 0.0


def test_without_inertia_a_slip_by_it_is_a_warning(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A push at the limit, as fast as a strong pusher can: the plan stands, and the warning with it."""
    scenario = load_plain("two-crates")
    limits = replace(scenario.chain.pusher.limits, speed=0.5, acceleration=3.0, jerk=60.0)
    pusher = {**scenario.stated["pusher"], "limits": vars(limits)}
    document = {**scenario.resolved(), "pusher": pusher}
    path = tmp_path / "fast.json"
    path.write_text(json.dumps(document))
    words = ["plan", str(path), "--iterations", "2000", "--time-limit", "60", "--margin", "0", "--json"]
    assert main(words) == 0
    said = capsys.readouterr()
    found = json.loads(said.out)
    assert found["solved"] is True
    assert found["min_dynamic_margin"] < 0.0
    assert found["contact_lost"] is None
    assert "inertia was left out (limits.contact: quasi-static)" in " ".join(said.err.split())
