"""Compiled code is ready when planning begins: no function is compiled, or loaded, on the way to the first path."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from pushplan.util.names import PLANNERS

CASES = [
    *((planner, "ecof", "") for planner in PLANNERS),
    ("auto", "robust", ""),
    ("auto", "ecof", "\nuncertainty: {floor_friction: 20 %, load: 10 %}\n"),
]
SCRIPT = """
import json, os, sys
from numba.core.registry import CPUDispatcher
from pushplan.kernels import warm_up
from pushplan.planners.planner import plan
from pushplan.plans.settings import Observer
from pushplan.scenario.file import example_text
from pushplan.scenario.file import scenario_from_text

def ready():
    modules = [module for name, module in sys.modules.items() if name.startswith("pushplan.")]
    functions = {value for module in modules for value in vars(module).values() if isinstance(value, CPUDispatcher)}
    return {(function.__module__, function.__name__, len(function.signatures)) for function in functions}

def look(name, stable, uncertainty):
    scenario = scenario_from_text(example_text("free-space") + uncertainty)
    warm_up(name, stable=stable, intervals=bool(uncertainty))
    before, late = ready(), []
    compare = lambda _: late.extend(ready() - before)
    result = plan(scenario, planner=name, stable_set=stable, first=True, observer=Observer(improved=compare))
    print(json.dumps([[name, stable, uncertainty], result.solved, sorted(late)]), flush=True)

for case in json.loads(sys.argv[1]):
    if not os.fork():  # a process in which nothing is loaded yet
        try:
            look(*case)
        finally:
            os._exit(0)
    os.wait()
"""


@pytest.fixture(scope="module")
def answers() -> dict[tuple[str, ...], list[object]]:
    """Return whether each case was solved, and what became ready too late."""
    words = [sys.executable, "-c", SCRIPT, json.dumps(CASES)]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    return {tuple(case): answer for case, *answer in map(json.loads, done.stdout.splitlines())}


@pytest.mark.parametrize("case", CASES)
def test_nothing_is_compiled_or_loaded_before_the_first_path(
    case: tuple[str, ...], answers: dict[tuple[str, ...], list[object]]
) -> None:
    assert answers[case] == [True, []]
