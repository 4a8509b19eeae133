"""A scene on the floor, seen from above: room, bodies, goals, and the path of the plate coloured by its margins."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from enum import IntEnum
from typing import Any

import numpy as np
import shapely
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch, Polygon
from matplotlib.path import Path as Outline

from pushplan.drawing import palette
from pushplan.drawing.figure import HALO, SMALL, MarginScale, equal_ticks, outline_width
from pushplan.drawing.palette import ALONE, FAINT, GOAL, INK, NEAREST
from pushplan.drawing.scene import Line, Scene, Window, piece_colours
from pushplan.geometry import se2
from pushplan.mechanics.chain import BodyKind
from pushplan.util.arrays import FloatArray
from pushplan.util.printable import cut


class Layer(IntEnum):
    """Drawing order, lowest first; axes and grid lie below 1."""

    TREE = 2
    SWEPT = 3
    OBSTACLE = 4
    GOAL = 5
    ROBOT = 6
    PLATE = 7
    OBJECT = 8
    PATH = 9
    MARK = 10


GHOSTS = 9
"""Number of outlined poses between start and goal of a single push."""

NAMED = 6
"""Largest number of objects for which each has its own entry in the key."""

_ASPECTS = 1.0, 1.6
"""Smallest and largest ratio of the view's width to its height."""
_SWEEP = 0.01
"""Distance between poses whose union is the swept area, m (1 rad counts as 0.1 m)."""
_PATH = 2.0
"""Line width of the path, points."""
_DASHES: Any = (0, (4, 2))
_GOAL: Any = {"edgecolor": GOAL, "linestyle": (0, (3, 1.5))}
_EVENT_MARKS = {
    "disturbance": "*",
    "deviation": "v",
    "moved": "^",
    "replan": "D",
    "room": "s",
    "stall": "P",
    "unseen": "o",
    "gave up": "X",
}
_JUMP = 0.02
"""Smallest change of the margin between neighbouring points that counts as a jump, as between two arcs."""


def view_of(window: Window) -> Window:
    """Return a window with the same centre, enlarged to a ratio of width to height within `_ASPECTS`."""
    size = window.size
    size = np.maximum(size, [size[1] * _ASPECTS[0], size[0] / _ASPECTS[1]])
    middle = 0.5 * np.array([window.xmin + window.xmax, window.ymin + window.ymax])
    return Window(*map(float, (*(middle - 0.5 * size), *(middle + 0.5 * size))))


def set_view(axes: Axes, window: Window) -> None:
    """Show a window of the floor, with equal ticks on both axes."""
    axes.set(xlim=window[::2], ylim=window[1::2], xlabel="x [m]", ylabel="y [m]")
    equal_ticks(axes, float(window.size.max()))


def draw_room(axes: Axes, scene: Scene) -> None:
    """Draw walls and obstacles; unknown areas of a map are hatched."""
    if scene.walls is not None:
        axes.add_artist(
            Polygon(scene.walls, fill=False, edgecolor=palette.WALL, linewidth=1.4, zorder=Layer.OBSTACLE)
        )
    for colour, unknown in sorted({(one.colour, one.unknown) for one in scene.obstacles}):
        look: Any = {"facecolor": "none", "hatch": "////"} if unknown else {"facecolor": colour}
        edge = colour if unknown else palette.OBSTACLE_EDGE
        alike = [one.outline for one in scene.obstacles if (one.colour, one.unknown) == (colour, unknown)]
        # Maps are cut into pieces without holes: their union has no seams.
        for patch in polygon_patches(shapely.union_all([shapely.Polygon(outline) for outline in alike])):
            patch.set(edgecolor=edge, linewidth=0.8, zorder=Layer.OBSTACLE, **look)
            axes.add_artist(patch)


def draw_goals(axes: Axes, scene: Scene) -> None:
    """Draw the goals: green dashes over a line and a pale fill in the object's colour."""
    width = outline_width(axes, [body.outline for body in scene.objects])
    for goal in scene.goals:
        look: Any = {"fill": False, "linewidth": 1.4 * width, "zorder": Layer.OBJECT + 0.5}
        fill = Polygon(goal.outline, facecolor=goal.colour, alpha=0.45, linewidth=0.0, zorder=Layer.GOAL)
        line = Polygon(goal.outline, **{**look, "edgecolor": goal.colour, "linewidth": 2.8 * width})
        for patch in (fill, line, Polygon(goal.outline, **look, **_GOAL)):
            axes.add_artist(patch)


