"""How soon after a drop the plan is on the screen: `python benchmarks/view.py [SCENARIO] [DROPS]`, with Chromium."""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
import boxes
import viewed

import pushplan
from pushplan.viewing.window import Window

WANTED = 100.0
"""Median from the drop until the first plan is on the screen, ms."""


def main(name: str = "two-crates", drops: int = 20) -> None:
    scenario = pushplan.load_scenario(name)
    random = np.random.default_rng(1)
    found: dict[str, list[float]] = {"first": [], "timed": []}
    solved = 0
    window = Window(scenario, tell=print)
    with tempfile.TemporaryDirectory() as folder, boxes.chromium(Path(folder)) as browser:
        viewed.open_window(browser, window)
        for _ in range(drops):
            begin = window.draft.goal
            end = scenario.goal.pose_chain + np.append(random.uniform(-0.05, 0.05, 2), 0.0)
            browser.evaluate("window.dropped = undefined, window.shown = {}, 0")
            viewed.drag(browser, window, begin, end)
            for stage, times in found.items():
                times.append(viewed.shown_after(browser, stage))
            time.sleep(1.5)  # polishing is over
            solved += window.answer is not None and window.answer.solved
    window.close()
    print(
        f"{name}: {drops} drops of the goal ({solved} with a plan), headless Chromium with software rendering"
    )
    for stage, times in found.items():
        low, middle, high = np.percentile(times, [10, 50, 90])
        print(f"  {stage:6} on the screen after {middle:4.0f} ms (10 to 90 %: {low:.0f} to {high:.0f})")
    print(
        f"  wanted: first plan in the median within {WANTED:.0f} ms: {statistics.median(found['first']) <= WANTED}"
    )


if __name__ == "__main__":
    main(*sys.argv[1:2], *map(int, sys.argv[2:3]))
