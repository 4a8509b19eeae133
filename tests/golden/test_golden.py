"""Results stay what they were: plans of equal seeds, margins, robustness, executions; see `outcomes.py`.

Searches are of 300 iterations and numbers are compared to a ten-thousandth: another kind of processor rounds linear
algebra and sines otherwise in the last bit, and a search of thousands of iterations then decides otherwise somewhere.
"""

import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest

_SPEC = importlib.util.spec_from_file_location("outcomes", Path(__file__).with_name("outcomes.py"))
assert _SPEC is not None
assert _SPEC.loader is not None
outcomes = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(outcomes)

FROZEN = json.loads(outcomes.FROZEN.read_text("utf-8"))


@pytest.mark.parametrize("name", outcomes.CASES)
def test_results_are_as_frozen(name: str) -> None:
    now, frozen = outcomes.CASES[name](), FROZEN[name]
    assert now.keys() == frozen.keys()
    for key, values in frozen.items():
        np.testing.assert_allclose(now[key], values, rtol=1e-4, atol=1e-4, err_msg=key)
