"""Where runs are recorded without being told where."""

from pathlib import Path

import pytest

from pushplan.logging.runs import FOLDER, runs_folder


@pytest.mark.parametrize("value", [None, "", ".", "state", "../state", "~/state"])
def test_an_unset_empty_or_relative_folder_of_states_is_not_in_the_working_directory(
    value: str | None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", "/home/somebody")
    monkeypatch.setenv(FOLDER, "")
    if value is None:
        monkeypatch.delenv("XDG_STATE_HOME", raising=False)
    else:
        monkeypatch.setenv("XDG_STATE_HOME", value)
    assert runs_folder() == Path("/home/somebody/.local/state/pushplan/runs")


def test_an_absolute_folder_of_states_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(FOLDER, raising=False)
    monkeypatch.setenv("XDG_STATE_HOME", "/states")
    assert runs_folder() == Path("/states/pushplan/runs")
