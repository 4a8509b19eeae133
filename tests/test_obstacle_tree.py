"""The tree over obstacles finds what looking at every obstacle finds, and looks at few of them."""

import numpy as np
import pytest

from pushplan.core.collision import Scene, separation, sweep_is_free
from pushplan.planners.scene import scene_of
from pushplan.util.arrays import FloatArray

SQUARE = 0.5 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
BODY = [np.array([0.3, 0.2]) * SQUARE, np.array([0.3, 0.0]) + 0.2 * SQUARE]
WALLS = np.array([0.0, 0.0, 20.0, 20.0])


def _world(rng: np.random.Generator, count: int) -> tuple[list[FloatArray], FloatArray]:
    """Quadrangles and discs of very different sizes, a long wall among them."""
    n = count // 2
    places, sizes = rng.uniform(0.0, 20.0, (count, 2)), rng.uniform(0.05, 0.3, (count, 2))
    polygons = [SQUARE * size + place for size, place in zip(sizes[:n], places[:n], strict=True)]
    polygons[0] = SQUARE * [0.05, 12.0] + 10.0
    return polygons, np.column_stack([places[n:], 0.5 * sizes[n:, 0]])


def _both(polygons: list[FloatArray], circles: FloatArray) -> tuple[Scene, Scene]:
    """Return the scene with its tree, and with all obstacles in one leaf."""
    scene = scene_of(BODY, polygons, circles, WALLS, 5e-4)
    return scene, scene.with_obstacles(scene.obstacles, scene.circles, _one_leaf(scene), WALLS)


def _one_leaf(scene: Scene) -> FloatArray:
    return np.array([[*scene.tree[0, :4], 1, 0, len(scene.obstacles.bounds), 0, len(scene.circles)]])


@pytest.mark.parametrize("count", [2, 9, 40, 1000])
def test_the_tree_changes_no_answer(count: int) -> None:
    rng = np.random.default_rng(count)
    scene, brute = _both(*_world(rng, count))
    free = blocked = 0
    for _ in range(3000):
        x, y, theta = rng.uniform(0.3, 19.7, 3)
        ours, theirs = (float(separation(world, x, y, theta, 1.0)) for world in (scene, brute))
        assert (ours <= 0.0) == (theirs <= 0.0)
        if 0.0 < min(ours, theirs) < 0.01:
            assert ours == pytest.approx(theirs, abs=1e-12)
        vx, vy, omega = rng.normal(size=3)
        sweeps = [sweep_is_free(world, x, y, theta, vx, vy, omega, 0.3) for world in (scene, brute)]
        assert sweeps[0] == sweeps[1]
        free, blocked = free + sweeps[0], blocked + (not sweeps[0])
    assert min(free, blocked) > 20
