"""Problems of the public kinodynamic benchmark dynobench that map to pushes exactly, against its published solutions.

Run `python benchmarks/dynobench.py [FILE ...] [--seeds 5] [--seconds 2]`; files are by default those of
`dynobench_problems/`, in the benchmark's own form. A unicycle that only drives ahead, between two speeds, is a car
with a smallest turning radius: a plate and a box, 0.25 m deep each, are its 0.5 x 0.25 m, with the axle at the
chain's origin. Pushes begin and end at rest and have a limited jerk, which the unicycle need not: that costs time
here. A push may be slower than the unicycle's 0.25 m/s: so the slowest speed between the first and the last second
is printed, too. The robot `unicycle1_v2` of `wall_0` does not map: slower turns to the right give it another
smallest radius there, 1 m, than to the left, 0.5 m, and a car has one for both sides.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import pushplan
from pushplan.bench.processes.machine import Machine
from pushplan.bench.random_problems.scenario_yaml import scenario_yaml
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.model import Scenario

PROBLEMS = Path(__file__).parent / "dynobench_problems"
SLOWEST, FASTEST, DEPTH = 0.25, 0.5, 0.25
TURN = 0.5
"""Largest angular speed of `unicycle1_v1`, rad/s."""


def scenario_of(problem: dict[str, Any]) -> Scenario:
    """Return the push problem; its set is cut down by the car alone, as the box pushed is light and rough."""
    area, (robot,) = problem["environment"], problem["robots"]
    if robot["type"] != "unicycle1_v1":
        raise SystemExit(f"the robot {robot['type']} does not map to a push; allowed: unicycle1_v1")
    limits = {"speed": FASTEST, "acceleration": 100.0, "jerk": 1e5, "angular_speed": TURN}
    limits |= {"angular_acceleration": 1e3, "angular_jerk": 1e5, "contact": "quasi-static"}
    car = {"axle": [0.0, 0.0, 0.0], "min_radius": SLOWEST / TURN}
    document = {
        "name": problem["name"],
        "floor": {"friction": 0.3},
        "objects": [{"name": "box", "shape": {"box": [DEPTH, DEPTH]}, "mass": 1.0}],
        "contacts": {"friction": 1.0},
        "pusher": {
            "width": DEPTH,
            "thickness": DEPTH,
            "friction": 1.0,
            "drive": {"car": car},
            "limits": limits,
        },
        "start": robot["start"],
        "goal": {"pose": robot["goal"]},
        "workspace": {axis: [area["min"][k], area["max"][k]] for k, axis in enumerate("xy")},
        "obstacles": [{"box": o["size"], "pose": [*o["center"], 0.0]} for o in area["obstacles"]],
        "stability": {"margin": 0.0},
        "clearance": 1e-4,
        "planner": {"cost": "time", "arc_price": 0.0},
    }
    return scenario_from_text(scenario_yaml(document), problem["name"])


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("files", nargs="*", type=Path, default=sorted(PROBLEMS.glob("*.yaml")))
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=2.0)
    arguments = parser.parse_args()
    print(Machine.this().words)
    for path in arguments.files:
        problem = yaml.safe_load(path.read_text())
        scenario = scenario_of(problem)
        radii = scenario.stable_set().turning_radii(0.0)
        print(f"{problem['name']}: published {problem.get('published')}; the set alone turns at {radii}")
        for seed in range(1, arguments.seeds + 1):
            result = pushplan.plan(scenario, seed=seed, time_limit=arguments.seconds)
            if result.trajectory is None or result.first_solution_s is None:
                print(f"  seed {seed}: {result.reason}")
                continue
            t = np.linspace(1.0, result.trajectory.duration - 1.0, 10_000)
            slowest = np.hypot(*result.trajectory.twists_at(t)[:, :2].T).min()
            print(
                f"  seed {seed}: {result.trajectory.duration:.2f} s, first path after "
                f"{1e3 * result.first_solution_s:.1f} ms, slowest {slowest:.3f} m/s"
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
