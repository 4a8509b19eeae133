"""Every output of every command against folders, closed and full file systems; see `test_outputs` for the rest."""

import json
import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from output_options import OPTIONS, words

from pushplan.cli.main import main

NEEDS = {"mp4": "av", "ros2": "rosbags"}
"""Packages of extras that exports need; without them they are skipped."""

EVERY = pytest.mark.parametrize(
    ("command", "option", "suffix"),
    [
        pytest.param(*option, marks=pytest.mark.skipif(missing, reason="an extra is not installed"))
        for option in OPTIONS
        for missing in [option[1] in NEEDS and find_spec(NEEDS[option[1]]) is None]
    ],
)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    assert main(["plan", "one-box", "--first", "-o", str(path)]) == 0
    return path


@pytest.fixture(autouse=True)
def _short_films(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pushplan.logging.film.PICTURES_PER_SECOND", 1)


def test_there_are_as_many_as_the_documentation_names() -> None:
    assert len(OPTIONS) == len(set(OPTIONS)) == 19


@EVERY
def test_a_folder_is_refused_before_the_work(
    command: str, option: str, suffix: str, log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / f"folder{suffix}"
    folder.mkdir()
    assert main(words(command, option, folder, log)) == 2
    out, error = capsys.readouterr()
    assert "this is a folder" in error or "exists already" in error
    assert "solved" not in out
    assert os.listdir(tmp_path) == [folder.name]
    assert not os.listdir(folder)


@pytest.fixture(scope="module")
def in_namespace(log: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[Any, Any]:
    """Return exit code, error, what is there, and other files, by place, command and option."""
    unshare = ["unshare", "--map-root-user", "--mount"]
    if shutil.which("unshare") is None or subprocess.run([*unshare, "true"], check=False).returncode:
        pytest.skip("this machine lets nobody make a mount namespace")
    script = Path(__file__).with_name("outputs_in_namespace.py")
    command = [*unshare, sys.executable, str(script), str(tmp_path_factory.mktemp("places")), str(log)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return {tuple(row[:3]): row[3:] for row in json.loads(done.stdout)}


@EVERY
@pytest.mark.parametrize("place", ["full", "closed"])
def test_a_file_system_without_room_or_leave_ends_in_a_clear_error(
    place: str, command: str, option: str, suffix: str, in_namespace: dict[Any, Any]
) -> None:
    code, error, there, others = in_namespace[place, command, option]
    assert code == 2
    assert {"full": "No space left on device", "closed": "nothing may be written in the folder"}[
        place
    ] in error
    assert not there
    assert others == []
