"""The streams of a command: results, remarks, JSON, colours, progress, failures."""

from __future__ import annotations

import io
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pushplan.cli import console as console_module
from pushplan.cli.console import Console, Progress
from pushplan.cli.main import _failed
from pushplan.cli.parameters import check_outputs
from pushplan.drawing import PlotError
from pushplan.errors import OutputError, PlanningError

Captured = pytest.CaptureFixture[str]


EVIL = "\x1b]0;owned\x07\x1b[31m\u202e\x9b2J"
SHOWN = r"\x1b]0;owned\x07\x1b[31m\u202e\x9b2J"


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


class Closed(io.StringIO):
    """A stream that nobody reads any more."""

    def write(self, text: str) -> int:
        raise BrokenPipeError


@pytest.mark.parametrize("value", [float("nan"), float("inf"), np.array([np.nan])])
def test_numbers_that_json_does_not_know_are_refused(value: object) -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        Console(json=True).emit({"value": value})


@pytest.mark.parametrize(
    ("environment", "coloured"),
    [({"TERM": "xterm"}, True), ({"TERM": "dumb"}, False), ({"TERM": "xterm", "NO_COLOR": "1"}, False)],
)
def test_colour_is_for_terminals_whose_user_wants_it(
    environment: dict[str, str], coloured: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    terminal = Terminal()
    monkeypatch.setattr("sys.stdout", terminal)
    Console().say(("name", "bold"), ": ", ("solved", "green"))
    plain, painted = "name: solved\n", "\x1b[1mname\x1b[0m: \x1b[32msolved\x1b[0m\n"
    assert terminal.getvalue() == (painted if coloured else plain)


@pytest.mark.parametrize("live", [False, True])
def test_slow_work_shows_a_line_with_the_latest_news(live: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(console_module, "DELAY", 0.02)
    monkeypatch.setenv("TERM", "xterm")
    stream = Terminal() if live else io.StringIO()
    monkeypatch.setattr("sys.stderr", stream)
    with Progress(f"reading {EVIL}") as progress:
        progress.tell("best 1.5 m")
        _wait_for(lambda: "best 1.5 m" in stream.getvalue())
        progress.announce(f"compiling {EVIL}")
    assert f"reading {SHOWN} ..." in stream.getvalue()
    assert f"compiling {SHOWN}\n" in stream.getvalue()
    assert "\x07" not in stream.getvalue()


def _wait_for(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < end, "nothing happened within a minute"
        time.sleep(0.01)


def test_work_goes_on_when_nobody_reads_its_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(console_module, "DELAY", 0.0)
    monkeypatch.setattr("sys.stderr", Closed())
    with Progress("thinking"):
        time.sleep(0.05)


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (KeyboardInterrupt(), 130, "interrupted"),
        (PlanningError("the goal overlaps a wall"), 2, "error: the goal overlaps a wall"),
        (FileNotFoundError(2, "No such file or directory", "x.mcap"), 2, "error: x.mcap: No such file"),
        (PermissionError(13, "Permission denied", "/x.png"), 2, "error: /x.png: Permission denied"),
        (OSError(28, "No space left on device"), 1, "error: No space left on device"),
        (MemoryError(), 1, "error: out of memory"),
    ],
)
def test_every_failure_has_its_exit_code_and_a_message_without_traceback(
    error: BaseException, code: int, message: str, capsys: Captured
) -> None:
    assert _failed(error, json=False, verbose=False) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(message)
    assert "report" not in err


def test_a_defect_asks_for_a_report_and_shows_its_traceback_only_when_asked(capsys: Captured) -> None:
    for verbose in (False, True):
        with pytest.raises(KeyError) as caught:
            raise KeyError("k")
        assert _failed(caught.value, json=False, verbose=verbose) == 1
        err = capsys.readouterr().err
        assert ("Traceback" in err) is verbose
        assert "error: KeyError: 'k'" in err
        assert "Please report it" in err


def test_a_closed_pipe_ends_quietly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stderr", Closed())
    assert _failed(BrokenPipeError(), json=False, verbose=False) == 141
    assert _failed(PlanningError("nobody reads this"), json=False, verbose=False) == 141


def test_outputs_are_checked_before_the_work(tmp_path: Path) -> None:
    source = tmp_path / "s.yaml"
    check_outputs([source], tmp_path / "p.png", tmp_path / "r.mcap", None)
    check_outputs(["two-crates"], None)
    with pytest.raises(PlotError, match="a picture ends in"):
        check_outputs([source], tmp_path / "p.gif")
    with pytest.raises(OutputError, match=r"nowhere/r.mcap: there is no folder .*nowhere"):
        check_outputs([source], None, tmp_path / "nowhere" / "r.mcap")
    with pytest.raises(OutputError, match="this is a folder"):
        check_outputs([source], None, tmp_path)
    with pytest.raises(OutputError, match="read or written already"):
        check_outputs([source], None, source)
    with pytest.raises(OutputError, match="read or written already"):
        check_outputs([source], None, tmp_path / "x", tmp_path / "." / "x")
    with pytest.raises(OutputError, match="read or written already"):
        check_outputs([tmp_path / "a", source], None, source)


def test_what_files_say_never_reaches_the_terminal_as_a_command(
    capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    console = Console()
    console.say((EVIL, "bold"), f": {EVIL}")
    console.note(EVIL)
    console.table([(EVIL, EVIL), ("two\nlines", "[bold]two\nlines")])
    out, err = capsys.readouterr()
    first, second, third = out.splitlines()
    assert first == f"{SHOWN}: {SHOWN}"
    assert second == f"  {SHOWN}  {SHOWN}"
    assert third.split() == [r"two\nlines", r"[bold]two\nlines"]
    assert err == f"{SHOWN}\n"