def draw_bodies(
    axes: Axes, scene: Scene, poses: FloatArray, names: Sequence[str] | None = None, faint: bool = False
) -> None:
    """Draw bodies at poses (b, 3): all, or only those in `names`; `faint` marks intermediate poses."""
    width = outline_width(axes, [body.outline for body in scene.objects])
    for body, pose in zip(scene.bodies, poses, strict=True):
        if names is None or body.name in names:
            look: Any = {"facecolor": body.colour, "edgecolor": INK, "linewidth": width}
            if faint:
                look |= {"facecolor": palette.mixed(body.colour, "#ffffff", 0.5), "edgecolor": FAINT}
            axes.add_artist(Polygon(body.at(pose), zorder=Layer[body.kind.name] - 0.4 * faint, **look))


def draw_outlines(axes: Axes, scene: Scene, poses: FloatArray, **look: Any) -> None:
    """Draw the outlines of the moving bodies at poses (b, 3)."""
    for outline, moves in zip(scene.outlines(poses), scene.moved, strict=True):
        if moves:
            axes.add_artist(Polygon(outline, fill=False, **look))


def draw_swept(axes: Axes, scene: Scene) -> None:
    """Fill the area that robot and load sweep while they push."""
    loads = {name for line in scene.lines for name in line.load}
    if len(scene.t) == 1 or not loads:
        return
    step = np.abs(np.diff(scene.poses, axis=0)) * [1.0, 1.0, 0.1]
    travel = np.concatenate([[0.0], np.cumsum(step.sum(axis=2).max(axis=1))])
    kept = np.flatnonzero(np.diff(np.floor(travel / _SWEEP), prepend=-1.0))
    kept = kept[~np.isnan(scene.margins[kept])]
    passed = [
        shapely.polygons(poses[:, None, :2] + se2.rotate(poses[:, None, 2], body.outline))
        for body, poses in zip(scene.bodies, scene.poses[kept].swapaxes(0, 1), strict=True)
        if body.kind is not BodyKind.OBJECT or body.name in loads
    ]
    for patch in polygon_patches(shapely.union_all(passed)):
        patch.set(facecolor=palette.SWEPT, edgecolor="none", zorder=Layer.SWEPT)
        axes.add_artist(patch)


def draw_lines(axes: Axes, lines: Sequence[Line]) -> None:
    """Draw the plate's path: dashed if the robot drives alone, in the margins' colours over white if it pushes."""
    for line in lines:
        if line.pushes:
            draw_by_margin(axes, line.points, line.margins)
        else:
            axes.plot(*line.points.T, color=ALONE, linewidth=0.9, linestyle=_DASHES, zorder=Layer.PATH)


def draw_by_margin(
    axes: Axes,
    points: FloatArray,
    margins: FloatArray,
    *,
    under: str = "white",
    under_width: float = 3.6,
    broken: bool = False,
) -> None:
    """Draw a push as a line in the colours of its margins, over a plain line.

    Args:
        axes: Axes of the floor, or of margins over time.
        points: Points (k, 2) of the line.
        margins: Margins (k,); each piece has the colour of the smaller margin of its two ends.
        under: Colour of the plain line.
        under_width: Width of the plain line, points.
        broken: Whether pieces over which the margin jumps show only the plain line. The margin jumps where the
            pusher stops between two arcs.
    """
    axes.plot(*points.T, color=under, linewidth=under_width, solid_capstyle="round", zorder=Layer.PATH)
    pieces, colours = np.stack([points[:-1], points[1:]], axis=1), piece_colours(margins)
    kept = np.flatnonzero(~(np.abs(np.diff(margins)) > _JUMP) | (not broken))
    line = LineCollection(
        list(pieces[kept]),
        colors=[colours[k] for k in kept],
        linewidths=_PATH,
        capstyle="round",
        zorder=Layer.PATH + 0.1,
    )
    axes.add_collection(line, autolim=False)


def draw_tree(axes: Axes, scene: Scene) -> None:
    """Draw the branches of the search tree."""
    if scene.tree is not None:
        branches = LineCollection(list(scene.tree), colors=palette.TREE, linewidths=0.4, alpha=0.6, zorder=Layer.TREE)
        axes.add_collection(branches, autolim=False)


