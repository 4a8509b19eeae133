"""Problems that `auto` leaves unsolved although another planner of pushplan solves them: 310, by CPU time.

    python benchmarks/unsolved.py [--kinds maze ...] [--seeds 3] [--seconds 2] [--begin 0] [--share 1]

`auto` searches every problem with default settings until it has a plan. OMPL's planners that pushplan offers search
those that it does not solve with every seed. Prints for each kind of problem: runs of `auto` with a plan, CPU time to
it, problems that are proven infeasible, those that no planner solves, and those that another planner solves and
`auto` does not, by name; these make the exit code 1. No problem was used for tuning; `--begin` draws others.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import count, pairwise
from typing import Any

import dense_scenes
import numpy as np
import series
from script import options

from pushplan.bench.random_problems import generate, random_chain, scenario_yaml
from pushplan.bench.schema import ProblemParameters
from pushplan.errors import PushplanError
from pushplan.planner import Planner
from pushplan.plans.plan import Plan
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.model import Scenario

STOCK = ("rrt", "est", "kpiece")
DRIVES = ("omnidirectional", "differential", "car")
BENT: dict[str, Any] = {
    "name": "bent",
    "shape": {"polygon": [[-0.05, -0.08], [0.07, -0.08], [0.07, -0.03], [0.0, -0.03], [0.0, 0.08], [-0.05, 0.08]]},
    "mass": 0.8,
}
"""An angle iron, which is not convex."""


def _rng(kind: str, number: int) -> np.random.Generator:
    return np.random.Generator(np.random.PCG64([31, *kind.encode(), number]))


def chain(rng: np.random.Generator) -> dict[str, Any]:
    """Return the sections of one to three boxes, of an angle iron before a box, or of boxes before wheels."""
    match int(rng.integers(4)):
        case 0:
            objects = [{"name": f"box{i}", "shape": {"box": [0.08, 0.14]}, "mass": 1.0} for i in range(3)]
        case 1:
            objects = [BENT, {"name": "box", "shape": {"box": [0.08, 0.1]}, "mass": 0.5}]
        case 2:
            drives = ProblemParameters(objects=(1, 2), drives=DRIVES[1:], turning_radius=0.4)
            return random_chain(rng, drives)[0]
        case _:
            return random_chain(rng, ProblemParameters(objects=(1, 3), turning_radius=0.4))[0]
    pusher = {"width": 0.16, "friction": 0.5}
    return {"floor": {"friction": 0.3}, "objects": objects, "contacts": {"friction": 0.5}, "pusher": pusher}


def maze(number: int) -> Scenario:
    rng = _rng("maze", number)
    return series.maze(int(rng.integers(8, 15)), 100 + number, float(rng.uniform(1.0, 1.6)), chain(rng))


def office(number: int) -> Scenario:
    return series.office(int(_rng("office", number).integers(6, 13)), 100 + number)


def walled(name: str, rng: np.random.Generator, walls: list[Any], start: Any, goal: Any) -> Scenario:
    """Return a room of 6 x 4 m with walls, given by their corners."""
    sections = {
        "name": name,
        **chain(rng),
        "start": np.round(start, 4).tolist(),
        "goal": {"pose": np.round(goal, 4).tolist()},
        "workspace": {"x": [0.0, 6.0], "y": [0.0, 4.0]},
        "obstacles": [{"polygon": np.round(wall, 4).tolist()} for wall in walls],
    }
    return scenario_from_text(scenario_yaml(sections), name)


def _bar(begin: Any, end: Any) -> Any:
    """Return the corners of a wall from one point to another."""
    begin, end = np.array(begin), np.array(end)
    across = 0.5 * series.THICK * np.array([begin[1] - end[1], end[0] - begin[0]]) / np.linalg.norm(end - begin)
    return np.array([begin - across, end - across, end + across, begin + across])


def leaning(number: int) -> Scenario:
    """Return three walls at angles, with gaps of 0.5 to 1 m at alternate ends."""
    rng, walls = _rng("leaning", number), []
    for k, x in enumerate((1.7, 3.0, 4.3)):
        lean, gap = rng.uniform(-0.5, 0.5), rng.uniform(0.5, 1.0)
        low, high = (0.0, 4.0 - gap) if k % 2 else (gap, 4.0)
        walls.append(_bar((x - lean, low), (x + lean, high)))
    start, goal = [0.5, rng.uniform(1.0, 3.0), 0.0], [5.2, rng.uniform(1.0, 3.0), 0.0]
    return walled(f"leaning-{number}", rng, walls, start, goal)


def pocket(number: int) -> Scenario:
    """Return a U that is open away from the goal, with the start in it, or the reverse."""
    rng = _rng("pocket", number)
    wide, deep, turned = rng.uniform(1.0, 1.6), rng.uniform(0.8, 1.6), rng.uniform(-0.6, 0.6)
    turn = np.array([[np.cos(turned), -np.sin(turned)], [np.sin(turned), np.cos(turned)]])
    corners = np.array([[-deep, 0.5], [0.0, 0.5], [0.0, -0.5], [-deep, -0.5]]) * [1.0, wide] @ turn.T + [3.2, 2.0]
    walls = [_bar(a, b) for a, b in pairwise(corners)]
    inside = [*(np.array([0.4 - deep, 0.0]) @ turn.T + [3.2, 2.0]), turned]
    outside = [rng.uniform(4.3, 5.2), rng.uniform(0.8, 3.2), rng.uniform(-0.5, 0.5)]
    if number % 2:  # into the U, which must be open towards what comes
        return walled(f"pocket-{number}", rng, walls, [0.6, rng.uniform(1.0, 3.0), 0.0], inside)
    inside[2] += np.pi
    return walled(f"pocket-{number}", rng, walls, inside, outside)


def near(number: int) -> Scenario:
    """Return a near goal: sideways, behind, or turned on the spot, in a room with three short walls."""
    rng = _rng("near", number)
    start = np.array([3.0, 2.0, rng.uniform(-3.0, 3.0)])
    goal = start + np.append(rng.uniform(-0.25, 0.25, 2), rng.uniform(-0.6, 0.6))
    walls = []
    for angle in rng.uniform(-np.pi, np.pi, 3):
        middle = start[:2] + rng.uniform(1.0, 1.6) * np.array([np.cos(angle), np.sin(angle)])
        along = rng.uniform(0.2, 0.5) * np.array([-np.sin(angle), np.cos(angle)])
        walls.append(_bar(middle - along, middle + along))
    return walled(f"near-{number}", rng, walls, start, goal)


def cluttered(number: int) -> Scenario:
    """Return up to five objects and thirty obstacles with any drive."""
    return scenario_from_text(generate(ProblemParameters(drives=DRIVES), 5_000 + number), f"cluttered-{number}")


def dense(number: int) -> Scenario:
    return scenario_from_text(scenario_yaml(dense_scenes.scene(300 + number)), f"dense-{number}")


KINDS: dict[str, tuple[Callable[[int], Scenario], int]] = {
    "maze": (maze, 40),
    "office": (office, 20),
    "leaning": (leaning, 20),
    "pocket": (pocket, 20),
    "near": (near, 20),
    "cluttered": (cluttered, 100),
    "dense": (dense, 90),
}


def problems(kind: str, begin: int, share: float) -> Iterator[Scenario]:
    """Yield the problems of a kind; numbers with a blocked start or goal are skipped."""
    make, total = KINDS[kind]
    wanted = max(1, round(share * total))
    for number in count(begin):
        with suppress(PushplanError):
            scenario = make(number)
            Planner(scenario)
            yield scenario
            wanted -= 1
        if not wanted:
            return


def measure(scenario: Scenario, seeds: int, seconds: float) -> tuple[str, list[float]]:
    """Return what became of a problem, and the CPU times (s) to the plans of `auto`.

    Returns:
        `solved` (with every seed or by nobody else), `proven`, `nobody`, or the name with the counts of the others.
    """

    def plans(planner: str) -> list[Plan]:
        searched = Planner(scenario, planner=planner)
        return [searched.plan(first=True, seed=seed, time_limit=seconds) for seed in range(1, seeds + 1)]

    found = plans("auto")
    firsts = [plan.first_solution_s for plan in found if plan.first_solution_s is not None]
    if len(firsts) == seeds:
        return "solved", firsts
    if any(cause.proven for plan in found for cause in plan.diagnosis):
        return "proven", firsts
    others = {planner: sum(plan.solved for plan in plans(planner)) for planner in STOCK}
    solving = ", ".join(f"{planner} {number}" for planner, number in others.items() if number)
    print(f"{scenario.name}: auto {len(firsts)}, others {solving or 'none'}", file=sys.stderr, flush=True)
    if solving:
        return f"{scenario.name} (auto {len(firsts)}, {solving} of {seeds})", firsts
    return "solved" if firsts else "nobody", firsts


def main() -> int:
    asked = options(__doc__, kinds=tuple(KINDS), seeds=3, seconds=2.0, begin=0, share=1.0)
    print("| problems | solved by `auto`, runs | median, 90 %, most | proven infeasible | by nobody | by others |")
    print("|---|---|---|---|---|---|")
    missed: list[str] = []
    for kind in asked.kinds:
        rows = [measure(one, asked.seeds, asked.seconds) for one in problems(kind, asked.begin, asked.share)]
        ends, firsts = Counter(end for end, _ in rows), [first for _, some in rows for first in some]
        named = [end for end in ends if end not in ("solved", "proven", "nobody")]
        missed += named
        times = 1e3 * np.quantile(firsts or [np.nan], [0.5, 0.9, 1.0], method="higher")
        print(
            f"| {kind}, {len(rows)} | {len(firsts)} of {asked.seeds * len(rows)} | "
            f"{', '.join(f'{one:.3g}' for one in times)} ms | {ends['proven']} | {ends['nobody']} | {len(named)} |",
            flush=True,
        )
    print("", *(missed or ["nothing that others solve is left unsolved"]), sep="\n")
    return bool(missed)


if __name__ == "__main__":
    sys.exit(main())
