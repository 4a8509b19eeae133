"""Meaning of scenario files against earlier versions, the reference and the JSON Schema; numbers with units."""

import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any

import jsonschema
import mutators
import numpy as np
import pytest
from conftest import Captured
from pydantic import BaseModel
from pydantic_core import PydanticCustomError

import pushplan
from pushplan.bench.schema import suite_schema
from pushplan.bench.suite import suite_names, suite_text
from pushplan.cli.main import main
from pushplan.scenario import bodies, schema, units
from pushplan.scenario.file import example_names, example_text, load_scenario
from pushplan.scenario.model import Scenario
from pushplan.scenario.schema import ScenarioFile, scenario_schema, schema_file, schema_text
from pushplan.scenario.source import Source
from pushplan.scenario.units import Quantity, Stated, either_way, friction, or_interval
from pushplan.scenario.validation import validate
from pushplan.util.arrays import FloatArray

STATED: dict[str, Any] = json.loads(Path(__file__).with_name("meanings.json").read_text("utf-8"))
OFFICE = Path(__file__).parents[2] / "examples" / "office"
FEW = 20
"""Largest number of obstacles that are compared one by one; for maps with more, their number and sums."""


@pytest.mark.parametrize("name", STATED)
def test_older_scenario_files_keep_their_meaning(name: str) -> None:
    text = "\n".join(STATED[name]["text"])
    maps = {file.name: file.read_bytes() for file in OFFICE.iterdir() if "map: " in text}
    scenario = pushplan.scenario_from_text(text, "__frozen.yaml", maps)
    if "movable" not in STATED[name]:
        assert list(_changed(STATED[name]["meaning"], _meaning(scenario))) == []
        return
    assert [load.name for load in scenario.loads if load.name not in scenario.goals] == STATED[name]["movable"]
    for body, meant in STATED[name]["meaning"].items():
        assert list(_changed(meant, _meaning(scenario.alone(body)))) == []


def _changed(before: Any, now: Any, place: str = "") -> Iterator[str]:
    """Yield the places at which an earlier value is missing or different."""
    if isinstance(before, dict):
        for key, value in before.items():
            if not isinstance(now, dict) or key not in now:
                yield f"{place}.{key} is gone"
            else:
                yield from _changed(value, now[key], f"{place}.{key}")
    elif isinstance(before, list) and isinstance(now, list | tuple) and len(before) == len(now):
        for i, (one, other) in enumerate(zip(before, now, strict=True)):
            yield from _changed(one, other, f"{place}[{i}]")
    elif isinstance(before, float) and isinstance(now, float):
        if not math.isclose(before, now, rel_tol=1e-12, abs_tol=1e-12):
            yield f"{place}: {before!r} became {now!r}"
    elif before != now:
        yield f"{place}: {before!r} became {now!r}"


def _meaning(scenario: Scenario) -> dict[str, Any]:
    """Return the numbers of a scenario of one load."""
    chain = scenario.chain
    meant = scenario.resolved()
    if meant["name"] == "__frozen":
        meant["name"] = ""
    if len(scenario.obstacles) > FEW:
        corners = np.concatenate([getattr(obstacle, "outline", np.empty((0, 2))) for obstacle in scenario.obstacles])
        sums = {"sum": _plain(corners.sum(axis=0)), "squares": _plain((corners**2).sum(axis=0))}
        meant["obstacles"] = {"count": len(scenario.obstacles), "corners": len(corners), **sums}
    meant["chain"] = {
        "contacts": [[c.pusher, c.pushed, _plain(c.right), _plain(c.left), c.friction] for c in chain.contacts],
        "objects": [[_plain(obj.outline), _plain(obj.pose_chain)] for obj in chain.objects],
    }
    if scenario.interval is not None:
        interval = scenario.interval
        meant["interval"] = {
            "mass": _plain(interval.mass),
            "floor_friction": _plain(interval.floor_friction),
            "fractions": {str(k): _plain(spans) for k, spans in interval.fractions.items()},
            "pressures": {str(k): share for k, share in interval.pressures.items()},
        }
    goals = scenario.goals[scenario.load.name]
    meant["goal_chain"] = [_plain(goal.pose_chain) for goal in goals]
    if not scenario.task.held:
        meant["robot_start"] = _plain(scenario.robot_start)
    return meant


