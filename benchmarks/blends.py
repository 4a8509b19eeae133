"""How much sooner blended trajectories arrive than exact ones on the packaged scenarios, and what limits it.

Run `python benchmarks/blends.py [--speed 0.3]`: a minute of CPU. Both trajectories follow the same path, planned with
seed 1 and 20,000 iterations, for the least travel, with a margin of 0 and inertia left out, so that corners are
many and only the pusher's own limits count. `no stop` is the least time in which the middle of the contact can
travel as far as it does on the path; `straight` the same for the straight line from start to goal, which no motion
beats.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np
from pushplan.bench.processes.machine import Machine

from pushplan.mechanics.chain import Limits
from pushplan.plan import plan
from pushplan.planners.blending.blending import blend_path
from pushplan.planners.blending.parts import corners_of
from pushplan.planners.timing.arc_limits import ArcLimits, motion_bounds
from pushplan.planners.timing.exact_timing import rest_to_rest, time_path
from pushplan.plans.path import PushPath
from pushplan.scenario.file import example_names, load_scenario
from pushplan.scenario.model import Scenario


def stated(scenario: Scenario) -> Scenario:
    """Return the scenario with the settings of this benchmark."""
    pusher = scenario.chain.pusher
    pusher = replace(pusher, limits=replace(pusher.limits, contact="quasi-static"))
    scenario = replace(scenario.with_margin(0.0), chain=replace(scenario.chain, pusher=pusher))
    return replace(scenario, planner=replace(scenario.planner, cost="travel", arc_price=0.002))


def with_speed(scenario: Scenario, speed: float) -> Scenario:
    """Let the pusher be at least so fast, m/s."""
    pusher = scenario.chain.pusher
    limits = replace(pusher.limits, speed=max(speed, pusher.limits.speed))
    return replace(scenario, chain=replace(scenario.chain, pusher=replace(pusher, limits=limits)))


def least_time(distance: float, limits: Limits) -> float:
    """Shortest time (s) from rest to rest over a distance, m."""
    along = ArcLimits(limits.speed, limits.acceleration, limits.acceleration, limits.jerk)
    return rest_to_rest(distance, along).duration


def line(name: str, scenario: Scenario, path: PushPath) -> tuple[str, float, float]:
    """Time a path both ways and tell what is saved; return the words, and how long exact and blended take, s."""
    limits, stable = scenario.chain.pusher.limits, scenario.stable_set()
    bounds = motion_bounds(scenario, stable)
    blend_path(scenario, path, stable, bounds)
    begin = time.process_time()
    blend = blend_path(scenario, path, stable, bounds)
    spent = time.process_time() - begin
    exact = time_path(path, bounds).duration
    travel = float(np.hypot(path.twists[:, 0], path.twists[:, 1]) @ path.lengths)
    straight = float(np.hypot(*(path.end - path.start)[:2]))
    times = (blend.trajectory.duration, least_time(travel, limits), least_time(straight, limits))
    shares = " | ".join(f"{100.0 * (1.0 - t / exact):.1f} %" for t in times)
    corners = f"{len(corners_of(path))} | {len(blend.stops)}"
    words = f"| {name} | {corners} | {exact:.2f} | {times[0]:.2f} | {shares} | {spent:.2f} |"
    return words, exact, times[0]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--speed", type=float, default=0.0)
    speed = parser.parse_args().speed
    print(Machine.this().words)
    print("| scenario | corners | stops | exact, s | blended, s | saved | no stop | straight | CPU, s |")
    print("|---|---|---|---|---|---|---|---|---|")
    exact = blended = 0.0
    for name in example_names():
        scenario = stated(load_scenario(name))
        path = plan(scenario, seed=1, time_limit=60.0, iterations=20_000).path
        assert path is not None
        words, *durations = line(name, with_speed(scenario, speed), path)
        exact, blended = exact + durations[0], blended + durations[1]
        print(words, flush=True)
    print(
        f"together: exact {exact:.2f} s, blended {blended:.2f} s, {100.0 * (1.0 - blended / exact):.1f} % saved"
    )


if __name__ == "__main__":
    main()
