"""The README shows what its commands print; that all of them run is the business of `test_docs`."""

import re
import shlex
from pathlib import Path

import pytest

from pushplan.cli.main import main

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
Captured = pytest.CaptureFixture[str]


def _blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", TEXT, flags=re.DOTALL)


def _words(block: str) -> list[str]:
    """The words of the `pushplan` command at the end of a line of shell."""
    words: list[str] = shlex.split(block.rpartition("/pushplan ")[2])
    return words


def _shape(output: str) -> str:
    """Output with every number replaced, and whether it is a bound, for what is the same in every run."""
    output = output.replace("at least ", "")  # what a plan bears is looked at so far and no farther
    return re.sub(r"[-+]?\d[\d.]*(e[-+]\d+)?( ms| s|\b)", "#", output)


def test_the_first_command_plans_draws_records_and_prints_what_the_readme_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(_words(_blocks("sh")[0])) == 0
    printed, shown = capsys.readouterr().out.splitlines(), _blocks("text")[0].splitlines()
    assert printed[0] == shown[0]
    assert [line.split("  ")[:2] for line in printed] == [line.split("  ")[:2] for line in shown]
    contacts = re.compile(
        r"contact [\w-]+"
    )  # which one has the least margin depends on how far the search comes
    assert [_shape(contacts.sub("contact", line)) for line in printed] == [
        _shape(contacts.sub("contact", line)) for line in shown
    ]
    assert (tmp_path / "run.mcap").exists()
    assert (tmp_path / "run.png").stat().st_size > 10_000


def test_the_message_about_a_mistake_is_the_one_that_is_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new", "mine"]) == 0
    file = Path("mine.yaml")
    file.write_text(file.read_text().replace("  width: ", "  widht: "))
    assert main(["check", "mine.yaml"]) == 2
    assert capsys.readouterr().err == _blocks("text")[1]