def draw_nearest(axes: Axes, scene: Scene) -> None:
    """Draw the path that comes nearest to the goal, and the outlines of the bodies at its end."""
    for line in scene.nearest:
        style: Any = {} if line.pushes else {"linestyle": _DASHES}
        axes.plot(*line.points.T, color=NEAREST, linewidth=1.4, zorder=Layer.PATH, **style)
    if scene.nearest_poses is not None:
        width = outline_width(axes, [body.outline for body in scene.objects])
        for outline in scene.outlines(scene.nearest_poses):
            axes.add_artist(
                Polygon(outline, fill=False, edgecolor=NEAREST, linewidth=width, linestyle="--", zorder=Layer.PATH)
            )


def draw_numbers(axes: Axes, scene: Scene) -> None:
    """Write the number of each push on its load at the end of the push."""
    spots: list[FloatArray] = []
    reach = 9.0 / 72.0 * float(np.ptp(axes.get_xlim())) * axes.figure.dpi / axes.get_window_extent().width
    for rest in scene.rests:
        bodies = zip(scene.bodies, rest.poses, strict=True)
        corners = np.concatenate([body.at(pose) for body, pose in bodies if body.name in rest.names])
        spot = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        while any(np.hypot(*(spot - other)) < reach for other in spots):  # several pushes can end in one place
            spot = spot + np.array([reach, 0.0])
        spots.append(spot)
        box = {"boxstyle": "circle,pad=0.18", "facecolor": "white", "edgecolor": INK, "linewidth": 0.5}
        style: Any = {"ha": "center", "va": "center", "fontsize": SMALL, "color": INK, "clip_on": True, "bbox": box}
        axes.text(float(spot[0]), float(spot[1]), str(rest.number), zorder=Layer.MARK, **style)


def draw_marks(axes: Axes, scene: Scene) -> None:
    """Draw the marks of the events of a closed loop."""
    look: Any = {"markersize": 5.0, "markeredgecolor": "white", "markeredgewidth": 0.6, "zorder": Layer.MARK}
    for mark in scene.marks:
        axes.plot(*mark.place, marker=_EVENT_MARKS[mark.kind], color=palette.EVENTS[mark.kind], **look)


def draw_names(axes: Axes, scene: Scene, poses: FloatArray) -> None:
    """Write the name of every visible object below it."""
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    for body, pose in zip(scene.bodies, poses, strict=True):
        if body.kind is not BodyKind.OBJECT:
            continue
        outline = body.at(pose)
        x, y = 0.5 * (outline[:, 0].min() + outline[:, 0].max()), outline[:, 1].min()
        if x0 < x < x1 and y0 < y < y1:
            axes.annotate(
                cut(body.name, 16),
                (float(x), float(y)),
                (0.0, -2.0),
                textcoords="offset points",
                ha="center",
                va="top",
                fontsize=SMALL,
                color=INK,
                bbox=HALO,
                zorder=Layer.MARK,
            )


def draw_path_name(axes: Axes, scene: Scene) -> None:
    """Label the path of a single push beside its middle, on the side farther from obstacles."""
    if not is_single(scene) or len(scene.lines[0].points) < 3:
        return
    line = scene.lines[0]
    k = len(line.points) // 2
    along = line.points[k + 1] - line.points[k - 1]
    across = np.array([-along[1], along[0]]) / max(float(np.hypot(*along)), 1e-9)
    reach = 12.0 * float(np.ptp(axes.get_xlim())) * axes.figure.dpi / 72.0 / axes.get_window_extent().width
    standing = shapely.union_all([shapely.Polygon(one.outline) for one in scene.obstacles])
    sides = [line.points[k] + side * 2.5 * reach * across for side in (+1.0, -1.0)]
    spot = max(sides, key=lambda at: shapely.distance(standing, shapely.Point(at)) if scene.obstacles else 0.0)
    look: Any = {"fontsize": SMALL, "color": INK, "bbox": HALO, "zorder": Layer.MARK}
    line_to: Any = {"arrowstyle": "-", "color": FAINT, "linewidth": 0.6}
    place, beside = ((float(x), float(y)) for x, y in (line.points[k], spot))
    axes.annotate("path", place, beside, ha="center", va="center", arrowprops=line_to, **look)


