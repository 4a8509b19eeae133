"""`pushplan replay`: its exports, by the words that a user types."""

import json
from pathlib import Path

import pytest

from pushplan.cli.main import main
from pushplan.logging.writer import RunLogWriter
from pushplan.scenario.file import load_scenario


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("replay") / "run.mcap"
    assert main(["plan", "free-space", "--first", "-o", str(path)]) == 0
    return path


def test_what_a_log_says_is_shown_escaped_and_told_exactly(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    evil = "\x1b]0;owned\x07 \u202eno plan"
    path = tmp_path / "run.mcap"
    with RunLogWriter.create(path, load_scenario("free-space"), {}) as writer:
        writer.log("warning", evil)
        writer.finish(evil)
    assert main(["replay", str(path)]) == 0
    out = capsys.readouterr().out
    assert r"\x1b]0;owned\x07 \u202eno plan" in out
    assert not {"\x1b", "\x07", "\u202e"} & set(out)
    assert main(["replay", str(path), "--json"]) == 0
    told = capsys.readouterr()
    assert json.loads(told.out)["outcome"] == evil
    assert not {"\x1b", "\x07", "\u202e"} & set(told.err)


def test_exports_that_are_possible_are_written_whatever_the_others(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A run that was not executed has no table, but a page, a bag and a layout."""
    pytest.importorskip("rosbags")
    path = tmp_path / "run.mcap"
    with RunLogWriter.create(path, load_scenario("free-space"), {}) as writer:
        writer.finish("unsolved")
    names = ("csv", "html", "ros2", "layout")
    words = [word for name in names for word in (f"--{name}", str(tmp_path / f"out.{name}"))]
    assert main(["replay", str(path), *words]) == 2
    written = {found.suffix for found in tmp_path.glob("out.*")}
    assert written == {".html", ".ros2", ".layout", ".rviz"}
    told = capsys.readouterr().err
    assert "written: --html, --ros2, --layout; not written: --csv: " in told
    assert "nothing was executed, so there is no table to write" in told