def _plain(array: FloatArray | None) -> Any:
    return None if array is None else np.asarray(array, dtype=np.float64).tolist()


LENGTH = Quantity("a length", units.LENGTH, 1e-3, 1e3, "5 mm")
ANGLE = Quantity("an angle", units.ANGLE, -10.0, 10.0, "90 deg")


@pytest.mark.parametrize(("quantity", "text", "value"), [
    (LENGTH, "5 mm", 0.005), (LENGTH, "5mm", 0.005), (LENGTH, " 2.5e1 cm ", 0.25), (LENGTH, "1 in", 0.0254),
    (LENGTH, 3, 3.0), (ANGLE, "90 deg", math.pi / 2), (ANGLE, "-45°", -math.pi / 4), (ANGLE, "500 mrad", 0.5),
    (friction(0.0), "45 deg", 1.0), (friction(0.0), "14 deg", math.tan(math.radians(14.0))),
    (friction(0.0), "0.1 rad", math.tan(0.1)), (friction(0.0), 0.25, 0.25),
    (Quantity("a speed", units.SPEED, 0.0, 10.0), "3.6 km/h", 1.0),
    (Quantity("a jerk", units.JERK, 0.0, 10.0), "500 mm/s^3", 0.5),
    (Quantity("an acceleration", units.ANGULAR_ACCELERATION, 0.0, 10.0), "180 deg/s²", math.pi),
    (Quantity("a speed", units.ANGULAR_SPEED, 0.0, 10.0), "60 rpm", 2.0 * math.pi),
    (Quantity("a mass", units.MASS, 0.0, 10.0), "800 g", 0.8),
    (Quantity("a time", units.TIME, 0.0, 100.0), "1 min", 60.0),
    (Quantity("a part", units.FRACTION, 0.0, 1.0), "25 %", 0.25),
])  # fmt: skip
def test_numbers_with_units_become_si(quantity: Quantity, text: object, value: float) -> None:
    assert quantity.read(text) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(("quantity", "value", "found"), [
    (LENGTH, "90 deg", "'90 deg' is an angle"), (LENGTH, "5 mn", "has the unknown unit 'mn'"),
    (LENGTH, "1.2", "is the text '1.2'"), (LENGTH, 0, "is 0"), (LENGTH, "-5 mm", "is '-5 mm'"),
    (LENGTH, True, "is true"), (LENGTH, None, "is empty"), (LENGTH, [1.0], "is a list of 1"),
    (LENGTH, math.nan, "is nan, which is not finite"),
    (LENGTH, "1e999 m", "is the text '1e999 m', which is not finite"),
    (friction(0.0), "5 mm", "'5 mm' is a length"),
    (friction(0.0), "120 deg", "'120 deg' is not a friction angle"),
    (Quantity("a number", {}, 0, 9, whole=True), 1.5, "is 1.5"),
    (or_interval(LENGTH), [2, 1], "is the interval [2, 1]"), (either_way(LENGTH), [1, 2], "is 1"),
])  # fmt: skip
def test_wrong_numbers_are_reported_with_the_allowed_ones(quantity: Stated, value: object, found: str) -> None:
    with pytest.raises(PydanticCustomError) as caught:
        quantity.read(value)
    assert caught.value.message().startswith(f"{found}; allowed: ")


PAGE = Path(__file__).parents[2] / "docs" / "scenario-file.md"
SECTIONS: dict[str, type[BaseModel]] = {
    "Top level": schema.ScenarioFile, "`objects`": bodies.Object, "`contacts`": bodies.Contacts,
    "`pusher`": bodies.Plate, "`robot`": bodies.Robot, "`goal`": schema.GoalPose,
    "`stability`": schema.StabilitySettings, "`planner`": schema.PlannerSettings,
}  # fmt: skip


