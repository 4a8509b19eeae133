"""Pictures of plans and of scenarios: the floor, and beside it the stable set, the margin or the pushes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from pushplan.drawing import PANELS, PlotError, palette
from pushplan.drawing.figure import (
    SMALL,
    Picture,
    axes_at,
    broken,
    draw_footer,
    figure_for,
    letters_across,
    letters_in,
    margin_ticks,
    narrowest,
)
from pushplan.drawing.floor import (
    draw_bodies,
    draw_by_margin,
    draw_goals,
    draw_lines,
    draw_names,
    draw_path_name,
    draw_room,
    draw_scene,
    scene_keys,
    set_view,
    view_of,
)
from pushplan.drawing.palette import FAINT, INK
from pushplan.drawing.scene import Line, Scene, Window
from pushplan.drawing.sets import draw_set, name_objects
from pushplan.util.names import CLOSE
from pushplan.util.printable import cut

if TYPE_CHECKING:
    from pushplan.plans.execution import Execution
    from pushplan.plans.plan import Plan
    from pushplan.plans.run import Event
    from pushplan.plans.segment import Segment
    from pushplan.scenario.model import Scenario
    from pushplan.sets.stable_set import StableSet

# The layout, in inches.
_LEFT, _TOP, _RIGHT, _GAP, _AXIS = 0.62, 0.34, 0.2, 0.78, 0.52
_HEIGHT, _SIDE, _MARGIN_HEIGHT = 4.0, 2.2, 1.05
_SCENARIO_SIDE, _LEAST_WIDTH = 2.6, 4.5
_STEPS_IN_A_ROW, _MOST_STEPS, _STEP_GAP, _STEP_TITLE = 4, 12, 0.15, 0.26
"""Small pictures of single pushes: per row, at most, gap between them and height of a title, inches."""
_LINE = 0.155
"""Line height of the text beside the floor, inches."""
_TITLE = 10.0
"""Font size of the title, points."""
_LETTERS = 7.5
"""Font size of the text beside the floor, points."""


def plot_plan(
    plan: Plan,
    path: str | Path | None = None,
    execution: Execution | None = None,
    events: Iterable[Event] = (),
    panels: Sequence[str] = PANELS,
) -> Picture | None:
    """Draw a plan: the path from start to goal, its margin, and the stable set or the pushes.

    Args:
        plan: Plan of any kind. If it is not solved, the picture shows the search tree, the nearest path and the
            reason.
        path: File to write, with the suffix .png, .svg or .pdf. If None, the picture is returned as PNG, which
            notebooks show.
        execution: Execution whose paths and margins are drawn; by default that of the plan.
        events: Events of a closed loop; disturbances, deviations and replans are marked.
        panels: Panels to draw, some of `PANELS`: the floor, the stable set or the list of pushes, the margin over
            time, and a small picture for each push of a rearrangement.

    Raises:
        PlotError: For any other suffix or panel.
    """
    if not panels or not set(panels) <= set(PANELS):
        raise PlotError(f"panels {', '.join(panels) or '(none)'}: allowed are one or more of {', '.join(PANELS)}")
    execution = plan.execution if execution is None else execution
    events = tuple(events)
    scene = Scene.of(plan.scenario, plan, execution, events)
    view = view_of(scene.window)
    if "floor" in panels and not (plan.solved or plan.scenario.task.held or len(plan.why_not) > 1):
        panels = ("floor",)  # no pushes to list and no more reasons to show
    width = float(_HEIGHT * view.size[0] / view.size[1]) if "floor" in panels else 0.0
    side = _LEFT + (width + _GAP if width else 0.0)
    beside = {"set", "margin"} & set(panels)
    full = max((side + _SIDE if beside else _LEFT + width) + _RIGHT, _LEAST_WIDTH)
    tall = _HEIGHT if width or "set" in panels else _MARGIN_HEIGHT if beside else 0.0
    target = BytesIO() if path is None else path
    with figure_for(target, full, _HEIGHT) as figure:
        keys = scene_keys(scene) if width or "steps" in panels else []
        known = plan.robustness is not None and plan.robustness.known
        said = [f"robustness, {plan.robustness_words}"] if known else []
        said += [plan.force_words] if plan.force_limit is not None else []
        low = draw_footer(figure, _LEFT, keys, "; ".join(filter(None, said)) if plan.solved else plan.reason) + 0.15
        steps = None
        if "steps" in panels and not plan.scenario.task.one_load:
            steps = _Steps.of(scene, view, full - _LEFT - _RIGHT)
        bottom = low + (0.0 if steps is None else steps.height) + _AXIS - 0.15
        over = 0.24 if beside and not (plan.solved and width) else 0.0  # above the titles of the other panels
        across = width if plan.solved and width else full - _LEFT - _RIGHT
        figure.set_size_inches(full, bottom + tall + _TOP + over)
        title: Any = {"transform": figure.dpi_scale_trans, "fontsize": _TITLE, "va": "bottom"}
        shown = _title(plan, scene, bool(events), letters_in(across, _TITLE))
        figure.text(_LEFT, bottom + tall + 0.1 + over, shown, **title)
        if width:
            floor = axes_at(figure, _LEFT, bottom, width, _HEIGHT)
            set_view(floor, view)
            draw_scene(floor, scene)
            draw_path_name(floor, scene)
        if steps is not None:
            steps.draw(figure, _LEFT, low)
        above = bottom
        if "margin" in panels and scene.lines and execution is not None and len(execution.t) > 1:
            draw_margins(axes_at(figure, side, bottom, _SIDE, _MARGIN_HEIGHT), scene, plan.margin)
            above += _MARGIN_HEIGHT + _GAP
        elif "set" in panels and len(plan.why_not) > 1:
            above += _tell_more(figure, side, bottom, plan)
        if "set" in panels:
            column = axes_at(figure, side, above, _SIDE, bottom + tall - above)
            if plan.scenario.task.held:
                draw_set(column, plan.scenario.chain, plan.scenario.stable_set(plan.stable_set or None))
            else:
                _list_pushes(column, scene, plan)
    return Picture(target.getvalue()) if isinstance(target, BytesIO) else None


def plot_scenario(scenario: Scenario, path: str | Path, stable: StableSet | None = None) -> None:
    """Draw a scenario: the floor with start and goals, and the chain with its stable set.

    Args:
        scenario: Scenario of any kind.
        path: File to write, with the suffix .png, .svg or .pdf.
        stable: Stable set of its chain; None draws only the floor, for example if objects stand apart.

    Raises:
        PlotError: For any other suffix.
    """
    scene = Scene.of(scenario)
    view = view_of(scene.window)
    width = float(_HEIGHT * view.size[0] / view.size[1])
    side = _LEFT + width + _GAP
    full = _LEFT + width + _RIGHT if stable is None else side + _SCENARIO_SIDE + _RIGHT
    with figure_for(path, full, _HEIGHT) as figure:
        bottom = draw_footer(figure, _LEFT, scene_keys(scene)) + _AXIS
        figure.set_size_inches(full, bottom + _HEIGHT + _TOP)
        floor = axes_at(figure, _LEFT, bottom, width, _HEIGHT)
        set_view(floor, view)
        floor.set_title(cut(scenario.name, letters_across(floor, _TITLE)), loc="left")
        draw_scene(floor, scene)
        if stable is None:
            draw_names(floor, scene, scene.start)
            return
        beside = axes_at(figure, side, bottom, _SCENARIO_SIDE, _HEIGHT)
        draw_set(beside, scenario.chain, stable)
        if narrowest(beside, [body.outline for body in scene.objects]) > SMALL:
            name_objects(beside, scenario.chain)


@dataclass(frozen=True, eq=False)
class _Steps:
    """A small picture for each push: the paths of the robot, the pushed objects, and all poses before the push.

    Attributes:
        scene: Scene of the plan.
        view: Window of each picture.
        size: Width and height of each picture, inches.
        lines: Parts of the path in each picture, up to the end of the push.
    """

    scene: Scene
    view: Window
    size: tuple[float, float]
    lines: tuple[tuple[Line, ...], ...]

    @classmethod
    def of(cls, scene: Scene, view: Window, width: float) -> _Steps | None:
        """Return the pictures in rows of a width, inches; None for a single push or for too many."""
        if not 1 < len(scene.rests) <= _MOST_STEPS:
            return None
        own = (width - (_STEPS_IN_A_ROW - 1) * _STEP_GAP) / _STEPS_IN_A_ROW
        groups: list[list[Line]] = [[]]
        for line in scene.lines:
            pushed = any(known.pushes for known in groups[-1])
            if pushed and line.kind != CLOSE and len(groups) < len(scene.rests):
                groups.append([])
            groups[-1].append(line)
        height = own * float(view.size[1] / view.size[0])
        return cls(scene, view, (own, height), tuple(tuple(group) for group in groups))

    @property
    def height(self) -> float:
        """Height of all rows with their titles, inches."""
        return -(-len(self.lines) // _STEPS_IN_A_ROW) * (self.size[1] + _STEP_TITLE)

    def draw(self, figure: Figure, left: float, bottom: float) -> None:
        """Draw all pictures, the first in the top row."""
        rows = -(-len(self.lines) // _STEPS_IN_A_ROW)
        before = self.scene.start
        for k, (lines, rest) in enumerate(zip(self.lines, self.scene.rests, strict=True)):
            row, column = divmod(k, _STEPS_IN_A_ROW)
            x = left + column * (self.size[0] + _STEP_GAP)
            y = bottom + (rows - 1 - row) * (self.size[1] + _STEP_TITLE)
            axes = axes_at(figure, x, y, *self.size)
            axes.set(xlim=self.view[::2], ylim=self.view[1::2], xticks=[], yticks=[])
            letters = letters_across(axes, _LETTERS) - 8
            moved = cut(_named(rest.names, letters), letters)
            axes.set_title(f"push {rest.number}: {moved}", loc="left", fontsize=_LETTERS, pad=3.0)
            draw_room(axes, self.scene)
            draw_goals(axes, self.scene)
            draw_bodies(axes, self.scene, before)
            draw_bodies(axes, self.scene, rest.poses, rest.names, faint=True)
            draw_lines(axes, lines)
            before = rest.poses


def _title(plan: Plan, scene: Scene, executed: bool, letters: int) -> str:
    """Return the title: the outcome of the plan or of another execution."""
    if not plan.solved:
        done = len(plan.scenario.goals)  # a partial plan has the goals that it reaches
        total = done + len(plan.undelivered)
        outcome = f": partial plan, {done} of {total} delivered" if plan.segments else ": no plan"
        return cut(plan.scenario.name, max(8, letters - len(outcome))) + outcome
    if executed:
        replans = sum(mark.kind == "replan" for mark in scene.marks)
        outcome = f": executed in {scene.t[-1]:.1f} s, {replans} replan{'' if replans == 1 else 's'}"
    else:
        duration = "" if plan.duration is None else f", {plan.duration:.1f} s"
        count = len(plan.pushes)
        pushes = "" if plan.path is not None else f" in {count} push{'es' if count > 1 else ''}"
        outcome = f": {plan.pushed_distance:.2f} m{pushes}{duration}"
    return cut(plan.scenario.name, max(8, letters - len(outcome))) + outcome


def _tell_more(figure: Figure, left: float, bottom: float, plan: Plan) -> float:
    """Write the further reasons why there is no plan; return their height, inches."""
    letters = letters_in(_SIDE, _LETTERS)
    lines = [line for sentence in plan.why_not[1:] for line in [*broken(sentence, letters), ""]][:-1]
    lines = lines if len(lines) <= 12 else [*lines[:11], "…"]
    text: Any = {"transform": figure.dpi_scale_trans, "fontsize": _LETTERS, "color": INK, "va": "top"}
    height = _LINE * len(lines)
    figure.text(left, bottom + height, "\n".join(lines), linespacing=1.25, **text)
    return height + 0.5


def draw_margins(axes: Axes, scene: Scene, kept: float | None = None) -> None:
    """Draw the smallest margin over time in the colours of the path, and the margin that the plan keeps."""
    known = ~np.isnan(scene.margins)
    edges = np.flatnonzero(np.diff(known.astype(int), prepend=0, append=0)).reshape(-1, 2)
    for begin, end in edges:
        points = np.stack([scene.t[begin:end], scene.margins[begin:end]], axis=1)
        draw_by_margin(axes, points, scene.margins[begin:end], under=FAINT, under_width=0.6, broken=True)
    top = float(scene.margins[known].max(initial=palette.MARGINS[-1][0]))
    low = float(scene.margins[known].min(initial=0.0))
    axes.set(xlim=(0.0, max(float(scene.t[-1]), 1e-3)), ylim=(min(0.0, 1.1 * low), 1.08 * top), xlabel="time [s]")
    margin_ticks(axes, kept)
    for mark in scene.marks:
        axes.axvline(mark.time, color=palette.EVENTS[mark.kind], linewidth=0.8, zorder=1.4)
    axes.axhline(0.0, color=palette.SLIPS, linewidth=0.8, zorder=1.5)
    least = float(scene.margins[known].min(initial=np.inf))
    axes.set_title(palette.margins_title(kept, least, bool(scene.marks)), loc="left", fontsize=9.0, linespacing=1.4)
    axes.spines[["top", "right"]].set_visible(False)


def _list_pushes(axes: Axes, scene: Scene, plan: Plan) -> None:
    """Write a list of the pushes: number, colour of the object, name, face and length."""
    axes.axis("off")
    inches = axes.get_window_extent().height / axes.figure.dpi
    axes.set(xlim=(0.0, _SIDE), ylim=(inches, 0.0))
    room = int(inches / _LINE) - 1
    pushes = plan.pushes
    if not pushes:
        return
    colours = {body.name: body.colour for body in scene.objects}
    shown = pushes if len(pushes) <= room else pushes[: room - 1]
    style: Any = {"fontsize": _LETTERS, "color": INK, "va": "center"}
    for k, push in enumerate(shown, start=1):
        y = _LINE * (k - 0.5)
        names = () if push.load is None else push.load.names
        axes.text(0.16, y, str(k), ha="right", **style)
        swatch = Rectangle(
            (0.22, y - 0.05), 0.1, 0.1, facecolor=colours.get(names[0], "white"), edgecolor=INK, lw=0.5
        )
        axes.add_artist(swatch)
        axes.text(0.38, y, _push_text(push, len(scene.objects) > 1), **style)
    if len(shown) < len(pushes):
        axes.text(0.38, _LINE * (len(shown) + 0.5), f"and {len(pushes) - len(shown)} more", **style)


def _push_text(push: Segment, several: bool) -> str:
    """Return the object, face and length of a push as text."""
    if push.load is None:
        return f"{push.cost:.2f} m"
    face = f"{push.load.face} face, {push.cost:.2f} m"
    if not several:
        return face
    letters = letters_in(_SIDE - 0.38, _LETTERS) - 2
    names = _named(push.load.names, letters - len(face))
    if len(names) + len(face) > letters:
        face = face.replace(" face", "")
    return f"{cut(names, max(6, letters - len(face)))}: {face}"


def _named(names: Sequence[str], letters: int) -> str:
    """Return the names of objects, or their number if several names do not fit into `letters`."""
    said = ", ".join(names)
    return said if len(said) <= letters or len(names) == 1 else f"{len(names)} objects"
