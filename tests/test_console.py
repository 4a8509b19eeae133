"""The streams of a command: results, remarks, JSON, progress, failures, and what a terminal would obey."""

import io
import time
import unicodedata
from collections.abc import Callable

import pytest

from pushplan.cli import console as console_module
from pushplan.cli.console import Console, Progress
from pushplan.cli.main import main
from pushplan.errors import PlanningError
from pushplan.util.printable import printable

Captured = pytest.CaptureFixture[str]
EVIL = "\x1b]0;owned\x07\x1b[31m\u202e\x9b2J"
SHOWN = r"\x1b]0;owned\x07\x1b[31m\u202e\x9b2J"


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


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


@pytest.mark.parametrize("verbose", [False, True])
@pytest.mark.parametrize(("error", "code", "message"), [
    (KeyboardInterrupt(), 130, "interrupted"),
    (PlanningError("the goal overlaps a wall"), 2, "error: the goal overlaps a wall"),
    (FileNotFoundError(2, "No such file or directory", "x.mcap"), 2, "error: x.mcap: No such file"),
    (PermissionError(13, "Permission denied", "/x.png"), 2, "error: /x.png: Permission denied"),
    (OSError(28, "No space left on device"), 1, "error: No space left on device"),
    (MemoryError(), 1, "error: out of memory"),
    (BrokenPipeError(), 141, ""),
    (KeyError("k"), 1, "error: KeyError: 'k'\nThis is a defect of pushplan"),
])  # fmt: skip
def test_every_failure_has_its_exit_code_and_message_and_a_defect_its_traceback_where_asked_for(
    error: BaseException,
    code: int,
    message: str,
    verbose: bool,
    capsys: Captured,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(name: str) -> str:
        raise error

    monkeypatch.setattr("pushplan.scenario.file.example_text", fail)
    assert main(["examples", "one-box", *["--verbose"] * verbose]) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert message in err
    assert ("Traceback" in err) == (verbose and code == 1)


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


BIDIRECTIONAL = {"LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI"}


def test_what_a_terminal_would_obey_is_escaped_and_what_people_write_stays() -> None:
    for character in printable("".join(map(chr, range(1 << 16)))):
        assert unicodedata.category(character) not in ("Cc", "Cs", "Zl", "Zp")
        assert unicodedata.bidirectional(character) not in BIDIRECTIONAL
    text = "".join(map(chr, range(ord(" "), ord("~") + 1))) + "äß é ° × … 方"
    assert printable(text) == text
    assert printable("a\n\tb\r", keep="\n\t") == "a\n\tb\\r"
