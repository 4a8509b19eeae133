"""YAML text to located plain data: what is taken, and where and why the rest is refused."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pushplan.errors import Finding
from pushplan.scenario.source import MOST_BYTES, MOST_DEPTH, MOST_NODES, DocumentError, Source, resolve


def findings_of(data: bytes) -> tuple[Finding, ...]:
    """Return the findings about a text that cannot be read, or only in part."""
    try:
        return Source(data).findings
    except DocumentError as error:
        return error.findings


def refusal(data: bytes | str) -> str:
    """Return the findings as lines."""
    raw = data if isinstance(data, bytes) else data.encode()
    return "\n".join(finding.text("f") for finding in findings_of(raw))


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 1e-3),
        ("-.5", -0.5),
        ("1.", 1.0),
        ("0o17", 15),
        ("0x1F", 31),
        ("+12", 12),
        ("1" * 30, int("1" * 30)),
        ("true", True),
        ("FALSE", False),
        ("~", None),
        ("", None),
        ("no", "no"),
        ("on", "on"),
        ("1_000", "1_000"),
        ("1:30", "1:30"),
        ("90 deg", "90 deg"),
        ("0b1", "0b1"),
        ("1e", "1e"),
        (".", "."),
        ("-.Inf", -math.inf),
        ("1e999", math.inf),
        ("9" * 5000, math.inf),
        ("-" + "9" * 5000, -math.inf),
    ],
)
def test_scalars_follow_the_core_schema_of_yaml_1_2(text: str, value: object) -> None:
    found = resolve(text)
    assert found == value
    assert type(found) is type(value)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_float_that_python_prints_is_read_back(value: float) -> None:
    assert resolve(repr(value)) == value


def test_findings_know_their_place() -> None:
    source = Source("# é\na: 1\nb:\n  - x\n  - {c: [1, 2]}\n".encode())
    for place, at_key, position in (
        (("b", 1, "c", 1), False, (5, 13)),
        (("b", 1, "c"), True, (5, 6)),
        (("b", 1, "missing"), False, (5, 5)),
        (("b", 9), False, (4, 3)),
    ):
        found = source.finding(place, "is wrong", at_key)
        assert (found.line, found.column) == position


@pytest.mark.parametrize(
    ("text", "finding"),
    [
        ("a: *x", "f:1:4: a: aliases (*x) are not supported; write the value out"),
        ("a: &x 1", "f:1:4: a: anchors (&x) are not supported; leave it out"),
        ("a: !!float 1", "f:1:4: a: tags (tag:yaml.org,2002:float) are not supported; leave it out"),
        ("a: !mine 1", "f:1:4: a: tags (!mine) are not supported; leave it out"),
        ("b:\n  <<: {a: 1}", "f:2:3: b.<<: merge keys (<<) are not supported; write the keys out"),
        ("a: 1\nb: 2\na: 3", "f:3:1: a: the key stands twice, first in line 1; keep one"),
        ("x:\n  - {a: 1, a: 2}", "f:2:12: x[0].a: the key stands twice, first in line 2; keep one"),
        ("? [1, 2]\n: 3", "f:1:3: ?: a key must be text, not a list or a mapping"),
        ("a: 1\n---\nb: 2", "f:2:1: a second document begins here; a file must hold one"),
        ("a: 1\n\tb: 2", "f:2:1: not valid YAML: a tab cannot stand here; indent with spaces"),
        ("a: [1, 2", "f:1:9: not valid YAML: a list in [...] lacks a ',' or its ']'"),
        ("a: {b: 1", "f:1:9: not valid YAML: a mapping in {...} lacks a ',' or its '}'"),
        ("a: 'x", "f:1:6: not valid YAML: a quoted text lacks its closing quote"),
        (
            "a: b: c",
            "f:1:5: not valid YAML: a ':' cannot stand here; indent the line like its neighbours, or quote the text",
        ),
        ('a: "\\U00110000"', "f:1:7: not valid YAML: a number or an escape is out of range"),
        ("a: x\x00y", "f:1:5: the control character U+0000 is not allowed"),
        ("a: 1\nb: \u2028", "f:2:4: the control character U+2028 is not allowed"),
        (b"a: 1\nb: '\xff'", "f:2:5: the byte 0xff is not UTF-8; save the file as UTF-8"),
        ("a".encode("utf-16"), "f:1:1: the byte 0xff is not UTF-8; save the file as UTF-8"),
    ],
)
def test_refusals_say_where_and_why(text: bytes | str, finding: str) -> None:
    assert refusal(text) == finding


def test_all_that_is_refused_without_stopping_is_told_with_what_stops() -> None:
    assert refusal("a: &x 1\nb: *x\nc: [").splitlines() == [
        "f:1:4: a: anchors (&x) are not supported; leave it out",
        "f:2:4: b: aliases (*x) are not supported; write the value out",
        "f:3:5: not valid YAML: a value is missing here",
    ]


def test_size_depth_and_number_of_values_are_limited() -> None:
    assert (
        refusal(b"#" * (MOST_BYTES + 1)) == f"f:1:1: the file is larger than the {MOST_BYTES} bytes allowed"
    )
    deep = "[" * 100 + "]" * 100
    assert (
        refusal(deep) == f"f:1:{MOST_DEPTH + 2}: [0][0]: nested deeper than the {MOST_DEPTH} levels allowed"
    )
    assert Source(("[" * MOST_DEPTH + "]" * MOST_DEPTH).encode()).findings == ()
    many = "[" + "1," * MOST_NODES + "]"
    assert refusal(many).endswith(f"the file holds more than the {MOST_NODES} values allowed")


@given(st.text(alphabet="\t\n :-[]{}&*!|>'\"%@`#,?.~<=\\0a1é\x85", max_size=30))
def test_any_text_is_read_or_refused_with_a_place(text: str) -> None:
    assert all(finding.line is not None for finding in findings_of(text.encode()))
