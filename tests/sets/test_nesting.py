"""Sets with less knowledge lie inside those with more, for every pressure."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import ChainMaker, there
from scipy.optimize import linprog

from pushplan.errors import SupportError
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.heights import load_areas
from pushplan.mechanics.sphere import twists_at
from pushplan.mechanics.support import FeetSupport, Support
from pushplan.sets.named import stable_set
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray


def near_boundary(stable: StableSet, rng: np.random.Generator, count: int) -> FloatArray:
    """Return twists (2 count, 3): some within 0.001 rad of the boundary, some in any forward direction."""
    found = stable.meridians(count=64)
    length = stable.chain.characteristic_length
    forward: FloatArray = rng.normal(size=(count, 3)) * [0.3, 0.3, 0.5 / length] + np.array([1.0, 0.0, 0.0])
    if len(found) == 0:
        return forward
    lon, lat = np.tile(found.longitude, 2), np.concatenate([found.lower, found.upper])
    pick = rng.integers(len(lon), size=count)
    near = twists_at(lon[pick], lat[pick] + rng.choice([-1e-3, 0.0, 1e-3], size=count), length)
    return np.asarray(np.concatenate([near, forward]), dtype=np.float64)


def on_few_points(support: Support, rng: np.random.Generator) -> FeetSupport:
    """Return a mixture of extreme pressures with a support's centre: basic solutions with at most three points
    each.
    """
    hull = support.hull
    points = np.concatenate([hull, rng.dirichlet(np.full(len(hull), 0.3), size=24) @ hull])  # most near its edges
    equations, fractions = np.vstack([points.T, np.ones(len(points))]), np.zeros(len(points))
    for share in rng.dirichlet(np.ones(int(rng.integers(1, 4)))):
        cost = rng.normal(size=len(points))
        solution = linprog(cost, A_eq=equations, b_eq=[*support.center, 1.0], method="highs")
        fractions += share * np.maximum(there(solution.x), 0.0)
    kept = fractions > 1e-9
    return FeetSupport(points[kept], fractions[kept] / fractions[kept].sum())


def nested(chain: Chain, seed: int, rounds: int = 2) -> tuple[int, int]:
    """Check the nesting on random twists; return the number of twists in `robust` and of tested loads."""
    robust, stable, rng = (stable_set(chain, "robust"), stable_set(chain, "stable"), np.random.default_rng(seed))
    twists = np.concatenate([near_boundary(each, rng, 40) for each in (robust, stable)])
    margins, tried = robust.margin(twists), 0
    assert not (stable.contains(twists) & (margins <= 0.0)).any()
    for k in range(1 + rounds):
        objects = (replace(obj, support=on_few_points(obj.support, rng)) for obj in chain.objects)
        try:
            loaded = replace(chain, objects=tuple(objects)) if k else chain
            exact = stable_set(loaded, "ecof").margin(twists)
        except SupportError:
            continue  # the affine shift would need tension at some of these points
        tried += 1
        assert not ((margins > 0.0) & (exact < margins - 1e-9)).any()
    return int((margins > 0.0).sum()), tried


@pytest.mark.parametrize("n", [1, 2, 4, 6])
def test_stable_is_inside_robust_is_inside_ecof(make_chain: ChainMaker, n: int) -> None:
    """For random polygons, and pressures on few points with the same centres, which are the worst ones."""
    chains = [make_chain.random(seed + 10 * n, n, tree=seed == 1) for seed in range(2)]
    found = [nested(chain, seed, rounds=4) for seed, chain in enumerate(chains)]
    assert sum(inside for inside, _ in found) > 0
    assert all(tried == 5 for _, tried in found)


@pytest.mark.parametrize("n", [1, 2, 3])
def test_nesting_holds_for_pushes_above_the_floor(make_chain: ChainMaker, n: int) -> None:
    """The load shifts with the friction force: in `ecof` as an affine pressure, in the other sets arbitrarily."""
    chains = {seed: raised(make_chain.random(seed, n), 0.05 + 0.05 * seed) for seed in range(0, 12, 3)}
    found = [nested(chain, seed) for seed, chain in chains.items()]
    inside, tried = np.sum(found, axis=0)
    assert inside > 0
    assert tried > 1


def raised(chain: Chain, part: float) -> Chain:
    """Return the chain pushed at a height that uses `part` of the possible load shift."""
    low = replace(chain.pusher, contact_height=0.0)
    heights = []
    for obj, area in zip(chain.objects, load_areas(replace(chain, pusher=low)), strict=True):
        step = np.roll(area.points, -1, axis=0) - area.points
        normal = np.stack([step[:, 1], -step[:, 0]], axis=1) / np.linalg.norm(step, axis=1, keepdims=True)
        heights.append(((area.points - area.center) * normal).sum(axis=1).min() / obj.floor_friction)
    return replace(chain, pusher=replace(chain.pusher, contact_height=part * min(heights)))


@pytest.mark.parametrize("name", ["cof", "translation", "stable", "robust"])
def test_all_sets_agree_on_translations(make_chain: ChainMaker, name: str) -> None:
    """Without rotation only the centres count; margins equal those of `ecof`, except for the measure of `stable`."""
    angle = np.linspace(-np.pi, np.pi, 400)
    twists = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    found = 0
    for seed in range(8):
        chain = make_chain.random(seed, 1 + seed % 4, tree=seed > 5, feet=seed % 2 == 1)
        exact, other = stable_set(chain, "ecof"), stable_set(chain, name)
        assert (exact.contains(twists) == other.contains(twists)).all()
        if name != "stable":
            np.testing.assert_allclose(other.margin(twists), exact.margin(twists), atol=2e-9)
        cone = exact.translation_cone()
        again = other.translation_cone()
        assert (cone is None) == (again is None)
        if cone is not None and again is not None:
            found += 1
            np.testing.assert_allclose(again, cone, atol=1e-8)
    assert found > 3
