"""Make the moving pictures of README and docs: `python docs/moving.py`, or one of them by its name.

`moving.webp`: an obstacle is dragged, and the plan follows. `pencils.webp`: twelve pencils are swept to a wall.
"""

from __future__ import annotations

import math
import sys
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
from pushplan.logging.film import HEIGHT, WIDTH, Film
from pushplan.plans.plan import Plan
from pushplan.plans.run import Run
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import CircleObstacle

DOCS = Path(__file__).parent
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
FILMED = 80
"""Pictures of the film of the pencils, the last of which is seen for longer."""
REST = 1500
"""For which it is seen, ms."""


def main() -> None:
    """Make the pictures that are asked for; without names both."""
    for name in sys.argv[1:] or MOVING:
        frames, durations = MOVING[name]()
        whole = BytesIO()
        frames[0].save(
            whole, "WEBP", save_all=True, append_images=frames[1:], duration=durations, loop=0, quality=55, method=6
        )
        (DOCS / name).write_bytes(whole.getvalue())
        print(f"{DOCS / name}: {len(whole.getvalue()) / 1e3:.0f} kB")


def _dragged_about() -> tuple[list[Image.Image], list[int]]:
    """Return pictures of the plan for every place of the obstacle."""
    scenario = pushplan.load_scenario("two-crates")
    return [_drawn(_planned(_dragged(scenario, k / FRAMES))) for k in range(FRAMES)], [PACE] * FRAMES


def _swept() -> tuple[list[Image.Image], list[int]]:
    """Return pictures of the film of the pencils' plan."""
    scenario = pushplan.load_scenario(DOCS.parent / "examples" / "pencils.yaml")
    plan = pushplan.plan(scenario, first=True, time_limit=600.0)
    assert plan.execution is not None, plan.reason
    end = float(plan.execution.t[-1])
    film = Film(Run(plan.scenario, plan, plan.execution), plan.execution, rate=round(1e3 * end / PACE / FILMED))
    shown = (film.picture(float(t)) for t in np.linspace(0.0, end, FILMED))
    size = PIXELS, PIXELS * HEIGHT // WIDTH
    frames = [Image.fromarray(one).resize(size, Image.Resampling.LANCZOS) for one in shown]
    return frames, [*[PACE] * (FILMED - 1), REST]


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


MOVING = {"moving.webp": _dragged_about, "pencils.webp": _swept}

if __name__ == "__main__":
    main()
