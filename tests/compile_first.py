"""Run what compiles most, for numba's cache: `python tests/compile_first.py [plan] [sets]`."""

from __future__ import annotations

import sys

import yaml


def plan() -> None:
    """Compile searches of one push and of several."""
    from pushplan.kernels import warm_up

    warm_up("auto", intervals=True, multi_push=True)


def sets() -> None:
    """Compile the boundaries of stable sets, of numbers and of intervals."""
    import pushplan
    from pushplan.scenario.file import scenario_from_document
    from pushplan.scenario.template import new_scenario_text

    with_intervals = scenario_from_document(yaml.safe_load(new_scenario_text("new")))
    for scenario in (pushplan.load_scenario("one-box"), with_intervals):
        scenario.stable_set().refined_meridians()


if __name__ == "__main__":
    for what in sys.argv[1:]:
        {"plan": plan, "sets": sets}[what]()
