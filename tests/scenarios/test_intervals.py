"""Numbers with intervals or uncertainty: every answer holds for all values in them."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from conftest import there

from pushplan.errors import PushplanError, ScenarioError
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.dynamics import dynamic_margins
from pushplan.mechanics.faces import pushed_at
from pushplan.mechanics.support import FeetSupport
from pushplan.planner import plan
from pushplan.scenario.check import check_scenario
from pushplan.scenario.file import scenario_from_document, scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.sets.named import stable_set_over
from pushplan.util.arrays import FloatArray

TEXT = """\
format: pushplan/1
floor: {friction: [0.2, 0.4]}
objects:
  - {name: near, shape: {box: [0.1, 0.08]}, mass: ["700 g", 1.9]}
  - name: far
    shape: {box: [0.1, 0.08]}
    mass: 0.8
    floor_friction: 0.3
    support: {feet: [[-0.04, -0.03, [0.1, 0.4]], [0.04, -0.03, [0, 40 %]],
                     [0.04, 0.03, 0.25], [-0.04, 0.03, [10 %, 0.4]]]}
contacts: {friction: [14 deg, 0.5]}
pusher: {width: 0.2, friction: [0.5, 0.6]}
goal: {pose: [0.8, 0.3, 40 deg]}
"""


@cache
def scenario() -> Scenario:
    return scenario_from_text(TEXT)


def member(chain: Chain, rng: np.random.Generator) -> Chain:
    """Return a chain with random values in the intervals of TEXT, half of them at the ends."""

    def between(low: float, high: float) -> float:
        return float(rng.choice([low, high, rng.uniform(low, high), rng.uniform(low, high)]))

    near, far = chain.objects
    while True:
        loads = np.array([between(0.1, 0.4), between(1e-6, 0.4), 0.25, 0.0])
        loads[3] = 1.0 - loads.sum()
        if 0.1 <= loads[3] <= 0.4:
            break
    assert isinstance(far.support, FeetSupport)
    objects = (
        replace(near, mass=between(0.7, 1.9), floor_friction=between(0.2, 0.4)),
        replace(far, support=FeetSupport(far.support.positions, loads)),
    )
    frictions = between(0.5, 0.6), between(np.tan(np.radians(14.0)), 0.5)
    contacts = tuple(replace(c, friction=mu) for c, mu in zip(chain.contacts, frictions, strict=True))
    return replace(chain, objects=objects, contacts=contacts)


def test_intervals_are_read_in_every_place() -> None:
    """The chain has the midpoint of loads and the lowest contact friction."""
    interval, chain = there(scenario().interval), scenario().chain
    np.testing.assert_allclose(interval.mass, [[0.7, 1.9], [0.8, 0.8]])
    np.testing.assert_allclose(interval.floor_friction, [[0.2, 0.4], [0.3, 0.3]])
    np.testing.assert_allclose(interval.fractions[1], [[0.1, 0.4], [0.0, 0.4], [0.25, 0.25], [0.1, 0.4]])
    assert [obj.mass for obj in chain.objects] == pytest.approx([1.3, 0.8])
    assert chain.objects[0].floor_friction == pytest.approx(0.3)
    assert [c.friction for c in chain.contacts] == pytest.approx([0.5, np.tan(np.radians(14.0))])
    assert isinstance(chain.objects[1].support, FeetSupport)
    assert chain.objects[1].support.fractions == pytest.approx([0.265, 0.22, 0.25, 0.265])


def test_a_motion_keeps_its_margin_with_inertia_for_random_members() -> None:
    """Every contact keeps half of the margin with inertia for all masses, loads and frictions."""
    found = plan(scenario(), iterations=200, time_limit=60.0)
    trajectory = there(found.trajectory)
    assert there(found.min_dynamic_margin) > 0.5 * there(found.margin) > 0.0
    times = trajectory.t[1:-1]
    twists, rates = trajectory.twists_at(times), trajectory.rates_at(times)
    moving = np.abs(twists).max(axis=1) > 1e-4
    rng = np.random.default_rng(5)
    for _ in range(30):
        margins = dynamic_margins(member(scenario().chain, rng), twists[moving], rates[moving])
        assert margins.min() > 0.5 * there(found.margin)


def test_loads_of_feet_must_sum_to_1_for_every_source_of_intervals() -> None:
    feet = "support: {feet: [[-0.04, -0.03, 40 %], [0.04, -0.03, 35 %], [0.0, 0.03, 35 %]]}"
    text = re.sub(r"support: .*\n.*\n", f"{feet}\n", TEXT) + "uncertainty: {load: 20 %}\n"
    with pytest.raises(ScenarioError, match=r"objects\[1\].support: load fractions sum to 1.1; they must sum to 1"):
        scenario_from_text(text)
    assert scenario_from_text(text.replace("40 %", "30 %")).has_intervals


def test_sets_that_cannot_take_intervals_say_so() -> None:
    """All sets except `cof` accept them; `robust` does not if shares of loads are unknown."""
    what = "not linear in the loads"
    (finding,) = check_scenario(scenario_from_text(TEXT + "stability: {set: cof}\n"))
    assert finding.where == "stability.set"
    assert what in finding.what
    with pytest.raises(PushplanError, match=what):
        scenario().stable_set("cof")
    assert check_scenario(scenario_from_text(TEXT + "stability: {set: robust}\n")) == ()
    assert check_scenario(scenario()) == ()


LINE = "uncertainty: {contact_friction: 20 %, floor_friction: 0.2, load: 10 %}\n"
FEET = "support: {feet: [[-0.04, -0.03, 0.2], [0.04, -0.03, 0.3], [0.04, 0.03, 0.25], [-0.04, 0.03, 0.25]]}"
UNCERTAIN = f"""\
format: pushplan/1
floor: {{friction: 0.3}}
objects:
  - {{name: near, shape: {{box: [0.1, 0.08]}}, mass: 1.2}}
  - {{name: far, shape: {{box: [0.1, 0.08]}}, mass: 0.8, floor_friction: "14 deg", {FEET}}}
