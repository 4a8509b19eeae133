"""Make the moving picture of the README: `python docs/moving.py`. An obstacle is dragged, and the plan follows."""

from __future__ import annotations

import math
import tempfile
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.patches import Circle
from PIL import Image

import pushplan
from pushplan.drawing.figure import axes_at, figure_for
from pushplan.drawing.floor import draw_scene, set_view, view_of
from pushplan.drawing.palette import INK
from pushplan.drawing.scene import Scene
from pushplan.plans.plan import Plan
from pushplan.scenario.model import CircleObstacle, Scenario

PICTURE = Path(__file__).with_name("moving.webp")
FRAMES, PACE = 40, 100
"""Pictures of one round, and milliseconds that each is seen."""
DRAGGED = -3
"""The obstacle among those of `two-crates`: the disc above the middle."""
FAR = np.array([-0.32, -0.62])
"""How far it is dragged, m, before it is brought back on another path."""
ASIDE = 0.22
"""How far the path bends to either side, m."""
SIDE, PIXELS = 4.6, 640
"""Of the picture, inches and pixels."""


def main() -> None:
    """Plan for every place of the obstacle, draw, and write the picture."""
    scenario = pushplan.load_scenario("two-crates")
    frames = [_drawn(_planned(_dragged(scenario, k / FRAMES))) for k in range(FRAMES)]
    whole = BytesIO()
    frames[0].save(
        whole, "WEBP", save_all=True, append_images=frames[1:], duration=PACE, loop=0, quality=55, method=6
    )
    PICTURE.write_bytes(whole.getvalue())
    print(f"{PICTURE}: {len(whole.getvalue()) / 1e3:.0f} kB")


def _dragged(scenario: Scenario, share: float) -> Scenario:
    """Return the scenario with the obstacle at a share of its round."""
    disc = scenario.obstacles[DRAGGED]
    assert isinstance(disc, CircleObstacle)
    out, aside = 0.5 - 0.5 * math.cos(2.0 * math.pi * share), ASIDE * math.sin(2.0 * math.pi * share)
    across = np.array([-FAR[1], FAR[0]]) / np.hypot(*FAR)
    moved = replace(disc, center=disc.center + out * FAR + aside * across)
    obstacles = list(scenario.obstacles)
    obstacles[DRAGGED] = moved
    return replace(scenario, obstacles=tuple(obstacles))


def _planned(scenario: Scenario) -> Plan:
    """Return the plan of a fixed number of iterations, so that every machine draws the same picture."""
    plan = pushplan.plan(scenario, seed=1, iterations=20_000, time_limit=600.0)
    if not plan.solved:
        raise SystemExit(f"an obstacle is dragged to where there is no plan: {plan.reason}")
    return plan


def _drawn(plan: Plan) -> Image.Image:
    scene = Scene.of(plan.scenario, plan, plan.execution)
    view = view_of(scene.window)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "frame.png"
        with figure_for(path, SIDE, SIDE) as figure:
            floor = axes_at(figure, 0.02, 0.02, SIDE - 0.04, SIDE - 0.04)
            set_view(floor, view)
            draw_scene(floor, scene)
            floor.set(xticks=[], yticks=[], xlabel="", ylabel="")
            disc = plan.scenario.obstacles[DRAGGED]
            assert isinstance(disc, CircleObstacle)
            floor.add_patch(Circle(tuple(disc.center), disc.radius, fill=False, edgecolor=INK, linewidth=2.0))
        with Image.open(path) as image:
            return image.convert("RGB").resize((PIXELS, PIXELS), Image.Resampling.LANCZOS)


if __name__ == "__main__":
    main()
