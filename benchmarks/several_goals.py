"""Goals that one push reaches badly or not at all: pushes, ways and time, for three drives.

    python benchmarks/several_goals.py [--seconds 1] [--seeds 3] [--only WORD] [--bare]

A cube of 15 cm (or a row of three) and a robot of 0.42 x 0.285 m, axle 0.30 m behind its plate, turning radius of the
car 1.008 m. Changes and the robot's own ways weigh little, for it is the way pushed that counts here: travel of the
cube's middle, m. Printed for each goal and drive: seconds to the first plan, its way, and the way and the number of
pushes after `--seconds` (medians over seeds), beside the figures that were wanted, and a way that no plan beats: a
load that turns goes as far as its tightest turn takes it, whatever the contacts.

The figures that were wanted are those of a prototype whose frictions, margin and axle were not stated. With `--bare`
contacts keep next to no margin, a push settles over a millimetre, boxes rub more on one another and the axle of two
driven wheels is 0.14 m behind the plate: then the first plans have the prototype's lengths.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pushplan.geometry import se2
from pushplan.planners.multi.room import PushRoom, Question
from pushplan.planners.multi.search import Limits, Sequence, search
from pushplan.scenario.file import scenario_from_document
from pushplan.scenario.model import Scenario
from pushplan.several.plan import backed_off, free_goals
from pushplan.several.prepared import Prepared
from pushplan.several.reasons import reasons
from pushplan.several.warm import warm_up_several
from pushplan.util.arrays import FloatArray

SIDE, AXLE, RADIUS = 0.15, 0.30, 1.008
LIGHT = {"switch_cost": 0.02, "transit_weight": 0.01}
DRIVE: dict[str, Any] = {
    "car": {"car": {"axle": [-AXLE, 0.0, 0.0], "min_radius": RADIUS}},
    "differential": {"differential": {"axle": [-AXLE, 0.0, 0.0]}},
    "omnidirectional": "omnidirectional",
}
WORDS = tuple(DRIVE)


@dataclass(frozen=True)
class Case:
    """A goal and the ways that were wanted, by drive; None where there was none."""

    name: str
    changes: dict[str, Any]
    boxes: int = 1
    wanted: tuple[float | None, ...] = (None, None, None)


BARE: dict[str, Any] = {
    "stability": {"margin": 0.002},
    "pushes": {**LIGHT, "settle": 1e-3},
    "contacts": {"friction": 0.5},
}
BARE_DIFFERENTIAL = {"differential": {"axle": [-0.14, 0.0, 0.0]}}
ROOM = {"x": [-3.0, 5.0], "y": [-3.0, 5.0]}
CASES = (
    Case(
        "5 cm sideways, front and rear only",
        {"goal": {"pose": [1.0, 1.05, 0.0]}, "pusher": {"faces": ["front", "rear"]}},
        wanted=(0.27, 0.58, 0.12),
    ),
    Case(
        "quarter turn on the spot", {"goal": {"pose": [1.075, 0.925, 0.5 * np.pi]}}, wanted=(1.85, 0.75, 0.23)
    ),
    Case(
        "into a corner, 1 cm from both walls",
        {
            "goal": {"pose": [2.84, 2.915, 0.0]},
            "pusher": {"offsets": [0.0, 0.065, -0.065]},
            "workspace": {"x": [-3.0, 3.0], "y": [-3.0, 3.0]},
        },
    ),
    Case(
        "1.5 cm from a wall, to be pushed away",
        {
            "start": [1.0, 2.91, 0.0],
            "goal": {"pose": [1.0, 2.0, 0.0]},
            "pusher": {"offsets": [0.0, 0.065, -0.065]},
            "workspace": {"x": [-3.0, 5.0], "y": [-3.0, 3.0]},
        },
    ),
    Case(
        "out of a corner",
        {
            "start": [2.84, 2.915, 0.0],
            "goal": {"pose": [1.0, 2.0, 0.0]},
            "pusher": {"offsets": [0.0, 0.065, -0.065]},
            "workspace": {"x": [-3.0, 3.0], "y": [-3.0, 3.0]},
        },
    ),
    Case(
        "along a corridor of 0.5 m",
        {
            "robot": {"start": [0.0, 1.0, 0.0]},
            "goal": {"pose": [3.0, 1.03, 0.0]},
            "workspace": {"x": [-1.5, 4.5], "y": [0.75, 1.25]},
        },
    ),
    Case("row of three: 10 cm sideways", {"goal": {"pose": [1.0, 1.1, 0.0]}}, 3, (0.40, None, None)),
    Case("row of three: half a turn", {"goal": {"pose": [1.45, 1.0, np.pi]}}, 3, (6.2, None, None)),
)


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--seconds", type=float, default=1.0)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--only", default="")
    parser.add_argument("--bare", action="store_true")
    args = parser.parse_args()
    warm_up_several(print, "ecof", intervals=False)
    for case in CASES:
        if args.only not in case.name:
            continue
        print(case.name)
        for drive, wanted in zip(WORDS, case.wanted, strict=True):
            _report(problem(case, drive, args.bare), drive, wanted, args.seconds, args.seeds)


def problem(case: Case, drive: str, bare: bool = False) -> Scenario:
    """Return the scenario of a case."""
    moved = BARE_DIFFERENTIAL if bare and drive == "differential" else DRIVE[drive]
    objects = [{"name": f"b{k}", "shape": {"box": [SIDE, SIDE]}, "mass": 1.0} for k in range(case.boxes)]
    document: dict[str, Any] = {
        "format": "pushplan/1",
        "name": "several-goals",
        "floor": {"friction": 0.3},
        "contacts": {"friction": 0.3},
        "objects": objects,
        "pusher": {"width": 0.285, "friction": 0.5, "thickness": 0.02},
        "robot": {
            "footprint": {"box": [0.42, 0.285], "pose": [-0.21, 0.0, 0.0]},
            "drive": moved,
            "start": [0.0, 1.0, 0.0],
        },
        "start": [1.0, 1.0, 0.0],
        "pushes": LIGHT,
        "workspace": ROOM,
    }
    for section, value in [*case.changes.items(), *(BARE.items() if bare else ())]:
        known = document.get(section)
        document[section] = {**known, **value} if isinstance(known, dict) else value
    return scenario_from_document(document)


def _report(scenario: Scenario, drive: str, wanted: float | None, seconds: float, seeds: int) -> None:
    prepared = Prepared.of(scenario)
    first = list(_searched(prepared, seeds, Limits(time.perf_counter() + 1e9, first=True), seconds * 4.0))
    best = list(_searched(prepared, seeds, Limits(0.0), seconds))
    found = [way for way in best if isinstance(way[0], Sequence)]
    if not found:
        print(f"  {drive:16s} none: {best[0][1]}")
        return
    room = prepared.room(0)
    soon = [(way[1], _way(room, way[0])) for way in first if isinstance(way[0], Sequence)]
    ways, pushes = [_way(room, way[0]) for way in found], [len(way[0].steps) for way in found]
    text = f"{len(found)}/{seeds} solved, first after {np.median([s for s, _ in soon]):.3f} s"
    text += (
        f", {np.median([w for _, w in soon]):.2f} m; then {np.median(ways):.3f} m in {np.median(pushes):.0f}"
    )
    text += f" (wanted: {wanted} m)" if wanted else ""
    print(f"  {drive:16s} {text}; no plan is below {_least(room):.3f} m")


def _searched(prepared: Prepared, seeds: int, limits: Limits, seconds: float) -> Iterator[tuple[Any, Any]]:
    """Yield plan and seconds, or None and why, for each seed."""
    scenario = prepared.scenario
    room = prepared.room(0)
    question = Question(backed_off(room, scenario), np.array(scenario.start), free_goals(scenario))
    for seed in range(1, seeds + 1):
        began = time.perf_counter()
        found = search(room, question, replace(limits, until=began + seconds), seed)
        if found.best is None:
            yield None, "; ".join(reason.text for reason in reasons(room, question, found))
        else:
            yield found.best, time.perf_counter() - began


def _way(room: PushRoom, found: Sequence) -> float:
    """How far the middle of the load goes, m."""
    return sum(float(_speeds(room, step.contact, step.arcs[:, :3]) @ step.arcs[:, 3]) for step in found.steps)


def _least(room: PushRoom) -> float:
    """What no plan beats, m: the straight line, and the tightest turns that are driven by the angle to turn."""
    scenario = room.scenario
    assert scenario.pushes is not None
    middle = np.append(_middle(room), 0.0)
    start, goals = (
        se2.compose(poses, middle)
        for poses in (scenario.start, np.array([goal.pose_chain for goal in scenario.pushes.goals]))
    )
    tightest = min(_tightest(room, k) for k in range(len(room.contacts)))
    return min(float(max(np.hypot(*(goal - start)[:2]), tightest * _angle(goal, start))) for goal in goals)


def _angle(goal: FloatArray, start: FloatArray) -> float:
    return float(abs(se2.wrap_angle(goal[2] - start[2])))


def _tightest(room: PushRoom, contact: int) -> float:
    """Way of the load's middle for each radian, m, of the tightest turn by a contact."""
    twists = room.contacts[contact].packed.families.reshape(-1, 3)
    turns = twists[twists[:, 2] != 0.0]
    return float((_speeds(room, contact, turns) / np.abs(turns[:, 2])).min(initial=np.inf))


def _speeds(room: PushRoom, contact: int, twists: FloatArray) -> FloatArray:
    """Speeds (k,) of the load's middle at twists (k, 3) of a contact's frame."""
    x, y, _ = se2.relative(room.contacts[contact].packed.contact, np.append(_middle(room), 0.0))
    vx, vy, omega = twists.T
    return np.asarray(np.hypot(vx - y * omega, vy + x * omega))


def _middle(room: PushRoom) -> FloatArray:
    return np.asarray(np.mean([obj.pose_chain[:2] for obj in room.scenario.chain.objects], axis=0))


if __name__ == "__main__":
    main()
