"""The JSON Schema of scenario files: packaged as generated, and of one mind with the loader."""

import json
import re
from random import Random
from typing import Any

import jsonschema
import mutators
import pytest

from pushplan.bench.schema import suite_schema
from pushplan.bench.suite import suite_names, suite_text
from pushplan.cli.main import main
from pushplan.scenario.file import example_names, example_text, load_scenario
from pushplan.scenario.json_schema import scenario_schema, schema_file, schema_text
from pushplan.scenario.schema import ScenarioFile
from pushplan.scenario.source import Source
from pushplan.scenario.validation import validate

VARIED = ("two-crates", "feet", "carts", "hook")
BEYOND_A_SCHEMA = re.compile(
    r"^(the edges after corners|corners \[\d+\] and \[\d+\] are the same point|an edge runs back|has an area of"
    r"|is \[.*\]; allowed: \[min, max\] with min < max"
    r"|is '[^']*'; allowed: .* with a unit|is '[^']*'; allowed: .*a friction angle|'.*' is no friction angle"
    r"|is the text '.*', which is not finite|is '.*', which is not finite)"
)
"""What the loader refuses and a schema cannot."""


@pytest.fixture(scope="module")
def checker() -> jsonschema.protocols.Validator:
    """What editors do with the schema."""
    jsonschema.Draft202012Validator.check_schema(scenario_schema())
    return jsonschema.Draft202012Validator(scenario_schema())


def _document(text: str) -> Any:
    return Source(text.encode()).root.plain()


SCHEMAS = {"scenario": scenario_schema, "suite": suite_schema}


@pytest.mark.parametrize("name", SCHEMAS)
def test_the_packaged_schemas_are_those_of_the_models(name: str, capsys: pytest.CaptureFixture[str]) -> None:
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
    mistakes: list[dict[str, Any]] = [
        {"planers": ["auto"]},
        {"planners": ["autobahn"]},
        {"seeds": 0},
        {"problems": []},
    ]
    for wrong in mistakes:
        assert not checker.is_valid(suite | wrong)


@pytest.mark.parametrize("name", example_names())
def test_packaged_and_resolved_scenarios_are_valid(
    name: str, checker: jsonschema.protocols.Validator
) -> None:
    checker.validate(_document(example_text(name)))
    checker.validate(load_scenario(name).resolved())


def test_schema_and_loader_agree_on_mutated_files(checker: jsonschema.protocols.Validator) -> None:
    random = Random(7)
    documents = [load_scenario(name).resolved() for name in VARIED]
    documents += [_document(example_text(name)) for name in VARIED]
    accepted = refused = 0
    for _ in range(200):
        document = Source(json.dumps(mutators.mutated_document(random.choice(documents), random)).encode())
        validate(ScenarioFile, document)
        faults = document.findings
        errors = list(checker.iter_errors(document.root.plain()))
        sayable = [f for f in faults if not BEYOND_A_SCHEMA.match(f.what)]
        assert bool(errors) == bool(sayable), (errors[:1], sayable)
        accepted, refused = accepted + (not faults), refused + bool(errors)
    assert accepted > 8
    assert refused > 120
