"""How fast and how exact the stable sets are, in one run: boundaries against Algorithm 1 on a grid, margins, growth.

Three boxes of 0.1 m stand in a row, on even pressure; the rest is said in what is printed. Run it with
`python benchmarks/mechanics.py [--cells 600]`: some two minutes of CPU; compiled code is compiled before it is timed.
Exits 1 when a promise is not kept.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
import shapely

from pushplan.bench.processes.machine import Machine
from pushplan.compiled import compiled
from pushplan.mechanics.chain import Chain, Contact, PushedObject, Pusher
from pushplan.mechanics.contacts.contact_kernel import margin
from pushplan.mechanics.friction.packed import PackedChain
from pushplan.mechanics.sphere import twists_about
from pushplan.mechanics.support import UniformSupport
from pushplan.mechanics.worst_case.interval_chain import IntervalChain
from pushplan.sets.grid_cor_set import grid_cor_set
from pushplan.sets.interval_set import stable_set_over
from pushplan.sets.named import stable_set
from pushplan.util.arrays import BoolArray, FloatArray

SIDE = 0.1
SENSES = (+1, -1)
CELLS, ELEMENTS = 600, 1000
SIZES = (1, 2, 3, 6, 12, 25, 50)
EDGES = (4, 8, 16, 32, 64, 128, 256)


class Promise(NamedTuple):
    """A figure that was promised."""

    what: str
    value: float
    limit: float
    unit: str

    @property
    def kept(self) -> bool:
        return self.value < self.limit


def outline_with(edges: int) -> FloatArray:
    """A square (4 edges) or a regular polygon of 0.1 m."""
    angle = 2.0 * np.pi * (np.arange(edges) + 0.5) / edges
    return SIDE / 2.0 / np.cos(np.pi / edges) * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def star() -> FloatArray:
    """A polygon of seven corners that is not convex."""
    angle = 2.0 * np.pi * (np.arange(7) + 0.2 * np.sin(np.arange(7.0))) / 7.0
    radius = SIDE * (0.4 + 0.12 * np.cos(3.0 * angle))
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def row_of(n: int, outline: FloatArray) -> Chain:
    """n equal objects of length 0.1 m in a row, contacts 0.1 m wide."""
    plate = np.array([[-0.03, -0.1], [0.0, -0.1], [0.0, 0.1], [-0.03, 0.1]])
    objects, contacts = [], []
    for i in range(n):
        pose = np.array([(i + 0.5) * SIDE, 0.0, 0.0])
        objects.append(PushedObject(f"object{i}", outline, 1.0, 0.3, UniformSupport(outline), pose))
        right, left = np.array([i * SIDE, -0.5 * SIDE]), np.array([i * SIDE, 0.5 * SIDE])
        contacts.append(Contact(right, left, 0.4, i, i - 1))
    return Chain(tuple(objects), tuple(contacts), Pusher(plate, 0.4))


def seconds(task: Callable[[], object], repeats: int = 7) -> float:
    """The least CPU time of a few runs, after one that is not counted; other work on the machine does not count."""
    task()
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        task()
        times.append(time.process_time() - begin)
    return min(times)


def regions(chain: Chain, name: str, window: tuple[float, float, float, float]) -> list[shapely.Geometry]:
    """The stable CORs of both senses, from nothing but the chain."""
    stable = stable_set(chain, name)
    return [stable.cor_region(sense, window) for sense in SENSES]


def truth(chain: Chain, points: FloatArray) -> list[BoolArray]:
    """Whether points (k, 2) are stable CORs, by the exact margin at each: no boundary is involved."""
    stable = stable_set(chain)
    return [stable.contains(twists_about(points, sense)) for sense in SENSES]


def wrong_share(found: list[BoolArray], exact: list[BoolArray]) -> float:
    """The share of points that are judged wrongly."""
    return float(np.mean([a != b for a, b in zip(found, exact, strict=True)]))


def compare_with_grid(cells: int) -> list[Promise]:
    """Time and error of the exact boundary and of Algorithm 1, on the same window."""
    chain = row_of(3, outline_with(4))
    half = 4.0 * chain.characteristic_length
    window = (-half, -half, half, half)
    exact = seconds(partial(regions, chain, "ecof", window), 30)
    begin = time.process_time()
    grid = grid_cor_set(chain, window, (cells, cells), ELEMENTS)
    taken = time.process_time() - begin
    points = np.random.default_rng(0).uniform(-half, half, size=(2_000_000, 2))
    right = truth(chain, points)
    shapes = regions(chain, "ecof", window)
    by_region = [shapely.contains_xy(shape, points[:, 0], points[:, 1]) for shape in shapes]
    j, i = (((points[:, d] + half) / (2.0 * half) * cells).astype(int) for d in (1, 0))
    by_grid = [table[j, i] for table in (grid.counter_clockwise, grid.clockwise)]
    errors = wrong_share(by_region, right), wrong_share(by_grid, right)
    corners = np.concatenate([shapely.get_coordinates(shape.boundary) for shape in shapes])
    print(f"exact boundary of three boxes, both senses, {len(corners)} vertices: {1e3 * exact:.2f} ms")
    print(
        f"  from the chain alone: searched for, found and joined to polygons; {errors[0]:.1e} of CORs wrong"
    )
    print(f"Algorithm 1, {cells} x {cells} CORs, {ELEMENTS} elements an object, NumPy: {taken:.2f} s")
    print(f"  {errors[1]:.1e} of CORs wrong")
    print(
        f"  ratio of times {taken / exact:.0f}, of errors {errors[1] / max(errors[0], 0.5 / points.size):.0f}"
    )
    return [
        Promise("exact boundary of three boxes", 1e3 * exact, 10.0, "ms"),
        Promise("its time over that of the grid", exact / taken, 1e-3, ""),
        Promise("its error over that of the grid", errors[0] / errors[1], 1.0, ""),
    ]


@compiled
def sum_of_margins(packed: PackedChain, twists: FloatArray) -> float:
    """Ask for margins one by one, as a planner does in compiled code."""
    total = 0.0
    for i in range(len(twists)):
        total += margin(packed, twists[i, 0], twists[i, 1], twists[i, 2])
    return total


def margin_seconds(chain: Chain) -> float:
    """Time of one margin in compiled code, at twists around a push straight ahead."""
    spread = np.array([0.3, 0.3, 0.3 / chain.characteristic_length])
    twists = np.random.default_rng(0).normal(size=(20_000, 3)) * spread + [1.0, 0.0, 0.0]
    packed = stable_set(chain).packed  # type: ignore[attr-defined]
    return seconds(partial(sum_of_margins, packed, twists)) / len(twists)


def whole(chain: Chain, name: str) -> Callable[[], object]:
    """The task of finding regions, translation cone and radii."""

    def task() -> object:
        stable = stable_set(chain, name)
        return (
            [stable.cor_region(sense) for sense in SENSES],
            stable.translation_cone(),
            stable.turning_radii(),
        )

    return task


def single_figures() -> list[Promise]:
    boxes, polygons, many = row_of(3, outline_with(4)), row_of(3, star()), row_of(50, outline_with(4))
    one = 1e6 * margin_seconds(boxes)
    robust, long = seconds(whole(polygons, "robust"), 3), seconds(whole(many, "ecof"), 3)
    worst = seconds(whole(many, "robust"), 1)
    print(f"one margin of three boxes in compiled code: {one:.3f} us")
    print(f"robust, three polygons of seven corners: regions, cone and radii in {robust:.3f} s")
    print(f"50 boxes: ecof {long:.3f} s, robust {worst:.2f} s")
    return [
        Promise("one margin of three objects", one, 1.0, "us"),
        Promise("robust for three polygons", robust, 2.0, "s"),
        Promise("ecof of 50 boxes", long, 1.0, "s"),
    ]


def table_of_sets() -> None:
    """Print what every set costs on the same chains."""
    print(f"\n{'chain':<14}{'set':<22}{'a margin, us':>14}{'regions, cone, radii, ms':>28}{'ratio':>8}")
    for title, chain in {"3 boxes": row_of(3, outline_with(4)), "3 polygons": row_of(3, star())}.items():
        twists = np.random.default_rng(0).normal(size=(2000, 3)) * [0.3, 0.3, 1.0] + [1.0, 0.0, 0.0]
        base = 0.0
        for name in ("ecof", "cof", "translation", "stable", "robust"):
            one = seconds(partial(stable_set(chain, name).margin, twists)) / len(twists)
            everything = seconds(whole(chain, name), 3)
            base = base or everything
            print(
                f"{title:<14}{name:<22}{1e6 * one:>14.2f}{1e3 * everything:>28.1f}{everything / base:>8.1f}"
            )
        masses = IntervalChain.from_ranges(chain, mass={obj.name: (0.8, 1.2) for obj in chain.objects})
        one = seconds(partial(stable_set_over(masses).margin, twists)) / len(twists)
        everything = seconds(lambda found=masses: stable_set_over(found).turning_radii(), 1)  # type: ignore[misc]
        print(f"{title:<14}{'ecof, masses +-20 %':<22}{1e6 * one:>14.2f}{1e3 * everything:>28.1f}")


def growth() -> list[Promise]:
    """Print how a margin's cost grows, and return the exponents; 1 is linear."""
    by_size = [margin_seconds(row_of(n, outline_with(4))) for n in SIZES]
    by_edges = [margin_seconds(row_of(3, outline_with(edges))) for edges in EDGES]
    exponents = []
    for what, numbers, times in (("objects", SIZES, by_size), ("edges each", EDGES, by_edges)):
        print(f"\n{what:<12}" + "".join(f"{n:>9}" for n in numbers))
        print(f"{'margin, us':<12}" + "".join(f"{1e6 * t:>9.3f}" for t in times))
        exponents.append(float(np.polyfit(np.log(numbers), np.log(times), 1)[0]))
        slope, offset = np.polyfit(numbers, times, 1)
        off = float(np.abs(np.polyval([slope, offset], numbers) - times).max() / max(times))
        print(
            f"grows with the power {exponents[-1]:.2f}; {1e6 * offset:.3f} us + {1e9 * slope:.1f} ns for each, "
            f"to {100.0 * off:.1f} % of the largest"
        )
    return [
        Promise("growth with the number of objects, exponent", exponents[0], 1.1, ""),
        Promise("growth with the number of edges, exponent", exponents[1], 1.1, ""),
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, default=CELLS, help="of the grid, along either axis")
    arguments = parser.parse_args()
    print(Machine.this().words)
    promises = compare_with_grid(arguments.cells) + single_figures() + growth()
    table_of_sets()
    print()
    for promise in promises:
        word = "kept" if promise.kept else "NOT kept"
        print(
            f"{promise.what}: {promise.value:.3g} {promise.unit} (promised: below {promise.limit:g}) {word}"
        )
    return 0 if all(promise.kept for promise in promises) else 1


if __name__ == "__main__":
    sys.exit(main())
