"""Completion scripts: every command, option and example, run by the shells there are."""

import shutil
import subprocess
from pathlib import Path

import pytest

from pushplan.cli.main import main

Captured = pytest.CaptureFixture[str]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_shell_can_read_its_script(shell: str, tmp_path: Path, capsys: Captured) -> None:
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert "_PUSHPLAN_COMPLETE" in script
    if shutil.which(shell) is None:
        pytest.skip(f"there is no {shell} here")
    (tmp_path / "script").write_text(script)
    subprocess.run([shell, "-n", str(tmp_path / "script")], check=True, timeout=30)


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("pl", {"plain,plan"}),
        ("plan two", {"plain,two-crates", "file,two"}),
        ("plan two-crates --pl", {"plain,--planner", "plain,--plot"}),
        ("examples narr", {"plain,narrow-gap", "file,narr"}),
        ("completion f", {"plain,fish"}),
    ],
)
def test_words_are_completed(
    typed: str, offered: set[str], monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    words = f"pushplan {typed}"
    monkeypatch.setenv("_PUSHPLAN_COMPLETE", "bash_complete")
    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(len(words.split()) - 1))
    with pytest.raises(SystemExit):
        main([])
    assert set(capsys.readouterr().out.split()) == offered
