"""Do plans hold in a physics engine, at their own speed, with full inertia, also in worlds with errors?

Run `python benchmarks/plans_in_physics.py [--problems 40] [--scenarios two-crates ...] [--settings old plain ...]
[--out results.jsonl] [--tolerance]`. Every packaged scenario and random problems, all on four feet an object with
known loads (`on_feet.py`), are planned with each of `SETTINGS` and executed in MuJoCo: as stated, and in
each of eight worlds that differ from what the plan believes (`perturbed`). `--tolerance` executes each plan in worlds
that differ by 0.9 of what it says it can bear instead. Raw results go to a file, one JSON object a line; with the
same file a run goes on where it ended. Prints a Markdown table; exits 1 when a plan fails in the world as stated, or
within its tolerance.

A contact is lost when it slides or opens by more than a thousandth of its segment. An object that starts turned
touches with a corner only: slides and gaps count from the moment on in which all contacts are closed (to a tenth of
that); contacts that never close are lost.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import zlib
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from corner_places import shifted_places, turned_places
from joint_errors import one_off
from on_feet import on_feet

from pushplan.bench.random_problems import DRIVES, generate
from pushplan.bench.schema import ProblemParameters
from pushplan.bench.store import Machine
from pushplan.errors import PushplanError
from pushplan.geometry.se2 import compose
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.perturb import with_contact_friction, with_floor_friction, with_leaning_load
from pushplan.planner import plan
from pushplan.plans.plan import Plan
from pushplan.scenario.file import example_names, example_text, scenario_from_document
from pushplan.sim.physics.engine import engine
from pushplan.sim.physics.simulate import simulate_in_physics
from pushplan.slip.world import World as There
from pushplan.util.arrays import FloatArray

Document = dict[str, Any]

SETTINGS: dict[str, Document] = {
    "old": {
        "stability": {"margin": 0.0},
        "pusher": {"limits": {"contact": "quasi-static"}},
        "trajectory": "exact",
        "planner": {"cost": "travel", "arc_price": "2 mm"},
    },
    "margin": {"stability": {"margin": 0.05}, "pusher": {"limits": {"contact": "dynamic"}}},
    "plain": {},
    "uncertainty": {"uncertainty": {"contact_friction": "20 %", "floor_friction": "20 %", "load": "10 %"}},
}
"""What is merged into every scenario: sections of a scenario file."""
FIRST = "old"
"""What ways and times are compared with."""
PARAMETERS = ProblemParameters(objects=(1, 4), obstacles=(0, 10), room=0.8, drives=DRIVES)
POSITION, ANGLE = 2e-3, np.radians(0.5)
"""How far an object may end off the plan in the world as stated, m and rad."""
ASIDE, TURN = 1e-3, np.radians(0.5)
OF_TOLERANCE = 0.9
LEFT, RIGHT, FRONT, BACK = (0.0, 1.0), (0.0, -1.0), (1.0, 0.0), (-1.0, 0.0)


@dataclass(frozen=True, eq=False)
class World:
    """World of the engine: a chain, and pose errors of its objects (n, 3), or None."""

    chain: Chain
    placed: FloatArray | None = None


def perturbed(name: str, chain: Chain) -> dict[str, World]:
    """Return the nominal world and those with errors; object and sign follow from the name."""
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    low, high, aside, askew = rng.integers(0, len(chain.objects), 4)
    sides = rng.choice([-1.0, 1.0], 2)
    return {
        "as stated": World(chain),
        "contact x0.9": World(with_contact_friction(chain, 0.9)),
        "floor x0.8": World(with_floor_friction(chain, 0.8, low)),
        "floor x1.2": World(with_floor_friction(chain, 1.2, high)),
        "load left": World(with_leaning_load(chain, LEFT, 0.1)),
        "load right": World(with_leaning_load(chain, RIGHT, 0.1)),
        "load front": World(with_leaning_load(chain, FRONT, 0.1)),
        "1 mm off": World(chain, shifted_places(chain, aside, sides[0] * ASIDE)),
        "0.5 deg off": World(chain, turned_places(chain, askew, sides[1] * TURN)),
    }


def within(robustness: Any, chain: Chain) -> dict[str, World]:
    """Return worlds with errors of 0.9 of a plan's robustness in one number each."""
    share = OF_TOLERANCE
    worlds = {
        "contact friction": World(with_contact_friction(chain, 1.0 - share * (1.0 - robustness.contact_friction)))
    }
    for i in range(len(chain.objects)):
        for sign in (1.0, -1.0):
            told = f"{i}{sign:+.0f}"
            floor = with_floor_friction(chain, 1.0 + sign * share * robustness.floor_friction, i)
            worlds[f"floor friction {told}"] = World(floor)
            worlds[f"position {told}"] = World(chain, shifted_places(chain, i, sign * share * robustness.position))
            worlds[f"angle {told}"] = World(one_off(chain, i, angle=sign * share * robustness.angle).applied(chain))
        for direction in (LEFT, RIGHT, FRONT, BACK):
            leaned = with_leaning_load(chain, direction, share * robustness.load, i)
            worlds[f"load {i} {direction}"] = World(leaned)
    return worlds


