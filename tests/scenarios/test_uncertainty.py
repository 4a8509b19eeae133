"""`uncertainty` in one line: the same as writing every interval, and it holds for all worlds within it."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pushplan.errors import PushplanError
from pushplan.mechanics.chain import Chain, PushedObject
from pushplan.mechanics.support import FeetSupport, PressureMapSupport
from pushplan.scenario.check import check_scenario
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.sets.interval_set import stable_set_over
from pushplan.sets.named import stable_set
from pushplan.util.arrays import FloatArray

LINE = "uncertainty: {contact_friction: 20 %, floor_friction: 0.2, load: 10 %}\n"
FEET = "support: {feet: [[-0.04, -0.03, 0.2], [0.04, -0.03, 0.3], [0.04, 0.03, 0.25], [-0.04, 0.03, 0.25]]}"
TEXT = f"""\
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
def scenario(line: str = LINE) -> Scenario:
    return scenario_from_text(line + TEXT)


def twists(seed: int, count: int) -> FloatArray:
    spread = np.random.default_rng(seed).normal(size=(count, 3)) * [0.2, 0.2, 2.0]
    return np.asarray(spread + np.array([1.0, 0.0, 0.0]), dtype=np.float64)


def test_it_is_the_same_as_writing_the_intervals() -> None:
    written = TEXT.replace("{friction: 0.3}", "{friction: [0.24, 0.36]}").replace("0.4}", "[0.32, 0.48]}")
    written = written.replace('"14 deg"', f"[{0.8 * MU!r}, {1.2 * MU!r}]").replace("0.5}", "[0.4, 0.6]}")
    for number in ("0.2", "0.3", "0.25"):
        low, high = 0.9 * float(number), 1.1 * float(number)
        written = written.replace(f"0.03, {number}]", f"0.03, [{low!r}, {high!r}]]")
    line = scenario("uncertainty: {contact_friction: 20 %, floor_friction: 20 %, load: 10 %}\n")
    assert line.interval is not None
    bare = replace(line.interval, pressures={})
    at = twists(0, 200)
    np.testing.assert_allclose(
        stable_set_over(bare).margin(at), scenario_from_text(written).stable_set().margin(at), atol=1e-12
    )


def world(chain: Chain, rng: np.random.Generator) -> Chain:
    """Return a chain within LINE of the stated one: a pressure that is 10 % off by halves, or at random places."""

    def off(share: float) -> float:
        return float(1.0 + share * rng.choice([-1.0, 1.0, rng.uniform(-1.0, 1.0)]))

    def standing(obj: PushedObject) -> PushedObject:
        obj = replace(obj, floor_friction=obj.floor_friction * off(0.2), pose_chain=obj.pose_chain)
        if isinstance(obj.support, FeetSupport):
            points, parts = obj.support.positions, obj.support.fractions
        else:
            points, parts = obj.support.cells()
        assert parts is not None
        score = points @ rng.normal(size=2) if rng.random() < 0.7 else rng.normal(size=len(points))
        order, theta = np.argsort(score), np.empty(len(points))
        before = np.cumsum(parts[order]) - parts[order]
        theta[order] = 2.0 * np.clip((0.5 - before) / parts[order], 0.0, 1.0) - 1.0
        loads = parts * (1.0 + 0.1 * theta)
        kind = FeetSupport if isinstance(obj.support, FeetSupport) else PressureMapSupport
        return replace(obj, support=kind(points, loads / loads.sum()))

    stated = [0.5, 0.4]
    contacts = tuple(replace(c, friction=mu * off(0.2)) for c, mu in zip(chain.contacts, stated, strict=True))
    return replace(chain, objects=tuple(standing(obj) for obj in chain.objects), contacts=contacts)


@pytest.mark.parametrize("name", ["ecof", "translation"])
def test_the_set_holds_in_random_worlds(name: str) -> None:
    """What is in it is stable in each of them, with no smaller margin."""
    at = twists(2, 300) * ([1.0, 1.0, 0.0] if name == "translation" else 1.0)
    margin, rng = scenario().stable_set(name).margin(at), np.random.default_rng(3)
    inside = margin > 0.0
    least = np.full(len(at), np.inf)
    for _ in range(150):
        least = np.minimum(least, stable_set(world(scenario().chain, rng), name).margin(at))
    assert inside.sum() > 30
    assert (least[inside] > 0.0).all()
    if name == "ecof":
        assert (margin[inside] <= least[inside] + 1e-9).all()
        assert inside.sum() < stable_set(scenario().chain).contains(at).sum()


@pytest.mark.parametrize(
    ("line", "name", "needed"),
    [
        (LINE, "ecof", "floor_friction and load; leave them out"),
        ("uncertainty: {load: 5 %}\n", "ecof", "load; leave it out"),
        ("uncertainty: {floor_friction: 5 %}\n", "robust", "floor_friction; leave it out"),
    ],
)
def test_pushes_above_the_floor_say_what_to_do(line: str, name: str, needed: str) -> None:
    text = (
        TEXT.replace("friction: 0.5}", "friction: 0.5, contact_height: 1 cm}")
        + f"stability: {{set: {name}}}\n"
    )
    found = scenario_from_text(line + text)
    (finding,) = check_scenario(found)
    assert (finding.where, finding.line, finding.what) == (
        "uncertainty",
        1,
        "pusher.contact_height is 0.01 m, and a push above the floor shifts the loads by their floor friction: the "
        f"set '{name}' needs numbers for {needed} (contact_friction may stay) and ask for a larger stability.margin, "
        "or set contact_height: 0",
    )
    with pytest.raises(PushplanError, match="as numbers, or a contact height of 0"):
        found.stable_set()
    contact_only = scenario_from_text("uncertainty: {contact_friction: 10 %}\n" + text)
    assert not [finding for finding in check_scenario(contact_only) if finding.where == "uncertainty"]
