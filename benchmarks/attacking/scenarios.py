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
from attacking.measured import Attack, Row, commanded, measured
from mutators import mutated_document, places

from pushplan.drawing.scene import Scene
from pushplan.geometry.se2 import compose, pose_errors, transform_points
from pushplan.logging.reader import load_run
from pushplan.logging.recorded import RecordedRun
from pushplan.mechanics.chain import BodyKind
from pushplan.scenario.file import example_names, load_scenario
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import CircleObstacle
from pushplan.verification import verify_run

LIMIT = 0.5
"""Time limit of each plan, s."""

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


def keys_of(document: Any, prefix: str = "") -> Iterator[str]:
    """Yield the dotted keys of a document, without the numbers of list members."""
    if isinstance(document, dict):
        for key, value in document.items():
            yield f"{prefix}{key}"
            yield from keys_of(value, f"{prefix}{key}.")
    elif isinstance(document, list):
        for value in document:
            yield from keys_of(value, prefix)


def attacks(count: int, seed: int) -> Iterator[tuple[str, Attack]]:
    """Yield mutated scenarios: every key of every document in turn, half of them with further mutations."""
    known = documents()
    pairs = sorted({(key, name) for name, document in known.items() for key in keys_of(document)})
    turns = sorted(pairs, key=lambda pair: ([other for _, other in pairs if other == pair[1]], pair))
    seen: dict[str, list[tuple[str, str]]] = {}
    for key, name in turns:
        seen.setdefault(key, []).append((key, name))
    rounds = [group[k % len(group)] for k in range(count // len(seen) + 1) for group in seen.values()]
    for k, (key, name) in enumerate(rounds[:count]):
        yield f"{seed}-scenario-{k}", partial(_attack, known[name], name, key, f"{seed}-{k}")


def _attack(document: Any, name: str, key: str, seed: str) -> Row:
    random = Random(seed)
    made = _mutated_at(document, key, random)
    if random.random() < 0.5:
        made = mutated_document(made, random)
    row = measured(partial(_planned, made, name, random), LIMIT)
    return {"group": _kind(name), "place": key, **row} | ({"document": made} if row["verdict"] == "WRONG" else {})


def _kind(name: str) -> str:
    return "packaged" if name in example_names() else name


def _mutated_at(document: Any, key: str, random: Random) -> Any:
    """Return a document with one of the values under a dotted key mutated."""
    copied = json.loads(json.dumps(document))
    last = key.rpartition(".")[2]
    found = [
        holder for dotted, holder in _holders(copied) if dotted == key and isinstance(holder, dict) and last in holder
    ]
    holder = random.choice(found)
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


def _holders(node: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(node, dict):
        for key, value in node.items():
            yield f"{prefix}{key}", node
            yield from _holders(value, f"{prefix}{key}.")
    elif isinstance(node, list):
        for value in node:
            yield from _holders(value, prefix)


def _planned(document: Any, name: str, random: Random, folder: Path) -> Row:
    """Plan a mutated document."""
    told, image = yaml.safe_load(DOCUMENTS.read_text())["map"], bytearray(picture())
    if name == "mapped" and random.random() < 0.5:
        told = mutated_document(told, random)
    if name == "mapped" and random.random() < 0.2:
        image[random.randrange(len(image))] ^= 1 << random.randrange(8)
    (folder / "office.yaml").write_text(json.dumps(told), errors="replace")
    (folder / "office.pgm").write_bytes(image)
    path = folder / "attack.yaml"
    path.write_text(json.dumps(document), errors="replace")
    log = folder / "run.mcap"
    first = ["--first"] if random.random() < 0.5 else []
    words = ["plan", str(path), "--time-limit", str(LIMIT), "--no-page", "--no-code", "--json", "-o", str(log)]
    code, out, err = commanded([*words, *first])
    if code == 2:
        message = json.loads(out)["error"]["message"]
        return {"verdict": "refused" if message else "WRONG", "why": "" if message else "no message"}
    if code not in (0, 3):
        return {"verdict": "WRONG", "why": f"exit code {code}: {err[-800:]}"}
    run = load_run(log, messages=True)
    report = verify_run(run)
    why = "; ".join(check.text for check in report.mismatches)
    if code == 0:
        why += wrongly_solved(run)
    return {"verdict": "WRONG" if why else "solved" if code == 0 else "no plan", "why": why}


def wrongly_solved(run: RecordedRun) -> str:
    """Return what is wrong with an execution that is called a solution: contacts, goals, collisions; empty if none.

    No code of the searches, or of the validation of plans, is used.
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
    scenario, execution = run.scenario, run.execution
    assert execution is not None
    obstacles = shapely.STRtree([_obstacle(one) for one in scenario.obstacles])
    limits = _limits(scenario)
    for k in np.unique(np.linspace(0, len(execution.t) - 1, 200).astype(int)):
        objects = []
        for body in Scene.of(scenario).bodies:
            place = execution.poses[k]
            if body.kind is BodyKind.OBJECT:
                place = execution.objects[k, execution.names.index(body.name)]
            shape = shapely.Polygon(transform_points(place, body.outline)).buffer(-1e-6)
            if obstacles.query(shape, predicate="intersects").size:
                return f"solved, and {body.name} meets an obstacle at {execution.t[k]:.2f} s"
            if limits is not None and not limits.contains(shape):
                return f"solved, and {body.name} leaves the workspace at {execution.t[k]:.2f} s"
            if body.kind is BodyKind.OBJECT:
                objects.append((body.name, shape))
        for i, (name, shape) in enumerate(objects):
            for other, beside in objects[:i]:
                if shape.intersects(beside):
                    return f"solved, and {name} overlaps {other} at {execution.t[k]:.2f} s"
    return ""


def _obstacle(obstacle: Any) -> shapely.Geometry:
    if isinstance(obstacle, CircleObstacle):
        return shapely.Point(obstacle.center).buffer(obstacle.radius)
    return shapely.Polygon(obstacle.outline)


def _limits(scenario: Scenario) -> shapely.Geometry | None:
    return None if scenario.workspace is None else shapely.Polygon(scenario.workspace.outline)


def told(rows: list[Row]) -> str:
    """Return the number of mutated keys, and the keys of the schema that are not among them."""
    schema = json.loads((Path(__file__).parents[2] / "pushplan" / "scenario.schema.json").read_text())
    declared = {str(name) for holder, key in places(schema) if key == "properties" for name in holder[key]}
    mutated = {str(row["place"]) for row in rows}
    missing = sorted(declared - {key.rpartition(".")[2] for key in mutated})
    return f"{len(mutated)} keys mutated; of the schema's {len(declared)} names not: {', '.join(missing) or 'none'}"
