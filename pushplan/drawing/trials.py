"""Picture of trials: final poses of the objects, and the places where a contact moved first."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from pushplan.drawing import palette
from pushplan.drawing.figure import MarginScale, axes_at, draw_footer, equal_ticks, figure_for, letters_across
from pushplan.drawing.floor import draw_bodies, draw_goals, draw_room, draw_swept, scene_keys, set_view, view_of
from pushplan.drawing.palette import ARRIVED, FAINT, INK, MISSED
from pushplan.drawing.scene import Scene
from pushplan.geometry.se2 import compose, transform_points
from pushplan.plans.execution import wilson
from pushplan.util.printable import cut

if TYPE_CHECKING:
    from pushplan.plans.execution import TrialEnd
    from pushplan.plans.plan import Plan
    from pushplan.scenario.goals import Goal
    from pushplan.scenario.model import Scenario
    from pushplan.util.arrays import FloatArray

# The layout, in inches.
_LEFT, _TOP, _RIGHT, _GAP, _AXIS = 0.62, 0.4, 0.2, 0.72, 0.52
_HEIGHT = 4.0
_WINDOW = 10.0
"""Largest half width of the close-up of the goal, as a multiple of the goal's tolerance."""
_SHARE = 0.95
"""Smallest share of the samples that the close-up shows, if `_WINDOW` allows it."""
_MOST = 400
"""Largest number of drawn samples."""


def plot_trials(plan: Plan, ends: Sequence[TrialEnd], path: str | Path) -> None:
    """Draw trials: the floor with the area that the plan sweeps, and a close-up of the goal.

    Args:
        plan: Plan that was simulated.
        ends: Outcome of each sample.
        path: File to write, with the suffix .png, .svg or .pdf.

    Raises:
        PlotError: For any other suffix.
    """
    scene, scenario = Scene.of(plan.scenario, plan), plan.scenario
    view = view_of(scene.window)
    width = float(_HEIGHT * view.size[0] / view.size[1])
    with figure_for(path, _LEFT + width + _GAP + _HEIGHT + _RIGHT, _HEIGHT) as figure:
        bottom = draw_footer(figure, _LEFT, _keys(scenario, ends, scene)) + _AXIS
        figure.set_size_inches(figure.get_figwidth(), bottom + _HEIGHT + _TOP)
        floor = axes_at(figure, _LEFT, bottom, width, _HEIGHT)
        set_view(floor, view)
        draw_room(floor, scene)
        draw_swept(floor, scene)
        draw_goals(floor, scene)
        draw_bodies(floor, scene, scene.start)
        _draw_ends(floor, scenario, ends)
        colours = dict(zip(scenario.poses, palette.contact_colours(len(scenario.poses)), strict=True))
        for end in ends:
            if end.contact:  # the contact that moved first
                floor.plot(*end.point, marker="x", color=colours[end.object], markersize=5.0, zorder=10.0)
        arrived = sum(end.arrived for end in ends)
        low, high = wilson(arrived, len(ends))
        count = f"{arrived} of {len(ends)} arrive"
        told = f"{count} ({100 * low:.0f} to {100 * high:.0f} % at 95 %)"
        floor.set_title(
            cut(scenario.name, max(8, letters_across(floor, 10.0) - len(told) - 2)) + ": " + told, loc="left"
        )
        _draw_close(axes_at(figure, _LEFT + width + _GAP, bottom, _HEIGHT, _HEIGHT), scenario, ends)


def _draw_ends(axes: Axes, scenario: Scenario, ends: Sequence[TrialEnd]) -> None:
    """Draw the objects' outlines at their final poses: one colour for samples that arrive, one for the others."""
    for arrived, colour in ((False, MISSED), (True, ARRIVED)):
        shown = [end for end in ends if end.arrived == arrived][:_MOST]
        ended = ((obj, pose) for end in shown for obj, pose in zip(scenario.objects, end.objects, strict=True))
        outlines = [transform_points(pose, obj.outline) for obj, pose in ended]
        look: Any = {"facecolors": "none", "edgecolors": colour, "linewidths": 0.5, "zorder": 9.5}
        axes.add_collection(PolyCollection(outlines, alpha=0.5 if len(shown) < 20 else 0.15, **look))