def execute(world: World, plan: Plan) -> Document:
    began = time.process_time()
    there = replace(There.from_scenario(plan.scenario), chain=world.chain)
    if world.placed is not None:
        poses = compose(compose(there.start, world.placed), world.chain.places)
        there = there.with_object_poses(poses)
    try:
        report = simulate_in_physics(plan, there, until_moved=True)
    except PushplanError as error:
        return {"kept": False, "error": str(error), "cpu": time.process_time() - began}
    position, angle = report.object_errors.max(axis=0).tolist()
    return {
        "kept": report.kept,
        "displacement": float(report.displacement.max()),
        "position": position,
        "angle": angle,
        "cpu": time.process_time() - began,
    }


def attempt(name: str, document: Document, setting: str, tolerance: bool) -> Document:
    """Plan a problem with a setting and execute the plan in all worlds."""
    told: Document = {"problem": name, "setting": setting, "tolerance": tolerance}
    try:
        chain = scenario_from_document(document).chain
        result = plan(scenario_from_document(merged(document, SETTINGS[setting])))
        if not result.solved or result.path is None or result.trajectory is None:
            return {**told, "reason": result.reason}
    except PushplanError as error:
        return {**told, "reason": str(error)}
    worlds = within(result.robustness, chain) if tolerance else perturbed(name, chain)
    return {
        **told,
        "objects": len(chain.objects),
        "way": result.path.cost,
        "arcs": len(result.path.lengths),
        "duration": result.trajectory.duration,
        "worlds": {what: execute(world, result) for what, world in worlds.items()},
    }


def merged(document: Mapping[str, Any], added: Mapping[str, Any]) -> Document:
    """Return a document with the values of another added or replaced."""
    result = dict(document)
    for key, value in added.items():
        old = result.get(key)
        result[key] = merged(old, value) if isinstance(old, Mapping) and isinstance(value, Mapping) else value
    return result


def problems(scenarios: Sequence[str], count: int) -> Iterator[tuple[str, Document]]:
    """Yield names and documents of packaged scenarios and of random problems that the setting `old` solves."""
    for name in scenarios:
        yield name, on_feet(yaml.safe_load(example_text(name)))
    seed = found = 0
    while found < count:
        document = _random(seed)
        if document is not None:
            found += 1
            print(f"random {seed} has a path, {found} of {count}", file=sys.stderr, flush=True)
            yield f"random {seed}", document
        seed += 1


def _random(seed: int) -> Document | None:
    try:
        document = on_feet(yaml.safe_load(generate(PARAMETERS, seed)))
        solved = plan(scenario_from_document(merged(document, SETTINGS[FIRST])), first=True).solved
    except PushplanError:
        return None
    return document if solved else None


def run_all(arguments: argparse.Namespace) -> list[Document]:
    """Run the attempts without a result in the file; return all requested results."""
    path: Path = arguments.out
    wanted = [
        (name, document, setting, arguments.tolerance)
        for name, document in problems(arguments.scenarios, arguments.problems)
        for setting in arguments.settings
    ]
    known = {_key(line): line for line in map(json.loads, path.read_text().splitlines())} if path.exists() else {}
    open_ = [task for task in wanted if (task[0], task[2], task[3]) not in known]
    began = time.perf_counter()
    with ProcessPoolExecutor(arguments.jobs, get_context("spawn")) as pool, path.open("a") as file:
        running = [pool.submit(attempt, *task) for task in open_]
        for done, future in enumerate(as_completed(running), 1):
            result = future.result()
            known[_key(result)] = result
            file.write(json.dumps(result) + "\n")
            file.flush()
            spent = time.perf_counter() - began
            left = spent / done * (len(open_) - done)
            print(
                f"{done}/{len(open_)}, {spent:.0f} s, {left:.0f} s left: {_line(result)}", file=sys.stderr, flush=True
            )
    return [known[task[0], task[2], task[3]] for task in wanted]


