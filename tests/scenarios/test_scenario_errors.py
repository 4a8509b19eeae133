"""Errors and warnings of scenarios: the place, the problem and the allowed values."""

import math
from pathlib import Path

import pytest
from conftest import there
from hypothesis import given
from hypothesis import strategies as st
from scenarios.conftest import Changed

from pushplan.errors import Finding, ScenarioError
from pushplan.scenario.check import questions
from pushplan.scenario.file import load_scenario, scenario_from_text
from pushplan.scenario.source import MOST_BYTES, MOST_DEPTH, MOST_NODES, DocumentError, Source, resolve


def mistakes() -> list[tuple[str, str, str]]:
    """Return texts of the valid scenario, their replacements, and the resulting errors."""
    text = Path(__file__).with_name("mistakes.txt").read_text(encoding="utf-8")
    blocks = [block.splitlines() for block in text.split("\n\n")[1:]]
    sides = [["\n".join(line[1:] for line in block if line[0] == sign) for sign in "-+"] for block in blocks]
    return [(old, new, block[-1]) for (old, new), block in zip(sides, blocks, strict=True)]


@pytest.mark.parametrize(("old", "new", "finding"), mistakes())
def test_one_mistake_gives_one_error(valid: Changed, old: str, new: str, finding: str) -> None:
    (found,) = valid.findings((old, new))
    assert found.startswith(finding)


def test_errors_of_all_stages_are_reported_at_once_in_file_order(valid: Changed) -> None:
    changes = [
        ("friction: 0.30", "friction: 0.30, colour: grey"),
        ("mass: 1.2", "mass: -1.2"),
        ("offset: 0.01", "pose: [0.1468, 0, 0]"),
        ("start: [0.0, 0.0, 0.0]", "start: [-1.0, 0.0, 0.0]"),
        ("of: far", "of: nowhere"),
        ("margin: auto", "margin: &m auto"),
        ("seed: 1", "seed: one"),
    ]
    places = [
        "3:25: floor.colour", "7:11: objects[0].mass", "9:5: objects[1]", "24:7: goal.of", "31:32: stability.margin",
        "32:45: planner.seed",
    ]  # fmt: skip
    found = [": ".join(line.split(": ")[:2]) for line in valid.findings(*changes)]
    assert found == [f"f.yaml:{place}" for place in places]


def test_a_pressure_map_stays_in_the_folder_of_the_scenario(valid: Changed, tmp_path: Path) -> None:
    (tmp_path / "inside").mkdir()
    (tmp_path / "secret.csv").write_text("x,y,pressure\n0,0,1\n")
    (tmp_path / "inside" / "link.csv").symlink_to(tmp_path / "secret.csv")
    file = tmp_path / "inside" / "f.yaml"
    for name in ("../secret.csv", str(tmp_path / "secret.csv"), "link.csv"):
        file.write_text(valid(("support: uniform", f"support: {{pressure_map: '{name}'}}")))
        with pytest.raises(ScenarioError) as caught:
            load_scenario(file)
        assert [f.text("f.yaml") for f in caught.value.findings] == [
            f"f.yaml:8:14: objects[0].support: has the name '{name if len(name) < 41 else name[:37] + '...'}'; "
            "allowed: a file in the scenario's folder"
        ]


IN_MILLIMETRES = """\
format: pushplan/1
name: mm
floor: {friction: 0.30}
objects:
  - {name: near, shape: {box: [120, 80]}, mass: 1.2}
  - {name: far, shape: {polygon: [[-50, -40], [50, -40], [50, 40], [-50, 40]]}, mass: 0.8}
contacts: {friction: 0.5}
pusher: {width: 200, thickness: 30, friction: 0.50, limits: {speed: 200}}
start: [0, 0, 0]
goal: {pose: [3000, 1000, 5]}
workspace: {x: [-0.5, 4], y: [-0.5, 2]}
"""
SMALL = "[-0.05, -0.04], [0.05, -0.04], [0.05, 0.04], [-0.05, 0.04]"


def asked(text: str) -> list[str]:
    return [question.text("f.yaml") for question in questions(there(scenario_from_text(text).origin))]


def test_a_scenario_in_millimetres_gives_one_error(tmp_path: Path) -> None:
    file = tmp_path / "mm.yaml"
    file.write_text(IN_MILLIMETRES)
    with pytest.raises(ScenarioError) as caught:
        load_scenario(file)
    (finding,) = caught.value.findings
    assert (finding.where, finding.line, finding.column) == ("objects[0].shape.box", 5, 31)
    assert 'is 120 m long: plain numbers are in m; for mm, write "120 mm"' in finding.what
    assert "more error" in finding.what


@pytest.mark.parametrize(("pusher", "question"), [
    ("limits: {speed: 30}", "pusher.limits.speed: is 30 m/s; for mm/s, write"),
    ("limits: {speed: 1.0e-4}", "pusher.limits.speed: is 0.1 mm/s: a push takes hours"),
    ("drive: {differential: {axle: [-350, 0, 0]}}", "axle[0]: is -350 m from the plate: plain numbers are in m"),
    ("drive: {differential: {axle: [-0.35, 0, 0]}}, limits: {speed: 30 m/s}", ""),
])  # fmt: skip
def test_implausible_speeds_and_axles_are_questioned(pusher: str, question: str) -> None:
    text = IN_MILLIMETRES.replace("[3000, 1000, 5]", "[3, 1, 0]").replace("[120, 80]", "[0.12, 0.08]")
    text = text.replace("[-50, -40], [50, -40], [50, 40], [-50, 40]", SMALL)
    text = text.replace("width: 200, thickness: 30,", "width: 0.2, thickness: 0.03,")
    found = asked(text.replace("limits: {speed: 200}", pusher))
    assert len(found) == bool(question)
    assert question in "".join(found)


