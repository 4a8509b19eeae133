"""Fig. 12: two blocks are turned, then moved straight, to the desired pose; simulated at full speed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from panels import HERE, draw_roles, run
from pushes import simulate_trajectory

from pushplan.drawing.figure import axes_at, figure_for
from pushplan.drawing.palette import FAINT, INK, OBJECTS, PLATE
from pushplan.drawing.sets import draw_contacts, draw_sets, style_cor_axes
from pushplan.geometry import se2
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.sphere import twists_about
from pushplan.planners.timing.arc_limits import Bounds
from pushplan.planners.timing.exact_timing import time_path
from pushplan.plans.path import PushPath, cost_rate
from pushplan.scenario.file import load_scenario
from pushplan.sets.named import stable_set
from pushplan.sim.report import ContactReport
from pushplan.util.arrays import FloatArray

STRAIGHT = 0.2
"""Length of the translation at the end, m."""
SNAPSHOTS = {
    "(a) before the start": 0.0,
    "(b) rotation": 1.0 / 3.0,
    "(c) rotation": 2.0 / 3.0,
    "(d) rotation, end": 1.0,
    "(e) translation": 1.5,
    "(f) at the desired pose": 2.0,
}
"""When to look, in arcs."""
VIEW = (-0.07, -0.1, 0.41, 0.38)
SET_VIEW = (-0.06, -0.1, 0.25, 0.3)


def draw(path: Path, tell: Callable[[str], None]) -> None:
    """Simulate the push and draw the figure.

    Args:
        path: To write to.
        tell: Called with what comes out.
    """
    scenario = load_scenario(HERE / "two-blocks.yaml")
    chain, goal = scenario.chain, scenario.goal.pose_chain
    cor = turning_center(goal)
    push = two_arcs(cor, goal)
    trajectory = time_path(push, Bounds(chain.pusher.limits))
    report = simulate_trajectory(chain, trajectory)
    for contact in report.summaries:
        tell(f"Fig. 12 {contact}")
    margins = stable_set(chain, "ecof").margin(push.twists)
    tell(f"Fig. 12 margins {margins[0]:.3f} (turn), {margins[1]:.3f} (straight); {trajectory.duration:.1f} s")
    ends = np.append(0.0, [trajectory.breaks[1:][trajectory.arc == arc][-1] for arc in range(2)])
    with figure_for(path, 8.35, 4.3) as figure:
        _draw_set(axes_at(figure, 0.65, 0.45, 2.7, 2.7 * 0.4 / 0.31), chain, cor)
        for i, (title, look) in enumerate(SNAPSHOTS.items()):
            axes = axes_at(figure, 3.6 + 1.57 * (i % 3), 2.45 - 2.0 * (i // 3), 1.45, 1.45)
            time = float(np.interp(look, [0.0, 1.0, 2.0], ends))
            _draw_snapshot(axes, chain, report, time, goal)
            axes.set_title(title, loc="left", fontsize=9.0)


def turning_center(goal: FloatArray) -> FloatArray:
    """Return the centre of rotation (2,) from which a straight push of given length ends in the goal pose (3,)."""
    before = goal[:2] - STRAIGHT * np.array([np.cos(goal[2]), np.sin(goal[2])])
    return np.asarray(np.linalg.solve(np.eye(2) - se2.rotate(goal[2], np.eye(2)).T, before))


def two_arcs(cor: FloatArray, goal: FloatArray) -> PushPath:
    """Return the path that turns about `cor` (2,) and then goes straight, to the goal pose (3,)."""
    turn, straight = twists_about(cor, +1), np.array([1.0, 0.0, 0.0])
    rates = cost_rate(np.stack([turn, straight]))
    lengths = np.array([goal[2], STRAIGHT]) * rates
    return PushPath(np.zeros(3), np.stack([turn, straight]) / rates[:, None], lengths)


def _draw_set(axes: Axes, chain: Chain, cor: FloatArray) -> None:
    """Draw the stable set with the chosen centre of rotation and direction of translation."""
    draw_sets(axes, [stable_set(chain, "ecof"), stable_set(chain, "cof")], SET_VIEW)
    draw_roles(axes, chain, [0, 1])
    draw_contacts(axes, chain)
    axes.plot(*cor, marker="o", color=INK, markersize=4.0, zorder=8.0)
    leader = {"arrowstyle": "-", "color": INK, "linewidth": 0.6, "shrinkB": 3.0}
    label = {"textcoords": "offset points", "ha": "right", "va": "center", "fontsize": 8.0}
    axes.annotate("centre of\nrotation", cor, (-32, 0), arrowprops=leader, **label)
    arrow = {"arrowstyle": "-|>", "color": INK, "linewidth": 1.2, "shrinkA": 0.0, "shrinkB": 0.0}
    axes.annotate("", (0.235, 0.0), (0.175, 0.0), arrowprops=arrow, zorder=8.0)
    axes.annotate("translation", (0.205, -0.01), ha="center", va="top", fontsize=8.0)
    style_cor_axes(axes, SET_VIEW)
    axes.set_title("the two motions", loc="left", fontsize=9.0)


def _draw_snapshot(axes: Axes, chain: Chain, report: ContactReport, time: float, goal: FloatArray) -> None:
    """Draw where plate and blocks are at a time, over where they shall end."""
    i = int(np.argmin(np.abs(report.t - time)))
    axes.set_aspect("equal")
    axes.set(xlim=(VIEW[0], VIEW[2]), ylim=(VIEW[1], VIEW[3]), xticks=[], yticks=[])
    axes.spines[:].set_color(FAINT)
    for body in chain.bodies:
        axes.fill(*se2.transform_points(goal, body.outline).T, fill=False, edgecolor=FAINT, linestyle="dotted")
    axes.plot(*report.poses[: i + 1, :2].T, color=INK, linewidth=0.8, zorder=2.0)
    draw_body(axes, report.poses[i], chain.pusher.outline, PLATE)
    for obj, pose in zip(chain.objects, report.objects[i], strict=True):
        draw_body(axes, pose, obj.outline, OBJECTS[0])


def draw_body(axes: Axes, pose: FloatArray, outline: FloatArray, colour: str) -> None:
    """Draw one body at a pose (3,)."""
    corners = se2.transform_points(pose, outline)
    axes.fill(*corners.T, facecolor=colour, edgecolor=INK, linewidth=0.8, zorder=3.0)


if __name__ == "__main__":
    run(lambda path: draw(path, print), __file__)
