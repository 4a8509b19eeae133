"""Random chains and trees of objects."""

from __future__ import annotations

import numpy as np

from pushplan.geometry.se2 import compose, transform_points
from pushplan.mechanics.chain import Chain, Contact, PushedObject, Pusher
from pushplan.mechanics.support import FeetSupport, Support, UniformSupport
from pushplan.util.arrays import FloatArray

PLATE = np.array([[-0.03, -0.08], [0.0, -0.08], [0.0, 0.08], [-0.03, 0.08]])


def random_chain(rng: np.random.Generator) -> Chain:
    """Return one to four quadrilaterals, each with its rear edge somewhere on the front edge of its predecessor."""
    objects: list[PushedObject] = []
    contacts: list[Contact] = []
    line, half = np.zeros(3), 0.08
    for i in range(int(rng.integers(1, 5))):
        outline, lean = random_outline(rng)
        rear = float(outline[3, 1])
        offset = float(rng.uniform(-0.6, 0.6)) * min(rear, half)
        pose = compose(line, np.array([0.0, offset, 0.0]))
        ends = transform_points(line, [[0.0, max(-half, offset - rear)], [0.0, min(half, offset + rear)]])
        contacts.append(Contact(ends[0], ends[1], float(rng.uniform(0.1, 0.8)), i, i - 1))
        mass, floor_friction = float(rng.uniform(0.3, 3.0)), float(rng.uniform(0.1, 0.7))
        objects.append(PushedObject(f"object{i}", outline, mass, floor_friction, random_support(rng, outline), pose))
        line = compose(pose, np.append(outline[1:3].mean(axis=0), lean))
        half = 0.5 * float(np.linalg.norm(outline[2] - outline[1]))
    return Chain(tuple(objects), tuple(contacts), Pusher(PLATE, contacts[0].friction))


def random_outline(rng: np.random.Generator) -> tuple[FloatArray, float]:
    """Return a quadrilateral (4, 2) with its rear edge on x = 0, and the angle of its front edge's normal, rad."""
    rear, front = rng.uniform(0.03, 0.06, 2)
    depth, shift, lean = rng.uniform(0.04, 0.1), rng.uniform(-0.02, 0.02), rng.uniform(-0.3, 0.3)
    y = shift + np.array([-front, front])
    x = depth - np.tan(lean) * y
    return np.array([[0.0, -rear], [x[0], y[0]], [x[1], y[1]], [0.0, rear]]), float(lean)


def random_support(rng: np.random.Generator, outline: FloatArray) -> Support:
    """Return even pressure, or three to six feet with random loads."""
    if rng.random() < 0.5:
        return UniformSupport(outline)
    count = int(rng.integers(3, 7))
    positions = rng.dirichlet(np.ones(4), count) @ outline
    return FeetSupport(positions, rng.dirichlet(np.full(count, 3.0)))


def random_tree(rng: np.random.Generator) -> Chain:
    """Return a wide box with two stacks on it, of one and of one or two boxes, all on four feet."""
    friction = rng.uniform(0.1, 0.5, 4)
    depth = rng.uniform(0.05, 0.1, 4)
    left, right = rng.uniform(0.025, 0.055, 2)
    y, width, pushers = [0.0, left + 0.005, -right], [0.16, 2.0 * left, 2.0 * right - 0.01], [-1, 0, 0]
    rear = [0.0, depth[0], depth[0]]
    if rng.random() < 0.5:
        y, width, pushers = [*y, y[1]], [*width, width[1]], [*pushers, 1]
        rear.append(depth[0] + depth[1])
    objects, contacts = [], []
    for i, pusher in enumerate(pushers):
        mass, corners = float(rng.uniform(0.3, 3.0)), np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        outline = corners * [0.5 * depth[i], 0.5 * width[i]]
        support = FeetSupport(0.9 * outline, np.full(4, 0.25))
        pose = np.array([rear[i] + depth[i] / 2, y[i], 0.0])
        objects.append(PushedObject(f"object{i}", outline, mass, 0.3, support, pose))
        ends = np.array([[pose[0] - depth[i] / 2, y[i] + side * width[i] / 2] for side in (-1.0, 1.0)])
        contacts.append(Contact(ends[0], ends[1], float(friction[i]), i, pusher))
    return Chain(tuple(objects), tuple(contacts), Pusher(PLATE, contacts[0].friction))
