"""The first own scenario: a commented file that loads, plans and is never overwritten."""

import shutil
from pathlib import Path

import pytest

from pushplan.cli.main import main
from pushplan.scenario.file import load_scenario

Captured = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_new_scenario_loads_passes_its_check_and_plans(capsys: Captured) -> None:
    assert main(["new", "mine"]) == 0
    assert "wrote mine.yaml" in capsys.readouterr().out
    assert load_scenario("mine.yaml").name == "mine"
    assert main(["check", "mine.yaml"]) == 0
    assert main(["plan", "mine.yaml", "--first"]) == 0


def test_a_file_is_never_overwritten(capsys: Captured) -> None:
    Path("mine.yaml").write_text("precious")
    for name in ("mine", "mine.yaml"):
        assert main(["new", name]) == 2
        assert capsys.readouterr().err == (
            "error: mine.yaml: this file exists already; choose another name or remove it\n"
        )
    assert Path("mine.yaml").read_text() == "precious"


@pytest.mark.parametrize("name", [" ", "_x", "a\tb", "-", "x" * 65])
def test_a_name_that_no_scenario_can_have_is_refused(name: str, capsys: Captured) -> None:
    assert main(["new", "--", name]) == 2
    assert "cannot be a scenario's name; allowed: a name of up to 64" in capsys.readouterr().err
    assert not list(Path().iterdir())


MAP = Path(__file__).parents[1] / "examples" / "office"


@pytest.mark.parametrize("drive", ["omnidirectional", "differential", "car"])
def test_a_scenario_in_a_map_for_any_drive_loads_and_plans(drive: str, capsys: Captured) -> None:
    shutil.copytree(MAP, "maps")
    assert main(["new", "mine", "--map", "maps/office.yaml", "--drive", drive]) == 0
    scenario = load_scenario("mine.yaml")
    assert scenario.chain.pusher.drive.kind == drive
    assert any(getattr(obstacle, "unknown", False) for obstacle in scenario.obstacles)
    assert main(["check", "mine.yaml"]) == 0
    assert main(["plan", "mine.yaml", "--first"]) == 0


def test_a_map_that_cannot_be_used_leaves_no_file(tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "sub").mkdir()
    shutil.copytree(MAP, tmp_path / "maps")
    assert main(["new", "sub/mine", "--map", "maps/office.yaml"]) == 2
    assert "maps/office.yaml: lies outside the folder of the scenario, 'sub'" in capsys.readouterr().err
    text = (tmp_path / "maps" / "office.yaml").read_text()
    (tmp_path / "maps" / "office.yaml").write_text(text.replace("resolution: 0.05", "resolution: 0.01"))
    assert main(["new", "mine", "--map", "maps/office.yaml"]) == 2
    assert "has no two places in sight of each other with 0.75 m of room" in capsys.readouterr().err
    assert main(["new", "mine", "--map", "gone.yaml"]) == 2
    assert "gone.yaml: cannot read the file" in capsys.readouterr().err
    assert not Path("mine.yaml").exists()
