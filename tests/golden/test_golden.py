"""Results stay what they were: plans of equal seeds, margins, robustness, executions; see `outcomes.py`.

Searches are of 300 iterations and numbers are compared to a ten-thousandth: another kind of processor rounds linear
algebra and sines otherwise in the last bit, and a search of thousands of iterations then decides otherwise somewhere.
Bounds are compared to two thousandths: their search ends where better costates would raise them by a thousandth.
"""

import json

import numpy as np
import pytest
from golden.outcomes import CASES, FROZEN


@pytest.mark.parametrize("name", CASES)
def test_results_are_as_frozen(name: str) -> None:
    now, frozen = CASES[name](), json.loads(FROZEN.read_text("utf-8"))[name]
    assert now.keys() == frozen.keys()
    for key, values in frozen.items():
        np.testing.assert_allclose(now[key], values, rtol=2e-3 if key == "bound" else 1e-4, atol=1e-4, err_msg=key)
