"""Mutated scenarios of every kind: each must be refused with a message or planned; every solution must be valid."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import shapely
import yaml
from attacking.measured import Attacks, Row, commanded, measured, wrong
from mutators import mutated_document, places

from pushplan.drawing.scene import Scene
from pushplan.geometry.se2 import compose, pose_errors, transform_points
from pushplan.logging.reader import load_run
from pushplan.logging.recorded import RecordedRun
from pushplan.mechanics.chain import BodyKind
from pushplan.scenario.file import example_names, load_scenario
from pushplan.scenario.parts import CircleObstacle
from pushplan.verification import verify_run

LIMIT = 0.5
"""Time limit of each plan, s."""
OPTIONS = ("--no-page", "--no-code", "--json")

DOCUMENTS = Path(__file__).with_name("documents.yaml")
"""Scenarios with the keys that packaged ones leave out, and a map's file."""


def picture() -> bytes:
    """Return a map of 80 x 60 cells: free, with a wall and an unknown corner."""
    cells = np.full((60, 80), 254, dtype=np.uint8)
    cells[10:20, 30:34], cells[:5, :5] = 0, 205
    return b"P5 80 60 255\n" + cells.tobytes()


def documents() -> dict[str, Any]:
    """Return the documents to mutate, by name."""
    packaged = {name: yaml.safe_load(load_scenario(name).source) for name in example_names()}
    return {**packaged, **yaml.safe_load(DOCUMENTS.read_text())["scenarios"]}


