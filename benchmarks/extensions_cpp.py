"""Time per extension of the project's trees against C++ OMPL with the same work, in one run.

Run `python benchmarks/extensions_cpp.py [--extensions 20000] [--scenario three-boxes-clutter]`. Needs a C++ compiler
and OMPL's headers (Debian: `apt-get install g++ libompl-dev`); says so and does nothing where they are missing. Both
sides grow one tree of the same number of extensions, never restarted, and try the exact connection from each node:
OMPL's RRT, with the core's arcs from Python; and those arcs without a planner, at random nodes instead of the nearest
ones. Times are CPU times, taken in turn.
"""

from __future__ import annotations

import argparse
import math
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from ompl import base as ob
from ompl import control as oc
from ompl import util as ou

from pushplan.bench.store import Machine
from pushplan.core.problem import Problem
from pushplan.core.search import Tree
from pushplan.planners.controls import margins_to_try
from pushplan.planners.problem import build_problem, sampling_box
from pushplan.planners.search.form import pose_problem
from pushplan.planners.search.session import Session, StopRule
from pushplan.scenario.file import load_scenario
from pushplan.scenario.model import Scenario

INCLUDES = [Path(f"/usr/include/{name}") for name in ("ompl-1.5", "ompl-1.6", "ompl-1.7", "eigen3")]


def posed(scenario: Scenario) -> tuple[Scenario, Problem]:
    """Return a scenario with the largest margin that `auto` tries, and its problem."""
    stable = scenario.stable_set()
    chosen = scenario.with_margin(margins_to_try(scenario, stable)[0])
    return chosen, build_problem(chosen, stable)


class Unreached(ob.GoalRegion):  # type: ignore[misc]
    """A goal that no state reaches, so that the tree keeps growing."""

    def distanceGoal(self, state: Any) -> float:  # noqa: N802 OMPL's name
        del state
        return 1.0


def why_not() -> str | None:
    """Return the reason why no comparison is possible; None if it is."""
    if shutil.which("g++") is None:
        return "no C++ compiler (g++)"
    if not any((folder / "ompl").is_dir() for folder in INCLUDES):
        return "OMPL's headers are not installed (Debian: libompl-dev)"
    return None


def build(folder: Path, name: str = "extensions") -> Path:
    """Compile a program from this folder into another folder, and return its path."""
    program = folder / name
    includes = [f"-I{path}" for path in INCLUDES if path.is_dir()]
    command = [
        "g++",
        "-std=c++17",
        "-O3",
        "-march=native",
        *includes,
        str(Path(__file__).with_name(f"{name}.cpp")),
        "-o",
        str(program),
        *(["-lompl"] if name == "extensions" else []),
    ]
    subprocess.run(command, check=True)
    return program


def write(problem: Problem, scenario: Scenario, path: Path) -> None:
    scene = problem.scene
    numbers = [scene.clearance, scene.kept, problem.longest, scenario.chain.reach]
    arrays = {
        "body_corners": scene.body.corners,
        "body_starts": scene.body.starts[:, None],
        "body_bounds": scene.body.bounds,
        "body_bound": scene.body_bound[None],
        "obstacles_corners": scene.obstacles.corners,
        "obstacles_starts": scene.obstacles.starts[:, None],
        "obstacles_bounds": scene.obstacles.bounds,
        "circles": scene.circles,
        "walls": scene.walls[None],
        "segments": problem.segments,
        "families": problem.families.reshape(-1, 3),
        "goal": problem.goal[None],
        "start": np.asarray(scenario.start)[None],
        "box": np.array([sampling_box(scenario)]),
        "numbers": np.array([numbers]),
    }
    with path.open("w") as file:
        for name, array in arrays.items():
            file.write(f"{name} {array.shape[0]} {array.shape[1]}\n")
            file.write(" ".join(repr(float(value)) for value in array.ravel()) + "\n")


