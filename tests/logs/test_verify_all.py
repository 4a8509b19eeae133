"""For each field of each topic, and for each word, an alteration that is found: by reading or by verifying.

The fields are those of the schemas and the words those in a log, so a new one is covered as soon as it is there.
"""

from __future__ import annotations

import importlib.util
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from google.protobuf.descriptor import Descriptor, FieldDescriptor
from pushplan.logging.old.messages import metadata, schemas
from pushplan.logging.old.messages.schemas import TOPICS, Topic
from pushplan.logging.old.reader import read_run
from pushplan.logging.old.verify import verify
from pushplan.logging.old.verify_file import compare_topic, write_again
from pushplan.logging.old.writer import RunLogWriter
from several.conftest import problem_document

import pushplan
from pushplan.errors import PushplanError, RunLogError
from pushplan.scenario.file import scenario_from_document

HERE = Path(__file__).parent

FREE_WORDS = {
    "pushplan.run": {
        "time_limit": "asked for on the command line",
        "gap": "likewise",
        "git": "of the machine",
        "machine": "likewise",
        "started_at": "of the wall clock",
        **{f"version.{name}": "of the machine" for name in ("pushplan", "python", *metadata._DEPENDENCIES)},
    },
    "pushplan.planning": {},
    "pushplan.result": {
        "finished_at": "of the wall clock",
        "search_s": "likewise",
    },
}


