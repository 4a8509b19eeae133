"""How soon after a drop the plan is on the screen: `python benchmarks/view.py [SCENARIO] [DROPS]`, with Chromium.

The goal is dropped where the mouse rested for two pictures, and in the very move that ends there, in turn.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
import boxes
import viewed

import pushplan
from pushplan.view.window import Window

WANTED = 100.0
"""Median from the drop until the first plan is on the screen, ms."""


STAGES = ("first", "timed")


def main(name: str = "two-crates", drops: int = 20) -> None:
    scenario = pushplan.load_scenario(name)
    random = np.random.default_rng(1)
    found: dict[bool, list[list[float]]] = {True: [], False: []}
    solved = 0
    window = Window(scenario, message=print)
    with tempfile.TemporaryDirectory() as folder, boxes.chromium(Path(folder)) as browser:
        viewed.open_window(browser, window)
        for i in range(2 * drops):
            begin = window.draft.poses["goal"]
            end = scenario.goal.pose_chain + np.append(random.uniform(-0.05, 0.05, 2), 0.0)
            browser.evaluate("window.dropped = undefined, window.shown = {}, 0")
            viewed.drag(browser, window, begin, end, rest=i % 2 == 0)
            found[i % 2 == 0].append([viewed.shown_after(browser, stage) for stage in STAGES])
            time.sleep(1.5)  # polishing is over
            solved += window.answer is not None and window.answer.solved
    window.close()
    print(
        f"{name}: {2 * drops} drops of the goal ({solved} with a plan), headless Chromium, software rendering"
    )
    for rest, times in found.items():
        print(f"  let go {'at rest' if rest else 'in motion'}")
        for stage, (low, middle, high) in zip(
            STAGES, np.percentile(times, [10, 50, 90], axis=0).T, strict=True
        ):
            print(
                f"    {stage} plan on the screen after {middle:.0f} ms (10 to 90 %: {low:.0f} to {high:.0f})"
            )
    median = np.median([first for times in found.values() for first, _ in times])
    print(f"  wanted: first plan in the median within {WANTED:.0f} ms: {median:.0f} ms, {median <= WANTED}")


if __name__ == "__main__":
    main(*sys.argv[1:2], *map(int, sys.argv[2:3]))
