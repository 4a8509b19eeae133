"""Code of users: its errors name it and its line, and its results are checked."""

from pathlib import Path
from typing import Any

import pytest
from conftest import Patch

import pushplan
from pushplan.cli.main import main
from pushplan.sets.known_load_sets import emptiness

MINE = """\
import numpy as np
from ompl import control
from pushplan import StableSet

class Everything(StableSet):
    name = "everything"
    def contact_margin_values(self, twists):
        return np.ones((len(twists), len(self.chain.contacts)))

class Fails(Everything):
    name = "fails"
    def contact_margin_values(self, twists):
        return {}["key"]

class Begins(Everything):
    name = "begins"
    def __init__(self, chain):
        super().__init__(chain)
        self.chains = [][3]

class Row(Everything):
    name = "row"
    def contact_margin_values(self, twists):
        return np.ones(len(twists))

class Nothing(Everything):
    name = "nothing"
    def margin_values(self, twists, floor=-2.0):
        return np.full(len(twists), np.nan)

class Planner(control.RRT):
    def solve(self, stop):
        return 1 / 0

def make(information):
    return 1 / 0

def simulator(plan, world):
    return 1 / 0

def number(plan, world):
    return 3

def exporter(run, path, **how):
    return 1 / 0
"""


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("run") / "run.mcap"
    pushplan.run(pushplan.load_scenario("one-box"), log=path, seed=1, iterations=200, time_limit=600.0)
    return path


@pytest.mark.parametrize(("words", "said"), [
    ("stable-set two-crates --set mine:Fails", "the stable set mine:Fails fails in {path}, line 13: KeyError: 'key'"),
    ("plan one-box --set mine:Fails", "the stable set mine:Fails fails in {path}, line 13: KeyError: 'key'"),
    ("plan one-box --set mine:Begins", "the stable set mine:Begins fails in {path}, line 19: IndexError"),
    ("plan one-box --set mine:Row", "the stable set mine:Row returns an array ("),
    ("plan one-box --set mine:Nothing", "the stable set mine:Nothing returns NaN from margin_values"),
    ("plan one-box --planner mine:make", "the planner mine:make fails in {path}, line 36: ZeroDivisionError"),
    ("plan one-box --planner mine:Planner", "the planner mine:Planner fails in {path}, line 33: ZeroDivisionError"),
    ("replay LOG --export mine:exporter=x", "the exporter mine:exporter fails in {path}, line 45: ZeroDivisionError"),
    ("trial LOG --samples 2 --simulator mine:simulator", "the simulator mine:simulator fails in {path}, line 39: Z"),
    ("trial LOG --samples 2 --simulator mine:number", "the simulator mine:number returns a int; allowed: a Con"),
    ("plan one-box --planner broken:P", "cannot load 'broken:P' in {folder}/broken.py, line 1: ZeroDivisionError"),
])  # fmt: skip
def test_an_error_in_an_extension_names_it_and_its_line(
    words: str, said: str, log: Path, tmp_path: Path, monkeypatch: Patch, capsys: Any
) -> None:
    (tmp_path / "mine.py").write_text(MINE)
    (tmp_path / "broken.py").write_text("1 / 0\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(__import__("sys").modules, "mine", raising=False)
    argv = [str(log) if word == "LOG" else word for word in words.split()]
    argv += ["--no-log", "--time-limit", "1"] if argv[0] == "plan" else []
    assert main(argv) == 2
    assert said.format(path=tmp_path / "mine.py", folder=tmp_path) in capsys.readouterr().err


def test_a_set_in_which_every_twist_is_stable_is_not_empty() -> None:
    space: dict[str, Any] = {"__name__": "mine"}
    exec(MINE, space)
    stable = space["Everything"](pushplan.load_scenario("one-box").chain)
    twists, margins = stable.peaks
    assert margins.tolist() == [1.0]
    assert twists[0] == pytest.approx([1.0, 0.0, 0.0])
    assert emptiness(stable, 0.5) == ("", None)