def rows(section: str) -> dict[str, str]:
    """Return the rows of a section's tables by key."""
    text = PAGE.read_text(encoding="utf-8").split(f"## {section}\n")[1].split("\n## ")[0]
    found = re.findall(r"^\| `(\w+)` \|(.*)\|$", text, flags=re.MULTILINE)
    return dict(found)


@pytest.mark.parametrize("section", SECTIONS)
def test_every_key_is_described_with_its_default(section: str) -> None:
    described = rows(section)
    fields = dict(SECTIONS[section].model_fields)
    if section == "`pusher`":
        fields |= bodies.MotionLimits.model_fields
    elsewhere = {"limits", "goals", "gather"}  # files with `goals` have their own test
    assert set(described) - elsewhere == set(fields) - elsewhere
    for key, field in fields.items():
        last = described.get(key, "").rsplit("|", 1)[-1]
        assert ("required" in last) == field.is_required(), key
        if isinstance(field.default, str | float | int):
            assert re.search(rf"(^|[\s`]){re.escape(str(field.default))}($|[\s`])", last), key


VARIED = ("two-crates", "feet", "carts", "hook")
BEYOND_A_SCHEMA = re.compile(
    r"^(the edges after corners|corners \[\d+\] and \[\d+\] are the same point|an edge runs back|has an area of"
    r"|is \[.*\]; allowed: \[min, max\] with min < max"
    r"|is '[^']*'; allowed: .* with a unit|is '[^']*'; allowed: .*a friction angle|'.*' is not a friction angle"
    r"|is the text '.*', which is not finite|is '.*', which is not finite)"
)
"""Errors that the loader finds and a schema cannot."""


@pytest.fixture(scope="module")
def checker() -> jsonschema.protocols.Validator:
    """Return a validator as in editors."""
    jsonschema.Draft202012Validator.check_schema(scenario_schema())
    return jsonschema.Draft202012Validator(scenario_schema())


def _document(text: str) -> Any:
    return Source(text.encode()).root.plain()


SCHEMAS = {"scenario": scenario_schema, "suite": suite_schema}


@pytest.mark.parametrize("name", SCHEMAS)
def test_the_packaged_schemas_are_those_of_the_models(name: str, capsys: Captured) -> None:
    text = schema_text(SCHEMAS[name]())
    assert schema_file(name).read_text(encoding="utf-8") == text, (
        f"the models have changed; run `pushplan schema {name} > pushplan/{name}.schema.json`"
    )
    assert main(["schema", name]) == 0
    assert capsys.readouterr().out == text


@pytest.mark.parametrize("name", suite_names())
def test_packaged_suites_are_valid_and_mistakes_are_not(name: str) -> None:
    jsonschema.Draft202012Validator.check_schema(suite_schema())
    checker = jsonschema.Draft202012Validator(suite_schema())
    suite = _document(suite_text(name))
    checker.validate(suite)
    for key, value in (("planers", ["auto"]), ("planners", ["autobahn"]), ("seeds", 0), ("problems", [])):
        assert not checker.is_valid(suite | {key: value})


@pytest.mark.parametrize("name", example_names())
def test_packaged_and_resolved_scenarios_are_valid(name: str, checker: jsonschema.protocols.Validator) -> None:
    checker.validate(_document(example_text(name)))
    checker.validate(load_scenario(name).resolved())


def test_schema_and_loader_agree_on_mutated_files(checker: jsonschema.protocols.Validator) -> None:
    random = Random(7)
    documents = [load_scenario(name).resolved() for name in VARIED]
    documents += [_document(example_text(name)) for name in VARIED]
    accepted = refused = 0
    for _ in range(70):
        document = Source(json.dumps(mutators.mutated_document(random.choice(documents), random)).encode())
        validate(ScenarioFile, document)
        faults = document.findings
        errors = list(checker.iter_errors(document.root.plain()))
        sayable = [f for f in faults if not BEYOND_A_SCHEMA.match(f.what)]
        assert bool(errors) == bool(sayable), (errors[:1], sayable)
        accepted, refused = accepted + (not faults), refused + bool(errors)
    assert accepted > 2
    assert refused > 40
