"""The interface of the compiled core: arguments are checked, and one object serves one thread at a time."""

import math
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ompl import base as ob
from ompl import control as oc

import pushplan
from pushplan.core.collision import sweep_is_free
from pushplan.core.problem import Problem, arcs_at
from pushplan.core.pushes import push_costs
from pushplan.core.search import Lattice, Tree, branch, floor_distances
from pushplan.errors import ExtensionError
from pushplan.ompl import pose

SQUARE = np.array([-0.5, -0.5, 2.0, 2.0])
PLACE = np.zeros(2)


@pytest.fixture(scope="module")
def problem() -> Problem:
    made: Problem = pose(pushplan.load_scenario("two-crates"))[0].session.problem
    return made


def _tree(*parents: float) -> Any:
    nodes = np.zeros((len(parents), 9))
    nodes[:, 4] = parents
    return nodes


def _floor(scene: Any, rows: int, side: float = 0.1) -> object:
    return floor_distances(scene, np.array([0.0, 0.0, side]), 10, rows, 0.05, PLACE)


def _extended(problem: Problem, row: int, bound: float = 9.0, back: bool = True) -> object:
    tree, other = Tree(problem, np.zeros(3), 0.3), Tree(problem, problem.goal, 0.3, back)
    return tree.extend(row, (0.0, 0.0, 0.0), (0.5, 0.5, 0.5), bound, other)


def _swept(scene: Any, first: float, length: float = 0.1) -> object:
    return sweep_is_free(scene, np.array([first, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]), length)


@pytest.mark.parametrize(
    "call",
    [
        lambda p: arcs_at(p, np.array([[-2.0, 0.0, 0.0, 1.0]])),
        lambda p: arcs_at(p, np.array([[1e7, 0.0, 0.0, 1.0]])),
        lambda p: arcs_at(p, np.array([[math.nan, 0.0, 0.0, 1.0]])),
        lambda p: push_costs([p.scene], [(p.scene,)], np.zeros(3), np.zeros((1, 3)), np.ones((1, 1), dtype=bool)),  # type: ignore[list-item]
        lambda p: branch(_tree(-1, 7), 1),
        lambda p: branch(_tree(-1, 2, 1), 1),
        lambda p: branch(_tree(-1), 1),
        lambda p: Tree(p, PLACE, 0.3),
        lambda p: Tree(p, np.zeros(3), -1.0),
        lambda p: _extended(p, 1),
        lambda p: _extended(p, 0, math.nan),
        lambda p: _extended(p, 0, back=False),
        lambda p: _floor(p.scene, 2**62),
        lambda p: _floor(p.scene, -1),
        lambda p: _floor(p.scene, 10, -0.1),
        lambda p: _swept(p.scene, math.nan),
        lambda p: _swept(p.scene, 0.0, -0.1),
        lambda p: _swept(p.scene, 0.0, math.inf),
    ],
)  # fmt: skip
def test_invalid_numbers_indices_and_sizes_are_refused(problem: Problem, call: Any) -> None:
    with pytest.raises((ValueError, IndexError, TypeError)):
        call(problem)


def test_mutated_calls_raise_or_return() -> None:
    command = [sys.executable, str(Path(__file__).with_name("core_calls.py")), "--count", "400"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-3000:]


def _asked_again_and_again(lattice: Lattice) -> None:
    while True:  # until it is in use; between two calls it is free
        _ = lattice.nodes


def test_an_object_in_use_refuses_other_threads(problem: Problem) -> None:
    scene, start = problem.scene, np.zeros(3)
    grid = np.array([-0.5, -0.5, 0.05])
    lattice = Lattice(problem, start, PLACE, grid, floor_distances(scene, grid, 50, 50, 0.05, problem.goal[:2]))
    working, refused = threading.Event(), threading.Event()

    def work() -> None:
        while not refused.is_set():
            lattice.plant(SQUARE, 0.02, 0.1, 0.03, 1 << 15)
            working.set()
            lattice.expand(np.array([1], dtype=np.uint64), math.inf, 20_000)

    thread = threading.Thread(target=work)
    thread.start()
    try:
        working.wait()
        with pytest.raises(RuntimeError, match="another thread"):
            _asked_again_and_again(lattice)
    finally:
        refused.set()
        thread.join()
    assert len(lattice.nodes) > 1


@pytest.mark.parametrize("room", [0, -4, 12, 1 << 23])
def test_the_room_of_a_search_is_a_power_of_two_up_to_a_limit(problem: Problem, room: int) -> None:
    grid = np.array([-0.5, -0.5, 0.05])
    away = floor_distances(problem.scene, grid, 50, 50, 0.05, problem.goal[:2])
    lattice = Lattice(problem, np.zeros(3), PLACE, grid, away)
    with pytest.raises(ValueError, match=f"power of two up to 2\\^22, not {room}"):
        lattice.plant(SQUARE, 0.02, 0.1, 0.03, room)


@pytest.mark.parametrize("bound", [1.0, 10.0, 1e7])
def test_a_control_out_of_bounds_is_an_error_of_the_planner(bound: float) -> None:
    def make(information: Any) -> Any:
        bounds = ob.RealVectorBounds(3)
        bounds.setLow(-bound)
        bounds.setHigh(bound)
        information.getControlSpace().setBounds(bounds)
        return oc.RRT(information)

    with pytest.raises(ExtensionError, match=r"the planner \S*make fails: ValueError: a control is -"):
        pushplan.plan(pushplan.load_scenario("two-crates"), planner=make, time_limit=1.0, seed=2)