def holders(node: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the dotted keys of a document, without the numbers of list members, and the sections that hold them."""
    if isinstance(node, dict):
        for key, value in node.items():
            yield f"{prefix}{key}", node
            yield from holders(value, f"{prefix}{key}.")
    elif isinstance(node, list):
        for value in node:
            yield from holders(value, prefix)


def attacks(folder: Path, count: int, seed: int) -> Attacks:
    """Yield mutated scenarios: every key of every document in turn, half of them with further mutations."""
    known = documents()
    pairs = sorted({(key, name) for name, document in known.items() for key, _ in holders(document)})
    turns = sorted(pairs, key=lambda pair: ([other for _, other in pairs if other == pair[1]], pair))
    seen: dict[str, list[tuple[str, str]]] = {}
    for key, name in turns:
        seen.setdefault(key, []).append((key, name))
    rounds = [group[k % len(group)] for k in range(count // len(seen) + 1) for group in seen.values()]
    packaged = example_names()
    for k, (key, name) in enumerate(rounds[:count]):
        work = partial(_planned, known[name], name, key, f"{seed}-{k}")
        group = "packaged" if name in packaged else name
        yield f"{seed}-scenario-{k}", partial(measured, work, LIMIT, group=group, place=key)


def _mutated_at(document: Any, key: str, random: Random) -> Any:
    """Return a document with one of the values under a dotted key mutated."""
    copied = json.loads(json.dumps(document))
    last = key.rpartition(".")[2]
    holder = random.choice([holder for dotted, holder in holders(copied) if dotted == key])
    if random.random() < 0.4:
        holder[last] = _scaled(holder[last], random)
        return copied
    inner = mutated_document({last: holder[last]}, random)
    del holder[last]
    holder.update(inner)
    return copied


def _scaled(value: Any, random: Random) -> Any:
    """Return a value with its numbers scaled by up to a factor of 3, sometimes much more."""
    if isinstance(value, dict):
        return {key: _scaled(one, random) for key, one in value.items()}
    if isinstance(value, list):
        return [_scaled(one, random) for one in value]
    if isinstance(value, bool) or not isinstance(value, int | float):
        return value
    return value * 3.0 ** random.uniform(-1.0, 1.0) * random.choice((1.0, 1.0, 1.0, 1.0, -1.0, 1e-3, 1e3))


def _planned(document: Any, name: str, key: str, seed: str, folder: Path) -> Row:
    """Mutate a document and plan it; a row that is wrong holds the mutated document."""
    random = Random(seed)
    made = _mutated_at(document, key, random)
    if random.random() < 0.5:
        made = mutated_document(made, random)
    stated, image = yaml.safe_load(DOCUMENTS.read_text())["map"], bytearray(picture())
    if name == "mapped" and random.random() < 0.5:
        stated = mutated_document(stated, random)
    if name == "mapped" and random.random() < 0.2:
        image[random.randrange(len(image))] ^= 1 << random.randrange(8)
    (folder / "office.yaml").write_text(json.dumps(stated), errors="replace")
    (folder / "office.pgm").write_bytes(image)
    path, log = folder / "attack.yaml", folder / "run.mcap"
    path.write_text(json.dumps(made), errors="replace")
    first = ["--first"] if random.random() < 0.5 else []
    row = _judged(log, *commanded("plan", path, "--time-limit", LIMIT, *OPTIONS, "-o", log, *first))
    return row | ({"document": made} if row["verdict"] == "WRONG" else {})


def _judged(log: Path, code: int, out: str, err: str) -> Row:
    """Return the result of a command: it refuses with words, or its log is verified."""
    if code == 2:
        return {"verdict": "refused"} if json.loads(out)["error"]["message"] else wrong("no message")
    if code not in (0, 3):
        return wrong(f"exit code {code}: {err[-800:]}")
    run = load_run(log, messages=True)
    why = "; ".join(check.text for check in verify_run(run).mismatches) + (wrongly_solved(run) if code == 0 else "")
    return wrong(why) if why else {"verdict": "no plan" if code else "solved"}


def wrongly_solved(run: RecordedRun) -> str:
    """Return what is wrong with an execution that is called a solution: contacts, goals, collisions; empty if none.

    It uses no code of the searches, or of the validation of plans.
    """
    execution, scenario = run.execution, run.scenario
    if execution is None or execution.loss is not None:
        return "solved, and not executed to its end"
    first = 0
    for load in scenario.loads:
        names, goals = list(load.names), scenario.goals.get(load.name)
        ends = execution.objects[-1, first : first + len(names)]
        first += len(names)
        if goals and not any(_reached(goal, ends, load.chain.places, names) for goal in goals):
            return f"solved, and {', '.join(names)} not at the goal"
    return _collision(run)


def _reached(goal: Any, ends: Any, places: Any, names: list[str]) -> bool:
    counted = list(range(len(names))) if goal.of is None else [names.index(goal.of)]
    off = pose_errors(ends[counted], compose(goal.pose_chain, places[counted]))
    return bool((off[:, 0] <= goal.position_tolerance).all() and (off[:, 1] <= goal.angle_tolerance).all())


def _collision(run: RecordedRun) -> str:
    """Return the first collision in 200 poses of an execution; empty if there is none."""
    scenario, execution = run.scenario, run.execution
    assert execution is not None
    obstacles = shapely.STRtree([_obstacle(one) for one in scenario.obstacles])
    limits = None if scenario.workspace is None else shapely.Polygon(scenario.workspace.outline)
    for k in np.unique(np.linspace(0, len(execution.t) - 1, 200).astype(int)):
        objects: dict[str, shapely.Polygon] = {}
        for body in Scene.of(scenario).bodies:
            place, own = execution.poses[k], body.kind is BodyKind.OBJECT
            if own:
                place = execution.objects[k, execution.names.index(body.name)]
            shape = shapely.Polygon(transform_points(place, body.outline)).buffer(-1e-6)
            met = ["an obstacle"] if obstacles.query(shape, predicate="intersects").size else []
            met += [] if limits is None or limits.contains(shape) else ["the limits of the workspace"]
            met += [name for name, other in objects.items() if own and shape.intersects(other)]
            if met:
                return f"solved, and {body.name} meets {met[0]} at {execution.t[k]:.2f} s"
            if own:
                objects[body.name] = shape
    return ""


def _obstacle(obstacle: Any) -> shapely.Geometry:
    if isinstance(obstacle, CircleObstacle):
        return shapely.Point(obstacle.center).buffer(obstacle.radius)
    return shapely.Polygon(obstacle.outline)


def coverage_of(rows: list[Row]) -> str:
    """Return the number of mutated keys, and the keys of the schema that are not among them."""
    schema = json.loads((Path(__file__).parents[2] / "pushplan" / "scenario.schema.json").read_text())
    declared = {str(name) for holder, key in places(schema) if key == "properties" for name in holder[key]}
    mutated = {str(row["place"]) for row in rows}
    missing = sorted(declared - {key.rpartition(".")[2] for key in mutated})
    return f"{len(mutated)} keys mutated; of the schema's {len(declared)} names not: {', '.join(missing) or 'none'}"
