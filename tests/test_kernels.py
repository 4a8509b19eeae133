"""Compiled code is ready when planning begins: no function is compiled, or loaded, on the way to the first path."""

from __future__ import annotations

import subprocess
import sys

import pytest

from pushplan.basics.names import PLANNERS

SCRIPT = """
import sys
from numba.core.registry import CPUDispatcher
from pushplan.kernels import warm_up
from pushplan.plan import plan
from pushplan.examples import example_text
from pushplan.reading.scenario_file import scenario_from_text

def ready():
    modules = [module for name, module in sys.modules.items() if name.startswith("pushplan.")]
    functions = {value for module in modules for value in vars(module).values() if isinstance(value, CPUDispatcher)}
    return {(function.__module__, function.__name__, len(function.signatures)) for function in functions}

name, stable, uncertainty = sys.argv[1:]
scenario = scenario_from_text(example_text("free-space") + uncertainty)
warm_up(name, stable=stable, intervals=bool(uncertainty))
before, late = ready(), []
result = plan(scenario, planner=name, stable_set=stable, first=True, progress=lambda _: late.extend(ready() - before))
print(result.solved, sorted(late))
"""


@pytest.mark.parametrize(
    ("planner", "stable", "uncertainty"),
    [
        *((planner, "ecof", "") for planner in PLANNERS),
        ("auto", "robust", ""),
        ("auto", "ecof", "\nuncertainty: {floor_friction: 20 %, load: 10 %}\n"),
    ],
)
def test_nothing_is_compiled_or_loaded_before_the_first_path(
    planner: str, stable: str, uncertainty: str
) -> None:
    words = [sys.executable, "-c", SCRIPT, planner, stable, uncertainty]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[0] == "True []"