def findings_of(data: bytes) -> tuple[Finding, ...]:
    """Return the errors of a text that cannot be read completely."""
    try:
        return Source(data).findings
    except DocumentError as error:
        return error.findings


def refusal(data: bytes | str) -> str:
    """Return the errors as lines."""
    raw = data if isinstance(data, bytes) else data.encode()
    return "\n".join(finding.text("f") for finding in findings_of(raw))


@pytest.mark.parametrize(("text", "value"), [
    ("1e-3", 1e-3), ("-.5", -0.5), ("1.", 1.0), ("0o17", 15), ("0x1F", 31), ("+12", 12), ("1" * 30, int("1" * 30)),
    ("true", True), ("FALSE", False), ("~", None), ("", None), ("no", "no"), ("on", "on"), ("1_000", "1_000"),
    ("1:30", "1:30"), ("90 deg", "90 deg"), ("0b1", "0b1"), ("1e", "1e"), (".", "."), ("-.Inf", -math.inf),
    ("1e999", math.inf), ("9" * 5000, math.inf), ("-" + "9" * 5000, -math.inf),
])  # fmt: skip
def test_scalars_follow_the_core_schema_of_yaml_1_2(text: str, value: object) -> None:
    found = resolve(text)
    assert found == value
    assert type(found) is type(value)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_float_that_python_prints_is_read_back(value: float) -> None:
    assert resolve(repr(value)) == value


@pytest.mark.parametrize(("text", "finding"), [
    ("a: *x", "f:1:4: a: aliases (*x) are not supported; write the value out"),
    ("a: &x 1", "f:1:4: a: anchors (&x) are not supported; leave it out"),
    ("a: !!float 1", "f:1:4: a: tags (tag:yaml.org,2002:float) are not supported; leave it out"),
    ("a: !mine 1", "f:1:4: a: tags (!mine) are not supported; leave it out"),
    ("b:\n  <<: {a: 1}", "f:2:3: b.<<: merge keys (<<) are not supported; write the keys out"),
    ("a: 1\nb: 2\na: 3", "f:3:1: a: the key is repeated, first in line 1; keep one"),
    ("x:\n  - {a: 1, a: 2}", "f:2:12: x[0].a: the key is repeated, first in line 2; keep one"),
    ("? [1, 2]\n: 3", "f:1:3: ?: a key must be text, not a list or a mapping"),
    ("a: 1\n---\nb: 2", "f:2:1: a second document begins here; a file must hold one"),
    ("a: 1\n\tb: 2", "f:2:1: not valid YAML: a tab is not allowed here; indent with spaces"),
    ("a: [1, 2", "f:1:9: not valid YAML: a list in [...] lacks a ',' or its ']'"),
    ("a: {b: 1", "f:1:9: not valid YAML: a mapping in {...} lacks a ',' or its '}'"),
    ("a: 'x", "f:1:6: not valid YAML: a quoted text lacks its closing quote"),
    (
        "a: b: c",
        "f:1:5: not valid YAML: a ':' is not allowed here; indent the line like its neighbours, or quote the text",
    ),
    ('a: "\\U00110000"', "f:1:7: not valid YAML: a number or an escape is out of range"),
    ("a: x\x00y", "f:1:5: the control character U+0000 is not allowed"),
    ("a: 1\nb: \u2028", "f:2:4: the control character U+2028 is not allowed"),
    (b"a: 1\nb: '\xff'", "f:2:5: the byte 0xff is not UTF-8; save the file as UTF-8"),
    ("a".encode("utf-16"), "f:1:1: the byte 0xff is not UTF-8; save the file as UTF-8"),
])  # fmt: skip
def test_errors_name_place_and_reason(text: bytes | str, finding: str) -> None:
    assert refusal(text) == finding


def test_size_depth_and_number_of_values_are_limited() -> None:
    assert refusal(b"#" * (MOST_BYTES + 1)) == f"f:1:1: the file is larger than the {MOST_BYTES} bytes allowed"
    deep = "[" * 100 + "]" * 100
    assert refusal(deep) == f"f:1:{MOST_DEPTH + 2}: [0][0]: nested deeper than the {MOST_DEPTH} levels allowed"
    assert Source(("[" * MOST_DEPTH + "]" * MOST_DEPTH).encode()).findings == ()
    many = "[" + "1," * MOST_NODES + "]"
    assert refusal(many).endswith(f"the file holds more than the {MOST_NODES} values allowed")


@given(st.text(alphabet="\t\n :-[]{}&*!|>'\"%@`#,?.~<=\\0a1é\x85", max_size=30))
def test_any_text_is_read_or_refused_with_a_place(text: str) -> None:
    assert all(finding.line is not None for finding in findings_of(text.encode()))
