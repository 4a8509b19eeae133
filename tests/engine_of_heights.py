"""Pushes above the floor in MuJoCo with six degrees of freedom: does every contact of a plan hold?

A plan that knows frictions and load to 20 % is carried out at full speed in worlds that differ by so much. The model
shares no code with the package: free boxes on 36 feet each that only push, so that they lift where they lift, and on
every contact two small spheres at its height, which carry vertical friction, too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

import pushplan
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.builders import box, build_scenario, plate
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray

FLOOR, PLATE, BETWEEN, SHARE = 0.3, 0.5, 0.4, 0.2
"""Coefficients of friction, and the share by which these and loads are off."""

GOALS = ([0.5, 0.35, 1.2], [0.8, -0.3, -0.5])
FEET, FOOT = 6, 0.002
"""Feet along a side, and radius of a sphere, m."""

SOFT, SPRING, DAMPER, DRAG = 1e-3, 8000.0, 50.0, 0.1
"""Impedance of the feet, their stiffness and damping, and the damping of their friction. The engine's convex friction
lifts a foot that slides on a hard floor, and it hops. So the floor is soft, but stiff against sliding (`impratio`):
the cube sinks in by 0.04 mm."""

HEAVY = 1e6
"""Mass of the plate, kg, which no contact moves."""

LIMITS = np.array([1.0, 0.5, 0.3, 2.0])
"""How far a contact that holds may slide and open (mm), turn and tilt (deg) in an engine of soft contacts."""


@dataclass(frozen=True)
class Case:
    """What is pushed, and whether the plan knows the heights, and that its numbers are uncertain.

    Attributes:
        name: Of the boxes.
        side: Of their square base, m.
        top: Their height, m.
        heights: Least and largest height of every contact, m.
        knowing: See above.
    """

    name: str
    side: float
    top: float
    heights: tuple[tuple[float, float], ...]
    knowing: bool = True

    def scenario(self, goal: list[float]) -> Scenario:
        """Return the problem of reaching a goal."""
        names = ["near", "far"][: len(self.heights)]
        objects = [box(name, self.side, self.side, 1.0) for name in names]
        pairs = [["pusher", "near"], names]
        more: dict[str, Any] = {"contacts": {"friction": BETWEEN}, "stability": {"margin": 0.01}}
        if self.knowing:
            objects = [{**one, "height": self.top} for one in objects]
            between = [{"objects": pairs[k], "height": list(span)} for k, span in enumerate(self.heights)]
            shares = dict.fromkeys(("contact_friction", "floor_friction", "load"), SHARE)
            more = {"contacts": {"friction": BETWEEN, "between": between}, "uncertainty": shares}
        area = {"x": [-1.0, 2.0], "y": [-1.5, 1.5]}
        pusher = plate(0.2, PLATE)
        return build_scenario(self.name, objects, pusher, goal, floor_friction=FLOOR, workspace=area, **more)


@dataclass(frozen=True)
class World:
    """What a scenario leaves open: frictions, heights of contacts (n,) and where masses are off (n, 2), m."""

    floor: float
    contact: float
    heights: FloatArray
    off: FloatArray

    @classmethod
    def drawn(cls, case: Case, rng: np.random.Generator) -> World:
        """Return a world, every other one at ends of the intervals; a load off by 20 % moves by side / 20."""
        n, spans = len(case.heights), np.array(case.heights)
        one = rng.uniform(-1.0, 1.0, 2 + 3 * n)
        one = np.sign(one) if rng.random() < 0.5 else one
        heights = spans.mean(axis=1) + 0.5 * one[2 : 2 + n] * np.ptp(spans, axis=1)
        off = 0.25 * SHARE * case.side * one[2 + n :].reshape(n, 2)
        return cls(FLOOR * (1.0 + SHARE * one[0]), 1.0 + SHARE * one[1], heights, off)


def model_of(case: Case, world: World, dt: float) -> Any:
    """Return the engine's model: every pair that may touch is stated, and nothing else touches."""
    spec = mujoco.MjSpec()
    option = spec.option
    option.timestep, option.cone, option.impratio = dt, mujoco.mjtCone.mjCONE_ELLIPTIC, 1e4
    option.iterations, option.ls_iterations, option.tolerance = 100, 200, 1e-16 / HEAVY
    sphere, block = mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_BOX
    standing = {"solref": [-SPRING, -DAMPER], "solreffriction": [-1e-9, -DRAG], "solimp": [SOFT, SOFT, 1e-3, 0.5, 2]}
    touching = {"solref": [2.5 * dt, 1.0], "solimp": [0.99, 0.99, 1e-3, 0.5, 2]}

    def geom(body: Any, name: str, kind: Any, size: list[float], at: list[float]) -> None:
        body.add_geom(name=name, type=kind, size=size, pos=at, contype=0, conaffinity=0, mass=0.0)

    def pair(one: str, other: str, friction: float, settings: dict[str, list[float]]) -> None:
        both = [friction, friction, 0.0, 0.0, 0.0]
        spec.add_pair(geomname1=one, geomname2=other, condim=3, friction=both, **settings)

    geom(spec.worldbody, "floor", mujoco.mjtGeom.mjGEOM_PLANE, [0.0, 0.0, 1.0], [0.0, 0.0, 0.0])
    pushing = spec.worldbody.add_body(name="plate")
    for joint, axis in (("x", [1, 0, 0]), ("y", [0, 1, 0])):
        pushing.add_joint(name=joint, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    pushing.add_joint(name="turn", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1])
    pushing.mass, pushing.inertia, pushing.explicitinertial = HEAVY, [HEAVY] * 3, 1
    half, front = 0.5 * case.side, 0.0
    places = (np.arange(FEET) + 0.5) * case.side / FEET - half
    tall = (case.side**2 + case.top**2) / 12.0
    for k, height in enumerate(world.heights):
        body = spec.worldbody.add_body(name=f"box{k}", pos=[(k + 0.5) * case.side, 0.0, 0.0])
        body.add_freejoint()
        body.mass, body.inertia, body.explicitinertial = 1.0, [tall, tall, case.side**2 / 6.0], 1
        body.ipos = [*world.off[k], 0.5 * case.top]
        geom(body, f"box{k}", block, [half, half, 0.5 * case.top], [0.0, 0.0, 0.5 * case.top])
        for i, (x, y) in enumerate((x, y) for x in places for y in places):
            geom(body, f"foot{k}-{i}", sphere, [FOOT, 0.0, 0.0], [x, y, FOOT])
            pair(f"foot{k}-{i}", "floor", world.floor, standing)
        for side in (-1, 1):
            at = [front - FOOT, side * (half - FOOT), max(float(height), FOOT)]
            geom(pushing, f"touch{k}{side}", sphere, [FOOT, 0.0, 0.0], at)
            pair(f"touch{k}{side}", f"box{k}", world.contact * (BETWEEN if k else PLATE), touching)
        pushing, front = body, half
    return spec.compile()


