"""A damaged log is read up to the damage, and a clean log can be written from the rest."""

from __future__ import annotations

import importlib.util
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pushplan.logging.old.reader import read_run
from pushplan.logging.old.recover import recover

from pushplan.cli.main import main
from pushplan.errors import OutputError, RunLogError


def _hostile() -> Any:
    path = Path(__file__).with_name("hostile_files.py")
    spec = importlib.util.spec_from_file_location("hostile_files", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


hostile = _hostile()


def chunks(log: bytes) -> list[tuple[int, int]]:
    """Return where each chunk begins and ends."""
    places = list(hostile.boundaries(log))
    kinds = [opcode for opcode, _ in hostile.split(log)]
    return [(a, b) for a, b, kind in zip(places, places[1:], kinds, strict=False) if kind == hostile.CHUNK]


def overwritten(log: bytes, begin: int, end: int) -> bytes:
    return (
        log[:begin] + bytes(range(256)) * ((end - begin) // 256) + b"\xff" * ((end - begin) % 256) + log[end:]
    )


def content_of(begin: int, end: int) -> tuple[int, int]:
    return begin + 60, end


def frame_and_content(begin: int, end: int) -> tuple[int, int]:
    """The length of the chunk and of the index behind it are gone: nobody can tell where the next record begins."""
    return begin, end + 9


@pytest.mark.parametrize("damage", [content_of, frame_and_content])
def test_everything_before_the_damage_is_kept(
    case: Any, whole_log: bytes, tmp_path: Path, damage: Callable[[int, int], tuple[int, int]]
) -> None:
    """Each chunk of samples holds a second of them; the first chunks hold the start and the plan."""
    seconds = len(np.unique(np.floor(case.execution.t)))
    places = chunks(whole_log)[2 : 2 + seconds]
    for k, place in enumerate(places):
        path = tmp_path / "run.mcap"
        path.write_bytes(overwritten(whole_log, *damage(*place)))
        with pytest.raises(RunLogError):
            read_run(path)
        run = read_run(path, recover=True)
        assert run.plan is not None
        kept = case.execution.t < k
        assert (run.execution is None) == (k == 0)
        for name in ("t", "poses", "margins", "forces") if run.execution is not None else ():
            np.testing.assert_array_equal(getattr(run.execution, name), getattr(case.execution, name)[kept])
        assert any(loss.startswith("everything from byte ") for loss in run.losses)


def damaged(whole_log: bytes, path: Path) -> Path:
    path.write_bytes(overwritten(whole_log, *frame_and_content(*chunks(whole_log)[3])))
    return path


def test_a_clean_log_is_written_and_says_what_was_lost(
    case: Any, whole_log: bytes, tmp_path: Path, assert_same: Callable[[Any, Any], None]
) -> None:
    source, target = damaged(whole_log, tmp_path / "run.mcap.partial"), tmp_path / "run.mcap"
    before = source.read_bytes()
    (found,) = recover(source, target)
    run = read_run(target)
    assert source.read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.mcap", "run.mcap.partial"]
    assert run.losses == ()
    assert run.plan is not None
    assert_same(replace(run.plan, execution=None), case.plan)
    assert_same(run.execution, found.execution)
    assert run.scenario == case.scenario
    assert run.words["pushplan.run"] == found.words["pushplan.run"]
    assert run.outcome == "cut off"
    assert [line.text for line in run.lines][: len(found.lines)] == [line.text for line in found.lines]
    earlier = run.words["pushplan.recovery"]
    assert earlier["from"] == "run.mcap.partial"
    assert [earlier[key] for key in sorted(earlier) if key.startswith("lost_")] == list(found.losses)


def test_a_log_cut_anywhere_gives_a_clean_one_or_an_error(whole_log: bytes, tmp_path: Path) -> None:
    source, written = tmp_path / "cut.mcap", 0
    for k, end in enumerate(list(hostile.boundaries(whole_log))[::4]):
        source.write_bytes(whole_log[: end - 3])
        target = tmp_path / f"{k}.mcap"
        try:
            recover(source, target)
        except RunLogError:
            assert not target.exists()
            continue
        assert read_run(target).losses == ()
        written += 1
    assert written > 5


def test_no_file_is_overwritten(whole_log: bytes, tmp_path: Path) -> None:
    source, target = damaged(whole_log, tmp_path / "a.mcap"), tmp_path / "b.mcap"
    target.write_text("precious")
    with pytest.raises(OutputError, match="this file exists already"):
        recover(source, target)
    assert target.read_text() == "precious"
    assert main(["replay", "--recover", str(source), str(source)]) == 2
    assert main(["replay", "--recover", str(source)]) == 2
    assert main(["replay", str(source), str(tmp_path / "c.mcap")]) == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mcap", "b.mcap"]


def test_the_command_recovers(whole_log: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source, target = damaged(whole_log, tmp_path / "a.mcap"), tmp_path / "b.mcap"
    assert main(["replay", "--recover", str(source), str(target), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["recovered"] == str(target)
    assert told["lost"]
    assert main(["replay", str(target)]) == 0
    assert "lost before" in capsys.readouterr().out
