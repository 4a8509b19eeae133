"""Completion scripts: every command, option and example, in the words of the parser, run by the shells there are."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from pushplan.cli.completion import SHELLS, completion_script
from pushplan.cli.main import COMMANDS, main, parser
from pushplan.scenario.file import example_names


@pytest.mark.parametrize("shell", SHELLS)
def test_a_script_names_all_commands_options_and_examples(shell: str) -> None:
    script = completion_script(shell, parser())
    for word in (*COMMANDS, *example_names(), "time-limit", "plot"):
        assert word in script


@pytest.mark.parametrize("shell", SHELLS)
def test_the_shell_can_read_its_script(shell: str, tmp_path: Path) -> None:
    if shutil.which(shell) is None:
        pytest.skip(f"there is no {shell} here")
    file = tmp_path / "script"
    file.write_text(completion_script(shell, parser()))
    subprocess.run([shell, "-n", str(file)], check=True, timeout=30)


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        (["pushplan", "pl"], {"plan"}),
        (["pushplan", "plan", "two"], {"two-crates", "two-files.yaml"}),
        (["pushplan", "plan", "two-crates", "--pl"], {"--planner", "--plot"}),
        (["pushplan", "examples", "narr"], {"narrow-gap"}),
        (["pushplan", "completion", "f"], {"fish"}),
    ],
)
def test_bash_completes(typed: list[str], offered: set[str], tmp_path: Path) -> None:
    (tmp_path / "script").write_text(completion_script("bash", parser()))
    (tmp_path / "two-files.yaml").touch()
    words = " ".join(f"'{word}'" for word in typed)
    code = (
        f"source ./script; COMP_WORDS=({words}); COMP_CWORD={len(typed) - 1}; "
        f"_shtab_pushplan 2>/dev/null; printf '%s\\n' \"${{COMPREPLY[@]}}\""
    )
    done = subprocess.run(["bash", "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=30)
    assert {line.strip() for line in done.stdout.splitlines()} == offered


def test_an_unknown_shell_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", "dos"]) == 2
    assert "choose from" in capsys.readouterr().err
