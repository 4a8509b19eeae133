"""Tell what two benchmarks differ in: the part of `pushplan bench --compare`."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from pushplan.cli.terminal.console import Console
from pushplan.cli.terminal.failure import DONE, MISMATCH

if TYPE_CHECKING:
    from pushplan.bench.statistics import Comparison


def compare(old: Path, new: Path, threshold: float, console: Console) -> int:
    """Compare the results of two folders and return the exit code."""
    from pushplan.bench.report import effect_text
    from pushplan.bench.statistics import compare_versions
    from pushplan.bench.store import read_results

    found = compare_versions(read_results(old), read_results(new), threshold)
    groups = (("better", found.better, "green"), ("worse", found.worse, "red"))
    for word, comparisons, colour in groups:
        for one in comparisons:
            what = f"{one.first}, {one.respect}: {effect_text(one)} in {one.pairs} runs (p = {one.p:.2g})"
            console.say(f"{console.paint(word, colour)}: {what}")
    for run in found.newly_invalid.itertuples():
        text = f"{run.problem}, {run.planner}, seed {run.seed}: {run.message.partition(chr(10))[0]}"
        console.say(f"{console.paint('invalid now', 'red')}: {text}")
    if not (found.better or found.worse or len(found.newly_invalid)):
        console.say("nothing has changed beyond chance")
    elif found.is_regression:
        console.say(f"a regression: worse by more than {100.0 * threshold:g} %, or invalid now")
    else:
        console.say(f"no regression: nothing is worse by more than {100.0 * threshold:g} %")
    console.emit(
        {
            "regression": found.is_regression,
            "threshold": threshold,
            "comparisons": [_document(one) for one in found.comparisons],
            "newly_invalid": list(found.newly_invalid.key),
        }
    )
    return MISMATCH if found.is_regression else DONE


def _document(one: Comparison) -> dict[str, object]:
    """Return a comparison as data; an effect that has no number (most runs are not solved any more) is null."""
    effect = one.effect if math.isfinite(one.effect) else None
    return {**asdict(one), "effect": effect, "significant": one.significant, "better": one.second_is_better}