def _shown(scenario: Scenario) -> tuple[int, Goal, FloatArray]:
    """Return the object of the close-up (the goal's, or the last of the load), its goal and its pose (3,) there."""
    last = max(k for k, load in enumerate(scenario.loads) if load.name in scenario.goals)
    load = scenario.loads[last]
    goal = scenario.goals[load.name][0]
    i = len(load.names) - 1 if goal.of is None else load.names.index(goal.of)
    before = sum(len(one.names) for one in scenario.loads[:last])
    return before + i, goal, compose(goal.pose_chain, load.chain.places[i])


def _draw_close(axes: Axes, scenario: Scenario, ends: Sequence[TrialEnd]) -> None:
    """Draw the goal's tolerance, and the final positions of one object as points around its goal."""
    k, goal, place = _shown(scenario)
    off = 1e3 * (np.array([end.objects[k, :2] for end in ends]) - place[:2])
    arrived = np.array([end.arrived for end in ends])
    tolerance = 1e3 * goal.position_tolerance
    for good, colour in ((False, MISSED), (True, ARRIVED)):
        x, y = off[arrived == good].T
        style: Any = {"markersize": 4.0, "alpha": 0.6, "markeredgewidth": 0.0, "zorder": 3.0}
        axes.plot(x, y, ".", color=colour, **style)
    axes.add_patch(Circle((0.0, 0.0), tolerance, fill=False, edgecolor=INK, linewidth=0.9, zorder=4.0))
    axes.axhline(0.0, color=FAINT, linewidth=0.5)
    axes.axvline(0.0, color=FAINT, linewidth=0.5)
    most = float(np.quantile(np.abs(off).max(axis=1), _SHARE))
    far = 1.15 * float(np.clip(most, tolerance, _WINDOW * tolerance))
    outside = int((np.hypot(*off.T) > tolerance).sum())
    beyond = int((np.abs(off).max(axis=1) > far).sum())
    told = f"{outside} of {len(ends)} outside the tolerance" + (f", {beyond} not shown" if beyond else "")
    axes.set(xlim=(-far, far), ylim=(-far, far), xlabel="x off the goal [mm]", ylabel="y off the goal [mm]")
    name = cut(list(scenario.poses)[k], max(8, letters_across(axes, 10.0) - len(told) - 2))
    axes.set_title(f"{name}: {told}", loc="left")
    axes.set_aspect("equal")
    equal_ticks(axes, 2.0 * far)


def _keys(scenario: Scenario, ends: Sequence[TrialEnd], scene: Scene) -> list[Artist]:
    """Return the key's entries: outcomes of the samples, and bodies and obstacles."""
    ended = ((True, ARRIVED, "arrived"), (False, MISSED, "missed the tolerance"))
    keys: list[Artist] = [
        Line2D([], [], color=colour, label=told)
        for one, colour, told in ended
        if any(end.arrived == one for end in ends)
    ]
    keys.append(Line2D([], [], color=INK, linewidth=0.9, label="tolerance"))
    failing = {end.object: end.contact for end in ends if end.contact}
    mark: Any = {"marker": "x", "linestyle": "none"}
    failed = [
        Line2D([], [], color=colour, label=f"{failing[name]} moved first", **mark)
        for name, colour in zip(scenario.poses, palette.contact_colours(len(scenario.poses)), strict=True)
        if name in failing
    ]
    drawn = [key for key in scene_keys(scene) if not isinstance(key, MarginScale)]  # the path is not drawn
    return [*keys, *failed, *drawn]
