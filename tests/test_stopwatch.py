"""Phases add up to the time that passes."""

from __future__ import annotations

import time

from pushplan.util.stopwatch import Stopwatch


def test_phases_inside_others_are_counted_once() -> None:
    watch = Stopwatch()
    began = time.perf_counter()
    with watch("search"):
        time.sleep(0.02)
        for _ in range(2):
            with watch("logging"):
                time.sleep(0.03)
    with watch("logging"):
        time.sleep(0.01)
    assert sum(watch.seconds.values()) <= time.perf_counter() - began
    assert watch.seconds["logging"] >= 0.07
    assert watch.seconds["search"] >= 0.02