def _load(name: str) -> Any:
    spec = importlib.util.spec_from_file_location(name, HERE / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


hostile, sincere = _load("hostile_files"), _load("test_verify").sincere

FieldPath = tuple[FieldDescriptor, ...]


def leaves(descriptor: Descriptor) -> Iterator[FieldPath]:
    """Yield the way to each field of a message that holds no message itself."""
    for field in descriptor.fields:
        if field.message_type is None:
            yield (field,)
        else:
            yield from ((field, *rest) for rest in leaves(field.message_type))


def fields() -> Iterator[tuple[Topic, FieldPath]]:
    """Yield all fields of each topic; of a type that had its turn on another topic only the last one."""
    seen: set[str] = set()
    for topic in TOPICS:
        paths = list(leaves(topic.message.DESCRIPTOR))
        yield from ((topic, path) for path in (paths[-1:] if topic.kind in seen else paths))
        seen.add(topic.kind)


CLOSED_LOOP = (schemas.MEASURED, schemas.EVENTS, schemas.REPLANS, schemas.PUSHER_WRENCH)
"""Of logs whose objects moved in a world that no log holds: tests/control/test_run.py alters them."""

FIELDS = [(topic, path) for topic, path in fields() if topic not in CLOSED_LOOP]
NAMES = [f"{topic.name}-{'.'.join(field.name for field in path)}" for topic, path in FIELDS]


def changed(field: FieldDescriptor, value: Any) -> Any:
    if field.cpp_type == field.CPPTYPE_STRING:
        return value + "x" if isinstance(value, str) else value[:-1] + bytes([(value or b"\0")[-1] ^ 1])
    if field.cpp_type == field.CPPTYPE_BOOL:
        return not value
    if field.cpp_type == field.CPPTYPE_ENUM:
        return next(number for number in _numbers(field) if number != value)
    whole = field.cpp_type not in (field.CPPTYPE_DOUBLE, field.CPPTYPE_FLOAT)
    return value + 1 if whole else value + 0.5


def alter(message: Any, path: FieldPath) -> None:
    """Change the first value of a field."""
    field, *rest = path
    value = getattr(message, field.name)
    repeated = hasattr(value, "extend")
    if rest:
        member = (value[0] if len(value) else value.add()) if repeated else value
        alter(member, tuple(rest))
    elif repeated:
        value[:1] = [changed(field, value[0] if len(value) else field.default_value or _nothing(field))]
    else:
        setattr(message, field.name, changed(field, value))


def _nothing(field: FieldDescriptor) -> Any:
    return "" if field.cpp_type == field.CPPTYPE_STRING else 0


@pytest.fixture(scope="module")
def sound(case: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a log of a run that is what it says."""
    path = tmp_path_factory.mktemp("sound") / "run.mcap"
    honest = sincere(case)
    settings = {"planner": "rrt", "set": "ecof", "seed": 5, "time_limit": 2.0, "gap": 0.0}
    settings["cost"] = honest.scenario.planner.cost
    with RunLogWriter.create(path, honest.scenario, settings) as log:
        log.plan(honest.plan)
        log.execution(honest.execution)
        log.finish("solved", {"search": 0.1})
    return path


@pytest.fixture(scope="module")
def again(sound: Path) -> Path:
    """Return the log that the scenario and the plan of the sound one lead to."""
    path = sound.with_name("again.mcap")
    write_again(read_run(sound), path)
    return path


@pytest.fixture(scope="module")
def several(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a log of several pushes, and beside it the one that its scenario and its plan lead to."""
    path = tmp_path_factory.mktemp("several") / "run.mcap"
    scenario = scenario_from_document(problem_document("omnidirectional"))
    pushplan.run(scenario, log=path, first=True)
    write_again(read_run(path), path.with_name("again.mcap"))
    return path


def mutated(log: bytes, topic: Topic, path: FieldPath) -> bytes:
    def first(messages: list[tuple[int, bytes]]) -> list[tuple[int, bytes]]:
        opcode, body = messages[0]
        message = topic.message.FromString(body[22:])
        alter(message, path)
        return [(opcode, body[:22] + message.SerializeToString()), *messages[1:]]

    return bytes(hostile.edit_messages(log, topic.name, first))


def test_the_sound_log_is_verified(sound: Path) -> None:
    assert [check.text for check in verify(read_run(sound)).mismatches] == []


@pytest.mark.parametrize(("topic", "path"), FIELDS, ids=NAMES)
def test_an_altered_field_is_found(
    topic: Topic, path: FieldPath, sound: Path, again: Path, several: Path
) -> None:
    if topic in (schemas.SEGMENT, schemas.ROBOT):  # no other log has them
        sound, again = several, several.with_name("again.mcap")
    altered = sound.with_name("altered.mcap")
    altered.write_bytes(mutated(sound.read_bytes(), topic, path))
    found = True
    try:
        run = read_run(altered)
        if topic in (schemas.PLAN, schemas.PROGRESS):  # what is expected follows from them
            found = not verify(run).matches
        else:
            found = not all(check.matches for check in compare_topic(topic, altered, again, True))
    except PushplanError:
        pass  # refused at once
    assert found


def test_every_word_that_is_altered_is_found_but_for_those_that_are_free(sound: Path) -> None:
    said = read_run(sound).words
    passed = {(name, key) for name in said for key in said[name] if not _is_found(sound, name, key)}
    assert passed == {(name, key) for name, keys in FREE_WORDS.items() for key in keys}


def _is_found(sound: Path, name: str, key: str) -> bool:
    """Tell whether another word in place of one is noticed."""
    words = dict(read_run(sound).words[name])
    words[key] = str(float(words[key]) + 1.0) if _is_number(words[key]) else words[key] + "x"
    marker = struct.pack("<I", len(name)) + name.encode()
    edited = [
        (opcode, hostile.metadata(name, hostile.sealed(words)))
        if opcode == hostile.METADATA and body.startswith(marker)
        else (opcode, body)
        for opcode, body in hostile.loose(sound.read_bytes())
    ]
    altered = sound.with_name("altered.mcap")
    altered.write_bytes(hostile.rebuild(edited))
    try:
        return not verify(read_run(altered)).matches
    except RunLogError:
        return True


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _numbers(field: FieldDescriptor) -> list[int]:
    assert field.enum_type is not None
    return list(field.enum_type.values_by_number)