def draw_scene(axes: Axes, scene: Scene) -> None:
    """Draw a whole scene, from start to goal, into axes whose view is set."""
    draw_room(axes, scene)
    draw_goals(axes, scene)
    if not scene.lines:
        draw_tree(axes, scene)
        draw_nearest(axes, scene)
        draw_bodies(axes, scene, scene.start)
        return
    draw_swept(axes, scene)
    if is_single(scene):
        ghosts: Any = {"edgecolor": INK, "alpha": 0.22, "linewidth": 0.6, "zorder": Layer.SWEPT + 0.5}
        step = np.diff(scene.poses[:, -1], axis=0)
        travel = np.concatenate([[0.0], np.cumsum(np.hypot(step[:, 0], step[:, 1]) + 0.1 * np.abs(step[:, 2]))])
        at = np.searchsorted(travel, np.linspace(0.0, travel[-1], GHOSTS + 2)[1:-1])
        for poses in scene.poses[np.clip(at, 0, len(travel) - 1)]:
            draw_outlines(axes, scene, poses, **ghosts)
        draw_bodies(axes, scene, scene.start)
        draw_bodies(axes, scene, scene.end)
    else:
        last = {name: rest.number for rest in scene.rests for name in rest.names}
        for rest in scene.rests:
            passing = [name for name in rest.names if last[name] != rest.number]
            draw_bodies(axes, scene, rest.poses, passing, faint=True)
        draw_bodies(axes, scene, scene.start)
        draw_bodies(axes, scene, scene.end, list(last))
        width = outline_width(axes, [body.outline for body in scene.objects])
        robot: Any = {"edgecolor": palette.PLATE, "linewidth": width, "zorder": Layer.ROBOT}
        for body, pose in zip(scene.bodies, scene.end, strict=True):
            if body.kind is not BodyKind.OBJECT:
                axes.add_artist(Polygon(body.at(pose), fill=False, **robot))
        draw_numbers(axes, scene)
    draw_lines(axes, scene.lines)
    draw_marks(axes, scene)


def is_single(scene: Scene) -> bool:
    """Return whether the whole path is one push."""
    return len(scene.lines) == 1 and scene.lines[0].pushes


def scene_keys(scene: Scene) -> list[Artist]:
    """Return the key's entries for everything that is drawn."""
    kinds = {body.kind for body in scene.bodies}
    keys: list[Artist] = []
    if BodyKind.ROBOT in kinds:
        keys.append(Patch(facecolor=palette.ROBOT, edgecolor=INK, label="robot"))
    keys.append(Patch(facecolor=palette.PLATE, edgecolor=INK, label="pusher"))
    if len(scene.objects) <= NAMED:
        keys += [Patch(facecolor=one.colour, edgecolor=INK, label=cut(one.name, 20)) for one in scene.objects]
    if scene.goals:
        keys.append(Patch(facecolor="none", label="goal", **_GOAL))
    named = {palette.OBSTACLE: "obstacle", palette.BLOCKING: "in the way"}
    for colour in sorted({one.colour for one in scene.obstacles if not one.unknown}):
        keys.append(Patch(facecolor=colour, edgecolor=palette.OBSTACLE_EDGE, label=named[colour]))
    if any(one.unknown for one in scene.obstacles):
        keys.append(Patch(facecolor="none", edgecolor=palette.OBSTACLE, hatch="////", label="unknown"))
    return [*keys, *_path_keys(scene)]


def _path_keys(scene: Scene) -> Iterator[Artist]:
    """Yield the key's entries for paths and their marks."""
    if scene.lines:
        if len(scene.t) > 1:
            yield Patch(facecolor=palette.SWEPT, edgecolor=FAINT, label="swept")
        if not np.isnan(scene.margins).all():
            yield MarginScale()
        if not is_single(scene):
            yield Line2D([], [], color=ALONE, linewidth=0.9, linestyle=_DASHES, label="robot alone")
            yield Line2D([], [], linestyle="none", marker="$1$", color=INK, markersize=5.0, label="after push 1")
    elif scene.tree is not None:
        yield Line2D([], [], color=palette.TREE, linewidth=0.8, label="search tree")
    if scene.nearest and not scene.lines:
        yield Line2D([], [], color=NEAREST, linewidth=1.4, label="nearest path")
    for kind in dict.fromkeys(mark.kind for mark in scene.marks):
        look: Any = {"marker": _EVENT_MARKS[kind], "color": palette.EVENTS[kind]}
        yield Line2D([], [], linestyle="none", markersize=5.0, label=kind, **look)


def polygon_patches(geometry: shapely.Geometry) -> Iterator[PathPatch]:
    """Yield a patch with open holes for each polygon of a geometry; lines and points are skipped."""
    for part in shapely.get_parts(geometry):
        if isinstance(part, shapely.Polygon) and not part.is_empty:
            rings = [np.asarray(ring.coords)[:, :2] for ring in (part.exterior, *part.interiors)]
            yield PathPatch(Outline.make_compound_path(*(Outline(ring, closed=True) for ring in rings)))
