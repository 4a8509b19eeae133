"""How fast the stable sets are: margins, whole boundaries and Algorithm 1 on a grid, in one run.

Three boxes of 0.1 m with uniform support, and three star-shaped polygons of 7 corners; the table prints times and
their ratio to `ecof` on the same chain. Run it with `python benchmarks/sets.py`; the first run compiles.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

import numpy as np

from pushplan.mechanics.chain import Chain, Contact, PushedObject, Pusher
from pushplan.mechanics.interval_chain import IntervalChain
from pushplan.mechanics.support import FeetSupport, Support, UniformSupport
from pushplan.stable_sets.grid_cor_set import grid_cor_set
from pushplan.stable_sets.interval_set import stable_set_over
from pushplan.stable_sets.named import stable_set
from pushplan.stable_sets.stable_set import StableSet

SIDE = 0.1
TWISTS = 2000
SENSES = (+1, -1)


def row_of(outline: np.ndarray, support: Support, n: int = 3) -> Chain:
    """Return n equal objects of length 0.1 m in a row."""
    plate = np.array([[-0.03, -0.1], [0.0, -0.1], [0.0, 0.1], [-0.03, 0.1]])
    objects, contacts = [], []
    for i in range(n):
        pose = np.array([(i + 0.5) * SIDE, 0.0, 0.0])
        objects.append(PushedObject(f"object{i}", outline, 1.0, 0.3, support, pose))
        right, left = np.array([i * SIDE, -0.5 * SIDE]), np.array([i * SIDE, 0.5 * SIDE])
        contacts.append(Contact(right, left, 0.4, i, i - 1))
    return Chain(tuple(objects), tuple(contacts), Pusher(plate, 0.4))


def chains() -> dict[str, Chain]:
    box = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * SIDE / 2.0
    angle = 2.0 * np.pi * (np.arange(7) + 0.2 * np.sin(np.arange(7.0))) / 7.0
    radius = SIDE * (0.4 + 0.12 * np.cos(3.0 * angle))
    star = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    return {
        "3 boxes": row_of(box, UniformSupport(box)),
        "3 polygons": row_of(star, UniformSupport(star)),
        "3 on feet": row_of(box, FeetSupport(box, np.full(4, 0.25))),
        "12 boxes": row_of(box, UniformSupport(box), 12),
    }


def seconds(task: Callable[[], object], repeats: int = 3) -> float:
    """Return the shortest of a few runs."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        task()
        times.append(time.perf_counter() - begin)
    return min(times)


def whole(make: Callable[[], StableSet]) -> Callable[[], object]:
    """Return the task of finding everything about a set that is not at hand yet."""

    def task() -> object:
        stable = make()
        return stable.meridians(), [stable.cor_region(sense) for sense in SENSES], stable.turning_radii()

    return task


def makers(chain: Chain) -> dict[str, Callable[[], StableSet]]:
    interval = IntervalChain.from_ranges(chain, mass={obj.name: (0.8, 1.2) for obj in chain.objects})
    sets: dict[str, Callable[[], StableSet]] = {
        name: partial(stable_set, chain, name) for name in ("ecof", "cof", "translation", "stable", "robust")
    }
    for name in ("ecof", "robust"):
        sets[f"{name}, masses +-20 %"] = partial(stable_set_over, interval, name)
    return sets


def main() -> None:
    rng = np.random.default_rng(0)
    print(f"{'chain':<12}{'set':<24}{'margin, us':>12}{'ratio':>8}{'whole set, ms':>16}{'ratio':>8}")
    for title, chain in chains().items():
        twists = rng.normal(size=(TWISTS, 3)) * [0.3, 0.3, 0.3 / chain.characteristic_length] + [
            1.0,
            0.0,
            0.0,
        ]
        base: tuple[float, float] | None = None
        for name, make in makers(chain).items():
            stable = make()
            stable.margin(twists[:2])
            one = seconds(partial(stable.margin, twists)) / TWISTS
            everything = seconds(whole(make))
            base = base or (one, everything)
            print(
                f"{title:<12}{name:<24}{one * 1e6:>12.2f}{one / base[0]:>8.1f}"
                f"{everything * 1e3:>16.1f}{everything / base[1]:>8.1f}"
            )
    chain = chains()["3 boxes"]
    half = 4.0 * chain.characteristic_length
    grid = seconds(lambda: grid_cor_set(chain, (-half, -half, half, half), (100, 100), 1000), repeats=1)
    print(f"Algorithm 1 on 100 x 100 CORs with 1000 elements an object, NumPy: {grid:.2f} s, both senses")


if __name__ == "__main__":
    main()