def _key(result: Document) -> tuple[str, str, bool]:
    return result["problem"], result["setting"], result["tolerance"]


def _line(result: Document) -> str:
    told = f"{result['problem']}, {result['setting']}"
    if "worlds" not in result:
        return f"{told}: no plan: {result['reason']}"
    lost = [name for name, world in result["worlds"].items() if not world["kept"]]
    return f"{told}: {len(result['worlds'])} worlds, lost in {', '.join(lost) or 'none'}"


def holds(world: Document) -> bool:
    """Return whether a plan held in the nominal world: contacts and final poses."""
    return bool(world["kept"] and world["position"] <= POSITION and world["angle"] <= ANGLE)


def table(results: list[Document], settings: list[str]) -> str:
    """Return the number of plans that held, for every setting and world, as a Markdown table."""
    planned = [result for result in results if "worlds" in result]
    names = list(planned[0]["worlds"])
    heads = ["setting", "planned", *names, "all eight", "arcs", "way", "time"]
    lines = [_row(heads), _row(["---"] * len(heads))]
    first = {result["problem"]: result for result in planned if result["setting"] == FIRST}
    for setting in settings:
        every = [result for result in results if result["setting"] == setting]
        mine = [result for result in every if "worlds" in result]
        kept = [sum(result["worlds"][name]["kept"] for result in mine) for name in names]
        kept[0] = sum(holds(result["worlds"][names[0]]) for result in mine)
        total = 100.0 * sum(kept[1:]) / max(len(mine) * (len(names) - 1), 1)
        lines.append(
            _row(
                [
                    setting,
                    f"{len(mine)} of {len(every)}",
                    *(str(count) for count in kept),
                    f"{total:.1f} %",
                    str(sum(result["arcs"] for result in mine)),
                    _change(mine, first, "way"),
                    _change(mine, first, "duration"),
                ]
            )
        )
    return "\n".join(lines)


def _row(cells: list[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _change(results: list[Document], first: dict[str, Document], key: str) -> str:
    """Return the mean change against the first setting, over the problems that both solve."""
    ratios = [result[key] / first[result["problem"]][key] for result in results if result["problem"] in first]
    return f"{100.0 * (np.mean(ratios) - 1.0):+.1f} %" if ratios else "-"


def verdict(results: list[Document], tolerance: bool) -> int:
    """Print the plans that failed unexpectedly; return the exit code. `old` is for comparison only."""
    failed = []
    for result in results:
        for name, world in result.get("worlds", {}).items():
            if not (world["kept"] if tolerance else name != "as stated" or holds(world)):
                failed.append((result, name, world))
    for result, name, world in failed:
        print(f"FAILED {result['problem']}, {result['setting']}, {name}: {json.dumps(world)}")
    count = sum(len(result.get("worlds", {})) for result in results)
    cpu = sum(world["cpu"] for result in results for world in result.get("worlds", {}).values())
    print(f"{count} executions in {cpu:.0f} s of CPU time, {len(failed)} failures where plans have to hold")
    return 1 if any(result["setting"] != FIRST for result, _, _ in failed) else 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--problems", type=int, default=40, help="number of random problems")
    parser.add_argument("--scenarios", nargs="*", default=example_names(), choices=example_names(), metavar="NAME")
    parser.add_argument("--settings", nargs="+", choices=SETTINGS, metavar="NAME", help=f"of {', '.join(SETTINGS)}")
    parser.add_argument("--tolerance", action="store_true", help="worlds within what the plans say they can bear")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("plans_in_physics.jsonl"), help="raw results, resumed")
    arguments = parser.parse_args()
    if arguments.settings is None:
        arguments.settings = ["plain"] if arguments.tolerance else ["old", "plain", "uncertainty"]
    print(f"{Machine.this().words}, MuJoCo {engine().__version__}")
    results = run_all(arguments)
    if not arguments.tolerance and any("worlds" in result for result in results):
        print(table(results, arguments.settings))
    return verdict(results, arguments.tolerance)


if __name__ == "__main__":
    sys.exit(main())