contacts: {{friction: 0.4}}
pusher: {{width: 0.2, friction: 0.5}}
goal: {{pose: [0.8, 0.3, 40 deg]}}
"""
MU = float(np.tan(np.radians(14.0)))


@cache
def uncertain(line: str = LINE) -> Scenario:
    return scenario_from_text(line + UNCERTAIN)


def twists(seed: int, count: int) -> FloatArray:
    spread = np.random.default_rng(seed).normal(size=(count, 3)) * [0.2, 0.2, 2.0]
    return np.asarray(spread + np.array([1.0, 0.0, 0.0]), dtype=np.float64)


def test_uncertainty_equals_written_intervals() -> None:
    written = UNCERTAIN.replace("{friction: 0.3}", "{friction: [0.24, 0.36]}").replace("0.4}", "[0.32, 0.48]}")
    written = written.replace('"14 deg"', f"[{0.8 * MU!r}, {1.2 * MU!r}]").replace("0.5}", "[0.4, 0.6]}")
    for number in ("0.2", "0.3", "0.25"):
        low, high = 0.9 * float(number), 1.1 * float(number)
        written = written.replace(f"0.03, {number}]", f"0.03, [{low!r}, {high!r}]]")
    line = uncertain("uncertainty: {contact_friction: 20 %, floor_friction: 20 %, load: 10 %}\n")
    bare = replace(there(line.interval), pressures={})
    at = twists(0, 200)
    np.testing.assert_allclose(
        stable_set_over(bare).margin(at), scenario_from_text(written).stable_set().margin(at), atol=1e-12
    )


HIGH = """\
format: pushplan/1
floor: {friction: 0.3}
objects:
  - {name: near, shape: {box: [0.1, 0.1]}, mass: 1, height: 0.1}
  - {name: far, shape: {box: [0.1, 0.1]}, mass: 1, height: 60 mm, center_of_mass: [0, 0, 20 mm]}
contacts: {friction: 0.4, between: [{objects: [near, far], height: [10 mm, 40 mm]}]}
pusher: {width: 0.2, friction: 0.5, contact_height: [30 mm, 50 mm]}
uncertainty: {contact_friction: 20 %, floor_friction: 20 %, load: 20 %}
goal: {pose: [0.8, 0.3, 40 deg]}
"""


def test_contact_heights_do_not_depend_on_the_pusher() -> None:
    scenario = scenario_from_text(HIGH)
    assert scenario_from_document(scenario.resolved()) == scenario
    assert [obj.center_height for obj in scenario.chain.objects] == [0.05, 0.02]
    np.testing.assert_allclose(scenario.chain.contact_heights, [[0.03, 0.05], [0.01, 0.04]])
    turned = pushed_at(scenario.chain, "front")
    assert [obj.name for obj in turned.objects] == ["far", "near"]
    np.testing.assert_allclose(turned.contact_heights, [[0.03, 0.05], [0.01, 0.04]])
    assert scenario.stable_set().contains([[1.0, 0.0, 0.0]])
    assert not check_scenario(scenario)
    with pytest.raises(ScenarioError, match=r"height: reaches 70 mm, but 'far' is 60 mm high; allowed: up to 60 mm"):
        scenario_from_text(HIGH.replace("40 mm]}]", "70 mm]}]"))
    (finding,) = check_scenario(scenario_from_text(HIGH.replace("[30 mm, 50 mm]", "0.09")))
    assert finding.where == "pusher"
    assert "up to" in finding.what


@pytest.mark.parametrize("uncertain", ["a", "b"])
def test_one_load_with_an_interval_is_enough(uncertain: str) -> None:
    masses = {"a": 1.0, "b": 1.0} | {uncertain: [1.0, 2.0]}
    stated = {
        "format": "pushplan/1",
        "floor": {"friction": 0.3},
        "objects": [
            {"name": name, "shape": {"box": [0.2, 0.2]}, "mass": mass, "pose": [k + 1.0, 1.0, 0.0]}
            for k, (name, mass) in enumerate(masses.items())
        ],
        "pusher": {"width": 0.24, "friction": 0.5},
        "robot": {"footprint": {"box": [0.35, 0.24], "pose": [-0.175, 0.0, 0.0]}, "start": [0.0, 0.0, 0.0]},
        "goals": {"a": {"pose": [1.0, 3.0, 0.0]}, "b": {"pose": [2.0, 3.0, 0.0]}},
    }
    assert scenario_from_document(stated).has_intervals
