"""Calls of the compiled core with arguments that have gone wrong: errors, and never the end of the process.

Run `python tests/core_calls.py [--count 10000] [--seed 1] [--verbose]`; `.ci/sanitize` does so with a core that looks
at every access. Whatever the core offers is called as plans of every kind call it, then with up to three of its
arguments changed: numbers that are not finite, negative or huge, indices out of range, arrays of other shapes, kinds
and layouts, objects of other types. A call may return or raise. What else happens ends the process; --verbose names
each call before it is made.
"""

from __future__ import annotations

import argparse
import copy
import faulthandler
import importlib
import math
import pickle
import pkgutil
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from random import Random
from types import ModuleType
from typing import Any

import numpy as np
from kinds import MULTI, ROW, SWAP, WALL

import pushplan
import pushplan.ompl
from pushplan import core
from pushplan.scenario.file import example_text

REFUSED = (ValueError, TypeError, IndexError, OverflowError, MemoryError, RuntimeError, AttributeError)
"""Errors that a call can raise."""

FLOATS = (math.nan, math.inf, -math.inf, 0.0, -1.0, 1e-308, 1e99, -1e99, 1e308, -1e308, 2.0**63)
WHOLE = (-1, 0, 1, 2, -(2**31), -(2**63), 2**63 - 1, 2**62, 2**40, 2**32 + 1, 2**64)
OTHERS: tuple[Any, ...] = (
    None,
    "word",
    (),
    [],
    {},
    object(),
    (1,),
    np.zeros(0),
    np.zeros((2, 3)),
    np.array(["a"]),
    1 + 2j,
)
MOST = 12
"""Calls of each function that are kept unchanged."""

HANGS = 600.0
"""Time limit of a call, s."""

Call = tuple[tuple[Any, ...], dict[str, Any]]


def workloads(loaded: Callable[[], Any]) -> None:
    """Do what between them calls nearly all of the core; `loaded` returns arguments of `uncertain.margins_of`."""
    scenario = pushplan.load_scenario("two-crates")
    for one in (scenario, *map(pushplan.scenario_from_text, (MULTI, ROW, SWAP, WALL))):
        plan = pushplan.plan(one, seed=1, iterations=500, first=one is not scenario, time_limit=600.0)
        if plan.solved:
            plan.metrics()
            pushplan.simulate(plan, pushplan.World.from_scenario(one), step=5e-3)
            pushplan.trial(plan, samples=1, seed=1, jobs=1)
    pushplan.plan(scenario, planner="ompl.control:RRT", seed=1, iterations=300, time_limit=600.0)
    pushplan.plan(scenario, cost="time", seed=1, iterations=300, time_limit=600.0)
    for name in ("three-boxes-clutter", "narrow-gap", "feet"):
        pushplan.plan(pushplan.load_scenario(name), seed=1, iterations=2_000, time_limit=600.0)
    pushplan.plan(pushplan.scenario_from_text(MULTI), seed=1, iterations=30, time_limit=600.0)
    uncertain = (
        example_text("two-crates") + "uncertainty: {contact_friction: 20 %, floor_friction: 20 %, load: 10 %}\n"
    )
    pushplan.plan(pushplan.scenario_from_text(uncertain), seed=1, iterations=100, time_limit=600.0)
    pushplan.stable_set(scenario.chain, "robust").cor_region(+1, (-1.0, -1.0, 1.0, 1.0))
    planner = pushplan.Planner(scenario, time_limit=600.0, iterations=300)
    planner.reach([scenario.start], [scenario.goal.pose])
    planner.with_obstacles(scenario.obstacles).plan(first=True)
    # Functions that only tests or rare plans call directly.
    core.driving.find_reeds_shepp(0.3, -0.2, 1.0)
    core.driving.find_drives(
        core.driving.Wheels(core.driving.WheelKind.CAR, np.zeros(3), 0.4), np.zeros(3), np.ones(3)
    )
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    core.collision.join_triangles(square, np.array([0, 1, 2, 0, 2, 3]), np.array([-1, -1, 3, 2, -1, -1]))
    shapes = core.collision.flatten(square, np.array([0, 4]))
    core.collision.Shapes(shapes.corners, shapes.starts, shapes.bounds)
    problem, state = pushplan.ompl.pose(scenario)[0].session.problem, np.array([1], dtype=np.uint64)
    grid, goal = np.array([-0.5, -0.5, 0.05]), problem.goal
    away = core.search.floor_distances(problem.scene, grid, 50, 50, 0.05, goal[:2])
    lattice = core.search.Lattice(problem, scenario.start, np.zeros(2), grid, away)
    lattice.plant(np.array([-0.5, -0.5, 2.0, 2.0]), 0.1, 0.3, 0.15, 1 << 12)
    lattice.expand(state, math.inf, 300)
    path = np.array([[*problem.families[0, 1], 0.3]])
    core.improve.vary(problem, scenario.start, path, state)
    problem.with_goal(goal), problem.with_segments(problem.segments)
    tree, other = core.search.Tree(problem, scenario.start, 0.3), core.search.Tree(problem, goal, 0.3, back=True)
    tree.connect(0, (0.1, 0.0, 0.0), math.inf, other)
    tree.take(problem)
    loads, twists, _ = loaded()
    for function in (core.uncertain.rows_of, core.uncertain.sloped_rows_of, core.uncertain.forces_of):
        with suppress(ValueError):  # for some loads only the centre is known
            function(loads, twists)