def improvements(
    program: Path, problem: Problem, scenario: Scenario, planner: str, seed: int, seconds: float
) -> list[tuple[float, float]]:
    """Return CPU seconds and costs (m) of the improving paths of a planner in C++ without shortening: `hybrid_astar`,
    or one of OMPL's in `extensions`.
    """
    data = program.with_name(f"{planner}-{seed}.txt")
    write(problem, scenario, data)
    words = [str(seconds)] if program.name == "hybrid_astar" else ["0", str(seed), planner, str(seconds)]
    command = [program, data, *words]
    told = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return [(float(a), float(b)) for a, b in (line.split() for line in told.splitlines())]


def core_arcs(problem: Problem, scenario: Scenario, extensions: int, seed: int) -> tuple[float, float]:
    """Return the CPU seconds per arc that the core adds to a tree at a random node, and the share of valid arcs."""
    random = np.random.default_rng(seed)
    arcs, nodes = random.random((extensions, 3)).tolist(), random.random(extensions).tolist()
    tree = Tree(problem, scenario.start, scenario.chain.reach)
    goal = Tree(problem, problem.goal, scenario.chain.reach, back=True)
    began = time.process_time()
    for (which, where, length), node in zip(arcs, nodes, strict=True):
        tree.extend(int(node * len(tree)), (0.0, 0.0, 0.0), (which, where, length), math.inf, goal)
    return (time.process_time() - began) / extensions, (len(tree) - 1) / extensions


def python_rrt(problem: Problem, scenario: Scenario, extensions: int, seed: int) -> tuple[float, float]:
    """Return the CPU seconds per extension of OMPL's RRT with the core's propagator, and the share of valid arcs."""
    ou.setLogLevel(ou.LOG_NONE)
    ou.RNG.setSeed(seed)
    session = Session(problem, scenario.start, StopRule(math.inf, stall=10**12), seed)
    information, definition = pose_problem(session, sampling_box(scenario), scenario.chain.reach)
    definition.setGoal(Unreached(information))
    planner = oc.RRT(information)
    planner.setProblemDefinition(definition)
    planner.setup()
    began = time.process_time()
    planner.solve(ob.PlannerTerminationCondition(lambda: session.extensions >= extensions))
    kept = len(information.propagator.tree) - 1
    return (time.process_time() - began) / session.extensions, kept / session.extensions


def compare(name: str, extensions: int, repeats: int) -> str:
    """Return a line for a scenario, or the reason why there is none."""
    missing = why_not()
    if missing is not None:
        return f"C++ comparison skipped: {missing}"
    scenario, problem = posed(load_scenario(name))
    said = []
    with tempfile.TemporaryDirectory() as folder:
        program = build(Path(folder))
        data = Path(folder) / "problem.txt"
        write(problem, scenario, data)
        for what, ours, planner in (
            ("OMPL's RRT with the core's arcs from Python", python_rrt, "rrt"),
            ("the core's arcs at random nodes", core_arcs, "rrt"),
        ):
            mine, theirs = [], []
            for seed in range(1, repeats + 1):
                mine.append(ours(problem, scenario, extensions, seed))
                command = [program, data, str(extensions), str(seed), planner]
                told = subprocess.run(command, check=True, capture_output=True, text=True).stdout
                theirs.append([float(word) for word in told.split()[:2]])
            (a, kept_a), (b, kept_b) = np.median(mine, axis=0), np.median(theirs, axis=0)
            said.append(
                f"{name}, {what}: {1e6 * a:.2f} us per extension ({kept_a:.0%} of arcs kept), "
                f"{planner} in C++ {1e6 * b:.2f} us ({kept_b:.0%}), ratio {a / b:.2f}"
            )
    return "\n".join(said)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--extensions", type=int, default=20_000)
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--scenario", nargs="*", default=["three-boxes-clutter", "narrow-gap", "free-space"])
    arguments = parser.parse_args()
    print(f"{Machine.this().words}, {arguments.extensions} extensions, CPU time")
    for name in arguments.scenario:
        print(compare(name, arguments.extensions, arguments.repeats), flush=True)


if __name__ == "__main__":
    main()
