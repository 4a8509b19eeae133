"""Damaged and hostile files end in one typed error with its place, quickly and in little memory.

With PUSHPLAN_MUTATIONS=20000 the random mutations go on for some ten minutes.
"""

from __future__ import annotations

import importlib.util
import json
import os
import random
import subprocess
import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pushplan.logging.old.messages.recorded import RecordedRun
from pushplan.logging.old.reader import read_run

from pushplan.errors import RunLogError

HERE = Path(__file__).parent
MOST_SECONDS, MOST_MB = 5.0, 100.0
"""Seconds of the processor: more than a file takes, as those of a machine that is busy otherwise count for less."""
MUTATIONS = int(os.environ.get("PUSHPLAN_MUTATIONS", "60"))


def _load(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, HERE / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


hostile = _load("hostile_files")
Verdicts = dict[tuple[str, bool], dict[str, Any]]


def attempt(path: Path, recover: bool = False) -> RecordedRun | RunLogError:
    """Read a log; return the error if it is the one that damage should lead to."""
    try:
        return read_run(path, recover=recover)
    except RunLogError as error:
        return error


@pytest.fixture(scope="module")
def verdicts(whole_log: bytes, tmp_path_factory: pytest.TempPathFactory) -> Verdicts:
    """Return what one process made of every file, by the file's name and whether it was to be recovered."""
    folder = tmp_path_factory.mktemp("hostile")
    for name, maker in {**hostile.KINDS, **hostile.HARMLESS}.items():
        (folder / name).write_bytes(maker(whole_log))
    places = sorted({*hostile.boundaries(whole_log)})
    for at in {*places, *((a + b) // 2 for a, b in pairwise(places))}:
        (folder / f"cut_{at:06d}").write_bytes(whole_log[:at])
    command = [sys.executable, str(HERE / "read_many.py"), str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True, cwd=folder)
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert not (folder / "owned").exists()
    return {(verdict["name"], verdict["recover"]): verdict for verdict in found}


@pytest.mark.parametrize("name", hostile.KINDS)
def test_a_damaged_file_is_refused_with_its_place(verdicts: Verdicts, name: str) -> None:
    verdict = verdicts[name, False]
    assert verdict["kind"] == "RunLogError", verdict
    assert isinstance(verdict["offset"], int), verdict
    assert f"{name} at byte {verdict['offset']}: " in verdict["text"]


@pytest.mark.parametrize("name", hostile.HARMLESS)
def test_a_harmless_change_is_read(verdicts: Verdicts, name: str) -> None:
    assert verdicts[name, False]["kind"] == "read", verdicts[name, False]
    assert verdicts[name, False]["losses"] == []


def test_a_cut_is_refused_with_its_place_wherever_it_falls(verdicts: Verdicts) -> None:
    cuts = [
        verdict for (name, recover), verdict in verdicts.items() if name.startswith("cut_") and not recover
    ]
    assert len(cuts) > 60
    for verdict in cuts:
        assert verdict["kind"] == "RunLogError", verdict
        assert verdict["offset"] <= int(verdict["name"].removeprefix("cut_")), verdict


def test_recovering_never_ends_in_another_error(verdicts: Verdicts) -> None:
    kinds = {verdict["kind"] for (_, recover), verdict in verdicts.items() if recover}
    assert kinds == {"read", "RunLogError"}


def test_what_was_recovered_says_what_is_lost(verdicts: Verdicts) -> None:
    silent = [
        name
        for (name, recover), verdict in verdicts.items()
        if recover and verdict["kind"] == "read" and not verdict["losses"] and name not in hostile.HARMLESS
    ]
    assert silent == []


def test_every_file_takes_little_time_and_memory(verdicts: Verdicts) -> None:
    greedy = [v for v in verdicts.values() if v["seconds"] > MOST_SECONDS or v["peak_mb"] > MOST_MB]
    assert greedy == []


def test_a_flipped_bit_is_found_or_does_no_harm(
    whole_log: bytes, tmp_path: Path, assert_same: Callable[[Any, Any], None]
) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(whole_log)
    sound = read_run(path)
    rng, found = random.Random(5), 0
    for _ in range(150):
        at, bit = rng.randrange(len(whole_log)), 1 << rng.randrange(8)
        path.write_bytes(whole_log[:at] + bytes([whole_log[at] ^ bit]) + whole_log[at + 1 :])
        run = attempt(path)
        if isinstance(run, RunLogError):
            assert run.offset is not None
            found += 1
            continue
        assert_same(run.plan, sound.plan)
        assert_same(run.execution, sound.execution)
        assert_same(run.words, sound.words)
        assert run.scenario == sound.scenario
    assert found > 50


@settings(max_examples=MUTATIONS)
@given(rng=st.randoms(use_true_random=True))
def test_no_mutation_ends_in_another_error(
    whole_log: bytes, tmp_path_factory: pytest.TempPathFactory, rng: random.Random
) -> None:
    """The same with time and memory of a thousand is in benchmarks/attacks.py."""
    path = tmp_path_factory.getbasetemp() / "mutated.mcap"
    path.write_bytes(hostile.mutated(whole_log, rng))
    for recover in (False, True):
        run = attempt(path, recover)
        assert not isinstance(run, RunLogError) or run.offset is not None


@pytest.mark.parametrize("what", ["missing", "folder", "pipe", "link to itself", "device"])
def test_what_is_no_file_is_refused(tmp_path: Path, what: str) -> None:
    path = tmp_path / "run.mcap"
    match what:
        case "folder":
            path.mkdir()
        case "pipe":
            os.mkfifo(path)
        case "link to itself":
            path.symlink_to(path)
        case "device":
            path.symlink_to("/dev/zero")
    with pytest.raises(RunLogError) as caught:
        read_run(path)
    assert str(caught.value).startswith(f"{path}: ")


def test_the_message_names_what_is_too_new(whole_log: bytes, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(hostile.newer_format(whole_log))
    expected = "a run log of format 999; this version of pushplan reads formats up to 1"
    with pytest.raises(RunLogError, match=expected):
        read_run(path)
    with pytest.raises(RunLogError, match=expected):
        read_run(path, recover=True)


def test_names_in_a_log_never_become_paths(whole_log: bytes, tmp_path: Path) -> None:
    inner = tmp_path / "a" / "b"
    inner.mkdir(parents=True)
    (inner / "run.mcap").write_bytes(hostile.with_things_of_others(whole_log))
    read_run(inner / "run.mcap")
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["a", "b", "run.mcap"]