class Recorder:
    """Keeps the arguments of calls of the core.

    Attributes:
        calls: By name; of methods the object comes first.
        functions: What is called, by name.
    """

    def __init__(self) -> None:
        self.calls: dict[str, list[Call]] = {}
        self.functions: dict[str, Callable[..., Any]] = {}
        self._seen: Counter[str] = Counter()
        self._random = Random(0)

    def recorded(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function that does the same, and keeps what it is called with."""
        self.functions[name] = function

        def record(*args: Any, **kwargs: Any) -> Any:
            self._seen[name] += 1
            kept = self.calls.setdefault(name, [])
            place = len(kept) if len(kept) < MOST else self._random.randrange(self._seen[name])
            if place < MOST:
                kept[place : place + 1] = [(copied(args), copied(kwargs))]
            return function(*args, **kwargs)

        return record

    @contextmanager
    def everywhere(self) -> Iterator[None]:
        """Record all calls of the core, whatever module has imported its functions."""
        modules = [module for name, module in sys.modules.items() if name.startswith("pushplan.")]
        undone: list[tuple[Any, str, Any]] = []

        def put(owner: Any, name: str, value: Any) -> None:
            undone.append((owner, name, owner.__dict__[name]))
            setattr(owner, name, value)

        for part in vars(core).values():
            for name, value in list(vars(part).items()) if isinstance(part, ModuleType) else ():
                full = f"{part.__name__.rpartition('.')[2]}.{name}"
                made_here = isinstance(value, type) and "nb_type" in type(value).__name__
                for method, found in list(vars(value).items()) if made_here else ():
                    if callable(found) and not method.startswith("__"):
                        put(value, method, self.recorded(f"{full}.{method}", found))
                if made_here or (callable(value) and not isinstance(value, type)):
                    known = self.recorded(full + ".__init__" * made_here, value)
                    put(part, name, known)
                    for module in modules:
                        for alias, found in list(vars(module).items()):
                            if found is value:
                                put(module, alias, known)
        try:
            yield
        finally:
            for owner, name, value in reversed(undone):
                setattr(owner, name, value)


def copied(value: Any) -> Any:
    """Return arguments that the call, or another one, does not change."""
    if isinstance(value, np.ndarray):
        return value.copy()
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return type(value)(*map(copied, value))
    if isinstance(value, list | tuple):
        return type(value)(map(copied, value))
    if isinstance(value, dict):
        return {key: copied(one) for key, one in value.items()}
    return value


def changed(value: Any, random: Random, pool: list[Any]) -> Any:
    """Return an argument that has gone wrong."""
    if random.random() < 0.1:
        return random.choice(OTHERS)
    if isinstance(value, bool):
        return random.choice((not value, 2, None))
    if isinstance(value, int):
        return random.choice((*WHOLE, value + 1, value - 1, -value))
    if isinstance(value, float):
        return random.choice((*FLOATS, -value, math.nextafter(value, math.inf)))
    if isinstance(value, np.ndarray):
        return changed_array(value, random)
    if isinstance(value, list | tuple) and value:
        items, place = list(value), random.randrange(len(value))
        if random.random() < 0.25:
            return type(items)(items[:-1]) if random.random() < 0.5 else (*items, items[0])
        items[place] = changed(items[place], random, pool)
        return items if isinstance(value, list) else tuple(items)
    return random.choice(pool) if random.random() < 0.5 else random.choice(OTHERS)


def changed_array(array: Any, random: Random) -> Any:
    """Return an array with other numbers, or of another shape, kind or layout."""
    kind, array = random.random(), array.copy()
    if kind < 0.6 and array.size:
        whole = np.issubdtype(array.dtype, np.integer)
        for _ in range(random.choice((1, 1, 2, array.size))):
            place = np.unravel_index(random.randrange(array.size), array.shape)
            if whole:
                value = random.choice((*WHOLE[:-1], int(array[place]) + 1, int(array[place]) - 1, array.size))
                array[place] = np.array(value % 2**64, np.uint64).astype(array.dtype)
            elif array.dtype == bool:
                array[place] = not array[place]
            else:
                array[place] = random.choice((*FLOATS, -array[place]))
        return array
    ways: tuple[Callable[[Any], Any], ...] = (
        lambda a: a[:-1] if a.ndim else a,
        lambda a: a[:0] if a.ndim else a,
        lambda a: np.concatenate([a, a]) if a.ndim else a,
        lambda a: a[..., :-1] if a.ndim else a,
        lambda a: a[None],
        lambda a: a.ravel(),
        lambda a: np.asfortranarray(a.T),
        lambda a: np.repeat(a, 2, axis=-1)[..., ::2] if a.ndim else a,
        lambda a: a.astype(np.float32),
        lambda a: a.astype(object),
        lambda a: a.astype(np.int64) if np.isfinite(a).all() else a,
        lambda a: np.frombuffer(a.tobytes(), a.dtype).reshape(a.shape),
        lambda a: a.tolist(),
    )
    with np.errstate(all="ignore"):
        return random.choice(ways)(array)


def main() -> int:
    """Call what there is again and again; print how often that was refused, and how often there was an answer."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--verbose", action="store_true", help="name each call before it is made")
    options = parser.parse_args()
    for found in pkgutil.walk_packages(pushplan.__path__, "pushplan."):
        if not any(part in found.name for part in ("cli", "bench", "view", "__main__", "conf")):
            importlib.import_module(found.name)
    recorder = Recorder()
    with recorder.everywhere():
        workloads(lambda: recorder.calls["uncertain.margins_of"][0][0])
    names, ended = sorted(recorder.calls), Counter[str]()
    pool = [value for calls in recorder.calls.values() for args, _ in calls for value in args]
    print(f"{len(names)} functions; never called: {sorted(set(recorder.functions) - set(names))}", flush=True)
    for k in range(options.count):
        random = Random(f"{options.seed} {k}")
        name = names[k % len(names)]
        args, kwargs = copied(random.choice(recorder.calls[name]))
        places = [(args := list(args), i) for i in range(len(args))] + [(kwargs, key) for key in kwargs]
        method = not name.endswith("__init__") and "." in name.partition(".")[2]
        if method:  # in its initial state: many change, some permanently
            args[0] = fresh(args[0])
        for holder, key in random.sample(places[method:], min(random.choice((1, 1, 2, 3)), len(places) - method)):
            holder[key] = changed(holder[key], random, pool)
        if options.verbose:
            print(k, name, flush=True)
        faulthandler.dump_traceback_later(HANGS, exit=True)
        try:
            with np.errstate(all="ignore"):
                recorder.functions[name](*args, **kwargs)
            ended["answered"] += 1
        except REFUSED as error:
            ended["refused" if str(error).strip() else f"{name}: an error without words"] += 1
    faulthandler.cancel_dump_traceback_later()
    print(f"{options.count} calls: {', '.join(f'{count} {end}' for end, count in sorted(ended.items()))}")
    return int(set(ended) != {"answered", "refused"})


def fresh(value: Any) -> Any:
    """Return a copy of an object where it can be pickled, else itself."""
    try:
        return pickle.loads(pickle.dumps(value))
    except TypeError:
        return copy.copy(value) if hasattr(value, "__copy__") else value


if __name__ == "__main__":
    sys.exit(main())
