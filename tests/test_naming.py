"""Planners and stable sets of others: by `module:attribute`, by entry points, handed over as they are."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from pushplan.cli.main import main
from pushplan.errors import PushplanError
from pushplan.planners.search.planners import planner_named
from pushplan.sets.known_load_sets import EcofSet
from pushplan.sets.named import add_set

EXAMPLES = Path(__file__).parents[1] / "examples"
PLANNER, SET = "a_planner_of_your_own:LazyRRT", "a_stable_set_of_your_own:Leaning"


@pytest.fixture(autouse=True)
def _in_examples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Work in the examples' folder; forget what was imported from there."""
    monkeypatch.chdir(EXAMPLES)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setattr(sys, "dont_write_bytecode", True)


def test_a_planner_and_a_set_by_their_places(capsys: pytest.CaptureFixture[str]) -> None:
    words = f"plan two-crates --planner {PLANNER} --set {SET} --first --time-limit 20 --json".split()
    assert main(words) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["planner"], told["set"]) == (PLANNER, "leaning")
    assert main(["stable-set", "two-crates", "--set", SET, "--set", "ecof", "--json"]) == 0
    sets = json.loads(capsys.readouterr().out)["sets"]
    (right, left), (low, high) = (
        np.array(sets[name]["translation_cone"])[:, 1] for name in ("leaning", "ecof")
    )
    assert low < right < left < high


@pytest.mark.parametrize(("given", "what"), [
    ("nobody", "no planner is called 'nobody'; there are auto, rrt, est"),
    ("no_such_module:Planner", "cannot load 'no_such_module:Planner': No module named 'no_such_module'"),
    ("math:nothing", "cannot load 'math:nothing': module 'math' has no attribute 'nothing'"),
    ("math:pi", "the planner 'math:pi' is a float"),
])  # fmt: skip
def test_what_is_no_planner_is_refused(given: str, what: str) -> None:
    with pytest.raises(PushplanError) as caught:
        planner_named(given)
    assert what in str(caught.value)


def test_what_is_no_stable_set_is_refused() -> None:
    with pytest.raises(PushplanError, match="'math:pi' is no stable set; allowed: a subclass of"):
        add_set("math:pi")
    with pytest.raises(PushplanError, match="no stable set is called 'stabel'; there are ecof, cof"):
        add_set("stabel")
    false = type("False_", (EcofSet,), {"name": "cof"})
    with pytest.raises(PushplanError, match="has the name 'cof'; allowed: a text other than ecof, cof"):
        add_set(false)