def carried_out(case: Case, world: World, motion: Trajectory, dt: float = 1e-3) -> FloatArray:
    """Return the most (4,) that contacts slid and opened (mm), turned, and that boxes tilted (deg) in a world."""
    model = model_of(case, world, dt)
    data = mujoco.MjData(model)
    settle = int(0.2 / dt)
    t = np.maximum(np.arange(settle + int(motion.duration / dt)) - settle, 0) * dt
    poses = motion.poses_at(t)
    poses[:, 2] = np.unwrap(poses[:, 2])
    speeds = np.gradient(poses, dt, axis=0)
    looks = []
    for i in range(len(t)):
        data.qpos[:3], data.qvel[:3] = poses[i], speeds[i]
        mujoco.mj_step(model, data)
        if i >= settle and i % 20 == 0:
            looks.append([_seen(data, k) for k in range(len(case.heights))])
    seen = np.array(looks)
    if not np.isfinite(seen).all():
        raise RuntimeError("the engine lost its balance")
    away = np.abs(seen[..., :3] - seen[0, :, :3]).max(axis=(0, 1))
    return np.array([1e3 * away[1], 1e3 * away[0], np.degrees(away[2]), np.degrees(seen[..., 3].max())])


def _seen(data: Any, k: int) -> list[float]:
    """Return x, y and heading of a box in the frame of what pushes it, and its tilt, rad."""
    own, pushing = data.body(f"box{k}"), data.body(f"box{k - 1}" if k else "plate")
    turned, base = own.xmat.reshape(3, 3), pushing.xmat.reshape(3, 3)
    x, y, _ = base.T @ (own.xpos - pushing.xpos)
    across = base.T @ turned
    tilt = np.arccos(np.clip(turned[2, 2], -1.0, 1.0))
    return [float(x), float(y), float(np.arctan2(across[1, 0], across[0, 0])), float(tilt)]


def tried(case: Case, worlds: int, seed: int) -> tuple[int, int, str]:
    """Return how many runs held, of how many, and the most that was seen; or 0 of 0 and why nothing is planned."""
    rng = np.random.default_rng(seed)
    found = []
    for goal in GOALS:
        try:
            plan = pushplan.plan(case.scenario(goal), seed=seed, time_limit=20.0, iterations=300)
        except pushplan.PushplanError as refused:
            return 0, 0, str(refused)
        if plan.trajectory is None:
            return 0, 0, f"no plan: {plan.reason}"
        found += [carried_out(case, World.drawn(case, rng), plan.trajectory) for _ in range(worlds)]
    slid, opened, turned, tilted = np.max(found, axis=0)
    text = f"slid {slid:.2f} mm, opened {opened:.2f} mm, turned {turned:.2f} deg, tilted {tilted:.2f} deg at most"
    return sum(bool((most <= LIMITS).all()) for most in found), len(found), text
