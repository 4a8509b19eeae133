"""Compiled code is ready when planning begins: no function is compiled, or loaded, on the way to the first path."""

from __future__ import annotations

import subprocess
import sys

import pytest

from pushplan.names import PLANNERS

SCRIPT = """
import sys
from numba.core.registry import CPUDispatcher
from pushplan.kernels import warm_up
from pushplan.plan import plan
from pushplan.reading.scenario_file import load_scenario

def ready():
    modules = [module for name, module in sys.modules.items() if name.startswith("pushplan.")]
    functions = {value for module in modules for value in vars(module).values() if isinstance(value, CPUDispatcher)}
    return {(function.__module__, function.__name__, len(function.signatures)) for function in functions}

name = sys.argv[1]
warm_up(name)
before, late = ready(), []
result = plan(load_scenario("free-space"), planner=name, first=True, progress=lambda _: late.extend(ready() - before))
print(result.solved, sorted(late))
"""


@pytest.mark.parametrize("planner", [*PLANNERS])
def test_nothing_is_compiled_or_loaded_before_the_first_path(planner: str) -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT, planner], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[0] == "True []"
