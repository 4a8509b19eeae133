"""The command line: output, exit codes, completion, the first own scenario, escaping for terminals."""

import io
import json
import os
import re
import shutil
import subprocess
import sys
import time
import unicodedata
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
import shapely
from conftest import Captured, Patch, there

import pushplan
from pushplan.cli import console as console_module
from pushplan.cli.console import Console, Progress
from pushplan.cli.main import main
from pushplan.errors import PlanningError
from pushplan.logging.runs import RunsError, run_numbered
from pushplan.scenario.file import example_names, load_scenario
from pushplan.scenario.template import DRIVES
from pushplan.sets.named import stable_set
from pushplan.util.printable import printable


@pytest.mark.parametrize("name", example_names())
def test_every_example_passes_its_check(name: str, capsys: Captured) -> None:
    assert main(["check", name, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert len(found["objects"]) == len(found["contacts"])
    assert found["warnings"] == []
    for place in ("start", "goal"):
        assert found[place]["room"] is None or found[place]["room"] > 0.0


def test_stable_set_prints_cones_radii_and_regions(tmp_path: Path, capsys: Captured) -> None:
    assert main(["stable-set", "two-crates", "--json", "--plot", str(tmp_path / "s.svg")]) == 0
    found = json.loads(capsys.readouterr().out)
    stable = stable_set(load_scenario("two-crates").chain, "ecof")
    each = found["sets"]["ecof"]
    cone = there(stable.translation_cone())
    assert np.allclose(each["translation_cone"], cone)
    assert each["min_turning_radius"]["left"] == pytest.approx(stable.turning_radii().left)
    assert each["seconds"] > 0.0
    for sense, region in ((1, each["cor_regions"]["ccw"]), (-1, each["cor_regions"]["cw"])):
        shape = shapely.from_geojson(json.dumps(region))
        assert shapely.box(*found["window"]).buffer(1e-9).contains(shape)
        point = np.asarray(shape.representative_point().coords)[0]
        assert stable.contains(sense * np.array([[point[1], -point[0], 1.0]]))[0]
    assert ">left turns<" in (tmp_path / "s.svg").read_text()


@pytest.mark.parametrize(("words", "message"), [
    ([], "Usage: pushplan COMMAND"), (["plan"], "Missing argument 'SCENARIO'"),
    (["plan", "two-crates", "--set", "none"], "'none' is unknown"),
    (["plan", "two-crates", "--time-limit", "nan"], "'nan' is not a time limit"),
    (["plan", "two-crates", "--time-limit", "0"], "'0' is out of range; allowed: a number above 0"),
    (["plan", "two-crates", "--time-limit", "soon"], "also with a unit (s, ms, min, h)"),
    (["plan", "two-crates", "--seed", "-1"], "'-1' is out of range; allowed: a whole number from 0"),
    *((["new", "--", name], "allowed: a name of up to 64") for name in (" ", "_x", "a\tb", "-", "x" * 65)),
    (["bench", "smoke", "-o", ""], "an argument is empty"),
    (["identify", "none.mcap", "--into", "none", "-o", "l.yaml"], "none: cannot read the file: No such file"),
    (["replay", "@first"], "@first is neither a file nor a recorded run; allowed: @1"),
    (["simulate", "two-crates", "--disturb", "time=3"], "'time=3' does not state the object"),
    (["simulate", "two-crates", "--disturb", "time=3,object=far,y=10"], "y is 10 m; allowed: up to 1 m, and mm need"),
    (["simulate", "two-crates", "--disturb", "object=far,time=soon"], "time is 'soon'; allowed: a number"),
    (["simulate", "two-crates", "--sensor", "noise=1"], "'noise=1' is not NAME=VALUE; allowed names: rate"),
    (["simulate", "two-crates", "--sensor", "rate=0"], "rate of the sensor is 0.0; it must be finite and > 0"),
    (["trial", "two-crates", "--samples", "2.5"], "'2.5' is not a whole number; allowed: a whole number from 1"),
    (["trial", "two-crates", "--uncertainty", "load=20"], "below 1; it is a share: 20 % is 0.2"),
    (["plan", "two-crates", "--see", "1"], "'--seed'"),
    (["pln", "two-crates"], "Did you mean 'plan'?"),
    (["plan", "two-crates", "--planner", "autoo"], "did you mean 'auto'?"),
    (["plan", "two-crates", "more"], "unexpected extra argument (more)"),
    (["plan", "two-crates", "--plot", "p.bmp"], "the suffix .bmp is not a picture format; allowed: .png, .svg, .pdf"),
    (["plan", "two-crates", "-o", "/no/such/folder/r.mcap"], "there is no folder /no/such/folder"),
    (["plan", "two-crates", "--html", "x", "-o", "./x"], "the command also reads or writes this file"),
    (["simulate", "one-box", "--no-log", "-o", "x"], "--no-log cannot be combined with -o or --runs"),
    (["plan", "no-such.yaml"], "no-such.yaml: cannot read the file: No such file"),
    (["replay", "no-such.mcap"], "no-such.mcap"),
    (["plan", "two-crates", "--panels", "set"], "--panels has no effect without --plot"),
    (["replay", "no-such.mcap", "--rate", "2"], "--rate has no effect without --mp4"),
])  # fmt: skip
def test_wrong_arguments_give_a_message_and_exit_code_2(words: list[str], message: str, capsys: Captured) -> None:
    assert main(words) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert message in err
    assert "Traceback" not in err


def examples_into(out: Any) -> tuple[int, bytes]:
    """Return exit code and errors of the command that writes the list of examples into a file or pipe."""
    words = [sys.executable, "-m", "pushplan", "examples"]
    done = subprocess.run(words, stdout=out, stderr=subprocess.PIPE, timeout=60, check=False)
    return done.returncode, done.stderr


def test_a_closed_pipe_is_no_error_and_a_full_disk_has_its_message() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    assert examples_into(writer) == (141, b"")
    os.close(writer)
    with open("/dev/full", "wb") as full:
        assert examples_into(full) == (1, b"error: No space left on device\n")


def test_wrong_arguments_are_json_in_json_mode(capsys: Captured) -> None:
    assert main(["plan", "two-crates", "--seed", "x", "--json"]) == 2
    error = json.loads(capsys.readouterr().out)["error"]
    assert error["kind"] == "UsageError"
    assert "'x' is not a seed" in error["message"]


def test_code_named_in_a_file_is_announced_before_its_import_or_refused(
    tmp_path: Path, monkeypatch: Patch, capsys: Captured
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "suite.yaml").write_text(
        "format: pushplan-suite/1\nproblems: [one-box]\nplanners: ['no_such_module:Planner']\n"
    )
    planned = ["plan", "one-box", "--planner", "no_such_module:Planner", "--no-log"]
    for words in (planned, ["bench", "suite.yaml", "-o", "results"]):
        assert main([*words, "--no-code"]) == 2
        told = "no_such_module:Planner is code, and --no-code refuses to import the module no_such_module"
        assert f"{words[1]}: {told}" in capsys.readouterr().err
        assert not (tmp_path / "results").exists()
    assert main(planned) == 2
    error = capsys.readouterr().err
    assert error.index("one-box: imports the module no_such_module") < error.index("cannot load")


@pytest.mark.parametrize(("typed", "offered"), [
    ("pl", {"plain,plan"}), ("plan two", {"plain,two-crates", "file,two"}),
    ("plan two-crates --pl", {"plain,--planner", "plain,--plot"}),
    ("examples narr", {"plain,narrow-gap", "file,narr"}), ("completion f", {"plain,fish"}),
])  # fmt: skip
def test_arguments_are_completed(typed: str, offered: set[str], monkeypatch: Patch, capsys: Captured) -> None:
    words = f"pushplan {typed}"
    monkeypatch.setenv("_PUSHPLAN_COMPLETE", "bash_complete")
    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(len(words.split()) - 1))
    with pytest.raises(SystemExit):
        main([])
    assert set(capsys.readouterr().out.split()) == offered


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: Patch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_new_scenario_loads_passes_its_check_and_plans(capsys: Captured) -> None:
    assert main(["new", "mine"]) == 0
    assert "wrote mine.yaml" in capsys.readouterr().out
    assert load_scenario("mine.yaml").name == "mine"
    assert main(["check", "mine.yaml"]) == 0
    assert main(["plan", "mine.yaml", "--first", "--time-limit", "60"]) == 0
    assert main(["new", "my push"]) == 0
    assert "pushplan check 'my push.yaml' --plot 'my push.png'" in capsys.readouterr().out


@pytest.mark.parametrize("drive", DRIVES)
def test_every_template_passes_its_check_and_plans(drive: str, capsys: Captured) -> None:
    assert main(["new", "mine", "--drive", drive]) == 0
    assert main(["check", "mine.yaml"]) == 0
    assert capsys.readouterr().out.endswith("no errors\n")
    scenario = load_scenario("mine.yaml")
    for seed in range(1, 3):
        plan = pushplan.plan(scenario, seed=seed, time_limit=60.0, first=True)
        assert plan.solved, plan.reason


@pytest.mark.parametrize("drive", ["differential", "car"])
def test_turns_too_wide_for_the_room_are_reported_before_planning(drive: str, capsys: Captured) -> None:
    assert main(["new", "mine", "--drive", drive]) == 0
    text = Path("mine.yaml").read_text()
    Path("mine.yaml").write_text(re.sub(r"(?m)^  pose: .*$", "  pose: [3.0, 1.8, 90 deg]", text))
    assert main(["check", "mine.yaml"]) == 0
    out, err = capsys.readouterr()
    assert re.search(
        r"warning: perhaps the turns .* makes a circle of 5\.\d+ m, wider than the workspace \(4.2 m\)", err
    )
    assert out.endswith("no errors, but 1 warning\n")


def test_a_file_is_never_overwritten(capsys: Captured) -> None:
    Path("mine.yaml").write_text("precious")
    for name in ("mine", "mine.yaml"):
        assert main(["new", name]) == 2
        assert capsys.readouterr().err == (
            "error: mine.yaml: this file exists already; choose another name or remove it\n"
        )
    assert Path("mine.yaml").read_text() == "precious"


OUTPUTS = {"layout": "s.yaml", "csv": "mine.csv", "trajectory": "mine.json", "html": "mine.html", "plot": "mine.png"}


def test_files_of_the_user_are_replaced_only_on_request(capsys: Captured) -> None:
    assert main(["plan", "one-box", "--first", "-o", "run.mcap", "--no-page"]) == 0
    for name in OUTPUTS.values():
        Path(name).write_text("format: pushplan/1")
    for option, name in OUTPUTS.items():
        words = ["replay", "run.mcap", f"--{option}", name]
        assert main(words) == 2
        assert f"{name}: this file exists and is not a result of pushplan" in capsys.readouterr().err
        assert Path(name).read_text() == "format: pushplan/1"
        assert main([*words, "--overwrite"]) == 0
        assert main(words) == 0  # now it is a benchmark folder
    assert main(["view", "one-box", "--overwrite"]) == 2  # it writes no file


def test_a_folder_with_other_files_is_refused_as_output_of_a_benchmark(capsys: Captured) -> None:
    suite = "format: pushplan-suite/1\nproblems: [one-box]\nplanners: [{name: auto, first: true}]\nseeds: 1\n"
    Path("suite.yaml").write_text(suite)
    Path("out").mkdir()
    Path("out/report.html").write_text("precious")
    assert main(["bench", "suite.yaml", "-o", "out"]) == 2
    assert (
        "out contains 'report.html' and is not a folder of results; name another one, or use it with --overwrite"
        in (capsys.readouterr().err)
    )
    assert [path.name for path in Path("out").iterdir()] == ["report.html"]
    assert Path("out/report.html").read_text() == "precious"


MAP = Path(__file__).parents[1] / "examples" / "office"


@pytest.mark.parametrize("drive", ["omnidirectional", "car"])
def test_a_scenario_in_a_map_for_any_drive_loads_and_plans(drive: str, capsys: Captured) -> None:
    shutil.copytree(MAP, "maps")
    assert main(["new", "mine", "--map", "maps/office.yaml", "--drive", drive]) == 0
    scenario = load_scenario("mine.yaml")
    assert scenario.chain.pusher.drive.kind == drive
    assert any(getattr(obstacle, "unknown", False) for obstacle in scenario.obstacles)
    assert main(["check", "mine.yaml"]) == 0
    assert main(["plan", "mine.yaml", "--first"]) == 0


EVIL = "\x1b]0;owned\x07\x1b[31m\u202e\x9b2J"
SHOWN = r"\x1b]0;owned\x07\x1b[31m\u202e\x9b2J"


class Terminal(io.StringIO):
    """A stream that claims to be a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("live", [False, True])
def test_slow_work_shows_its_progress_in_one_line(live: bool, monkeypatch: Patch) -> None:
    monkeypatch.setattr(console_module, "DELAY", 0.02)
    monkeypatch.setenv("TERM", "xterm")
    stream = Terminal() if live else io.StringIO()
    monkeypatch.setattr("sys.stderr", stream)
    with Progress(f"reading {EVIL}") as progress:
        progress.update("best 1.5 m")
        _wait_for(lambda: "best 1.5 m" in stream.getvalue())
        progress.announce(f"compiling {EVIL}")
    assert f"reading {SHOWN} ..." in stream.getvalue()
    assert f"compiling {SHOWN}\n" in stream.getvalue()
    assert "\x07" not in stream.getvalue()


def test_a_table_is_as_wide_as_the_terminal_and_its_columns_are_straight(monkeypatch: Patch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "48")
    stream = Terminal()
    monkeypatch.setattr("sys.stdout", stream)
    words = "tolerates an object's floor friction off by 71 %, its load by at least 100 %"
    Console().table([("robustness", words), ("箱子", "two wide letters"), ("", "")])
    lines = click.unstyle(stream.getvalue()).splitlines()
    assert lines[0].startswith("  robustness  tolerates")
    assert lines[-2:] == ["  箱子        two wide letters", ""]
    assert " ".join(" ".join(lines[:-2]).split()) == f"robustness {words}"
    assert len(lines) > 4
    assert max(map(len, lines)) <= 48


def _wait_for(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < end, "nothing happened within a minute"
        time.sleep(0.01)


@pytest.mark.parametrize("verbose", [False, True])
@pytest.mark.parametrize(("error", "code", "message"), [
    (KeyboardInterrupt(), 130, "interrupted"),
    (PlanningError("the goal overlaps a wall"), 2, "error: the goal overlaps a wall"),
    (FileNotFoundError(2, "No such file or directory", "x.mcap"), 2, "error: x.mcap: No such file"),
    (PermissionError(13, "Permission denied", "/x.png"), 2, "error: /x.png: Permission denied"),
    (OSError(28, "No space left on device"), 1, "error: No space left on device"),
    (MemoryError(), 1, "error: out of memory"),
    (BrokenPipeError(), 141, ""),
    (KeyError("k"), 1, "error: KeyError: 'k'\nThis is a bug in pushplan"),
])  # fmt: skip
def test_every_failure_has_its_exit_code_and_message_and_a_defect_its_traceback_where_asked_for(
    error: BaseException, code: int, message: str, verbose: bool, capsys: Captured, monkeypatch: Patch
) -> None:
    def fail(name: str) -> str:
        raise error

    monkeypatch.setattr("pushplan.scenario.file.example_text", fail)
    assert main(["examples", "one-box", *["--verbose"] * verbose]) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert message in err
    assert ("Traceback" in err) == (verbose and code == 1)


BIDIRECTIONAL = {"LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI"}


def test_terminal_control_characters_are_escaped_and_other_text_stays() -> None:
    for character in printable("".join(map(chr, range(1 << 16)))):
        assert unicodedata.category(character) not in ("Cc", "Cs", "Zl", "Zp")
        assert unicodedata.bidirectional(character) not in BIDIRECTIONAL
    text = "".join(map(chr, range(ord(" "), ord("~") + 1))) + "äß é ° × … 方"
    assert printable(text) == text
    assert printable("a\n\tb\r", keep="\n\t") == "a\n\tb\\r"


def test_runs_are_numbered_from_the_last_one(tmp_path: Path) -> None:
    names = [f"2026010{day}T000000.000Z-a-seed1.mcap" for day in (1, 2, 3)]
    for name in names:
        (tmp_path / name).touch()
    assert [run_numbered(tmp_path, number).name for number in (1, 2, 3)] == names[::-1]
    with pytest.raises(RunsError, match="there is no run @4; 3 are recorded"):
        run_numbered(tmp_path, 4)
