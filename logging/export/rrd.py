"""A run as a recording for the Rerun viewer: the scene, the motion, and each contact's state over time.

Rerun draws the transforms, poses and texts of a run log, but not its scene; this export has everything.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pushplan.geometry import se2
from pushplan.logging.messages.recorded import RecordedRun
from pushplan.logging.view.contacts import ContactShapes, PushedContacts, resting
from pushplan.logging.view.scene import CHAIN, WORLD, nearest, scene, tree
from pushplan.logging.view.shapes import corners
from pushplan.logging.view.window import Way, shown_ways, window
from pushplan.mechanics.chain import Chain
from pushplan.plans.execution import Execution
from pushplan.plans.result import ProgressPoint
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray
from pushplan.util.colours import ALONE, PATH, contact_colours, red_green_blue
from pushplan.util.extras import optional
from pushplan.util.names import PUSHER
from pushplan.util.outputs.write import write_whole

TIMELINE = "time"
"""Name of the timeline: simulated seconds."""

_COSTS = "costs"
"""Entity of the best path's cost: no series, as it falls with iterations, and the time of the others is simulated."""

_MOVING = f"{WORLD}/{CHAIN}"


def write_rrd(run: RecordedRun, path: Path | str) -> None:
    """Write the recording.

    Raises:
        MissingExtraError: When rerun-sdk is not installed.
        OutputError: When the file cannot be written.
    """
    rerun = optional("rerun", "a Rerun recording", "rerun-sdk", "rerun")
    name = run.words.get("pushplan.run", {}).get("scenario_sha256", run.scenario.name)
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "run.rrd"
        recording = rerun.RecordingStream("pushplan", recording_id=f"{name}-{run.path.name}")
        recording.save(target, default_blueprint=_blueprint(rerun, run))
        _record(rerun, recording, run)
        recording.flush()
        recording.disconnect()
        write_whole(path, target.read_bytes())


def _record(rerun: Any, recording: Any, run: RecordedRun) -> None:
    for entity, shapes in _shapes(rerun, run):
        recording.log(entity, *shapes, static=True)
    slips = run.execution is not None and run.execution.object_poses is not None
    for obj in run.scenario.chain.objects if run.scenario.pushes is None and not slips else ():
        recording.log(_frame(rerun, obj.name, run.scenario), _place(rerun, obj.pose_chain), static=True)
    if run.execution is not None and len(run.execution.t):
        for entity, columns in _columns(rerun, run.scenario, run.execution):
            index = rerun.TimeColumn(TIMELINE, duration=run.execution.t)
            recording.send_columns(entity, indexes=[index], columns=columns)
    else:
        for entity, pose in _at_first(rerun, run.scenario):
            recording.log(entity, _place(rerun, pose), static=True)
    if run.plan is not None and run.plan.progress:
        iterations, costs = _costs(run.plan.progress)
        recording.log(_COSTS, rerun.BarChart(costs, abscissa=iterations), static=True)
    if run.plan is not None and run.plan.path is None:
        recording.log(_WHY, rerun.TextDocument("\n\n".join(run.plan.why_not)), static=True)
    for entity, colour, name in _curves(run.scenario.chain):
        recording.log(entity, rerun.SeriesLines(colors=[red_green_blue(colour)], names=[name]), static=True)
    for line in run.lines:
        recording.set_time(TIMELINE, duration=line.time)
        recording.log("log", rerun.TextLog(line.text, level=_LEVELS[line.level]))


_BARS = 100
"""Bars of the chart of costs: as wide as their distance, so that they are seen."""

_LEVELS = {"debug": "DEBUG", "info": "INFO", "warning": "WARN", "error": "ERROR", "fatal": "CRITICAL"}


def _costs(progress: Sequence[ProgressPoint]) -> tuple[FloatArray, FloatArray]:
    """Return iterations (k,) at even distances and the cost (k,) of the path that was best at each."""
    found = np.array([point.iterations for point in progress], dtype=np.float64)
    iterations = np.linspace(found[0], found[-1], _BARS)
    last = np.searchsorted(found, iterations, side="right") - 1
    return iterations, np.array([point.cost for point in progress])[last]


def _frame(rerun: Any, name: str, scenario: Scenario) -> str:
    """Return the entity that a frame of the log becomes; of several pushes, objects move on their own."""
    fixed = {WORLD: WORLD, CHAIN: _MOVING, PUSHER: f"{_MOVING}/{PUSHER}"}
    parent = _MOVING if scenario.pushes is None else WORLD
    return fixed.get(name) or f"{parent}/objects/{rerun.escape_entity_path_part(name)}"


def _at_first(rerun: Any, scenario: Scenario) -> Iterator[tuple[str, FloatArray]]:
    """Yield what moves and where it is (3,) before anything has."""
    if scenario.pushes is None:
        yield _MOVING, scenario.start
        return
    yield _MOVING, scenario.robot_start
    for obj in scenario.chain.objects:
        yield _frame(rerun, obj.name, scenario), se2.compose(scenario.start, obj.pose_chain)


def _shapes(rerun: Any, run: RecordedRun) -> Iterator[tuple[str, list[Any]]]:
    """Yield what does not change over time: every body in its frame, the search tree, the path."""
    entities = list(scene(run.scenario).entities)
    if run.plan is not None:
        entities += [*tree(run.plan.tree).entities, *nearest(run.scenario.chain, run.plan).entities]
    for entity in entities:
        frame = _frame(rerun, entity.frame_id, run.scenario)
        parts = "/".join(rerun.escape_entity_path_part(part) for part in entity.id.split("/"))
        for kind, shapes in (("inside", entity.triangles), ("outline", entity.lines)):
            if shapes:
                yield f"{frame}/{parts}/{kind}", [_shape(rerun, kind, shapes, entity.id == "tree")]
    colours = contact_colours(len(run.scenario.chain.contacts))
    contacts = zip(resting(run.scenario.chain), colours, strict=True) if run.scenario.pushes is None else ()
    for k, (contact, colour) in enumerate(contacts):
        strip = np.column_stack([contact.segment, np.full(2, _SEGMENT_HEIGHT)])
        segment = rerun.LineStrips3D([strip], colors=[red_green_blue(colour)], radii=_pixels(rerun, 2.0))
        yield f"{_contact(rerun, run.scenario.chain, k)}/segment", [segment]
    if run.plan is not None and run.plan.path is not None:
        yield f"{WORLD}/path", [_ways(rerun, shown_ways(run.plan))]


def _ways(rerun: Any, ways: list[Way]) -> Any:
    """Return the path, in another colour and thinner where the robot drives alone."""
    strips = [np.column_stack([way.points, np.full(len(way.points), _PATH_HEIGHT)]) for way in ways]
    lines = [red_green_blue(ALONE if way.alone else PATH) for way in ways]
    radii = [rerun.Radius.ui_points(0.5 if way.alone else 1.0) for way in ways]
    return rerun.LineStrips3D(strips, colors=lines, radii=radii)


def _contact(rerun: Any, chain: Chain, k: int) -> str:
    """Return the entity of contact `k`."""
    return f"{_MOVING}/contacts/{rerun.escape_entity_path_part(chain.contact_name(k))}"


def _pixels(rerun: Any, width: float) -> Any:
    """Return half the width of a line that is as wide at every zoom."""
    return [rerun.Radius.ui_points(width)]


_PATH_HEIGHT, _SEGMENT_HEIGHT = 0.0005, 0.004
"""Between the floor and the bodies, and above these, m."""


def _shape(rerun: Any, kind: str, shapes: Any, thin: bool) -> Any:
    colors = [
        tuple(round(255 * part) for part in (s.color.r, s.color.g, s.color.b, s.color.a)) for s in shapes
    ]
    if kind == "inside":
        vertices = np.concatenate([corners(shape) for shape in shapes])
        paints = np.repeat(colors, [len(shape.points) for shape in shapes], axis=0)
        return rerun.Mesh3D(vertex_positions=vertices, vertex_colors=paints)
    strips = [strip for shape in shapes for strip in _strips(shape)]
    lines = [
        _PALE if thin else color for color, shape in zip(colors, shapes, strict=True) for _ in _strips(shape)
    ]
    return rerun.LineStrips3D(strips, colors=lines, radii=_pixels(rerun, 0.4 if thin else 1.0))


def _strips(shape: Any) -> list[FloatArray]:
    """The lines (k, 3) of a line primitive."""
    points = corners(shape)
    if shape.type == shape.LINE_LIST:
        return list(points.reshape(-1, 2, 3))
    return [np.concatenate([points, points[:1]]) if shape.type == shape.LINE_LOOP else points]


def _place(rerun: Any, pose: FloatArray) -> Any:
    x, y, theta = pose
    turn = rerun.RotationAxisAngle((0.0, 0.0, 1.0), radians=theta)
    return rerun.Transform3D(translation=(x, y, 0.0), rotation=turn)


def _moved(rerun: Any, poses: FloatArray) -> Any:
    """Columns of poses (m, 3)."""
    half, still = 0.5 * poses[:, 2], np.zeros(len(poses))
    turns = np.column_stack([still, still, np.sin(half), np.cos(half)])
    return rerun.Transform3D.columns(translation=np.column_stack([poses[:, :2], still]), quaternion=turns)


def _columns(rerun: Any, scenario: Scenario, execution: Execution) -> Iterator[tuple[str, Any]]:
    """Yield what changes over time, a column for each entity."""
    chain, count = scenario.chain, len(execution.t)
    yield _MOVING, _moved(rerun, execution.poses)
    for name, values in _numbers(chain, execution).items():
        yield name, rerun.Scalars.columns(scalars=values)
    if execution.loads is not None:
        for obj in chain.objects:
            yield (
                _frame(rerun, obj.name, scenario),
                _moved(rerun, se2.compose(execution.loads, obj.pose_chain)),
            )
        return
    if execution.object_poses is not None:
        within = se2.relative(execution.poses[:, None], execution.object_poses)
        for k, obj in enumerate(chain.objects):
            yield _frame(rerun, obj.name, scenario), _moved(rerun, within[:, k])
    marks = contact_colours(len(chain.contacts))
    shown = PushedContacts(chain, execution).at(np.arange(count))
    for k, (shapes, mark) in enumerate(zip(shown, marks, strict=True)):
        yield from _pushed(rerun, _contact(rerun, chain, k), shapes, mark)


def _pushed(rerun: Any, entity: str, shapes: ContactShapes, mark: str) -> Iterator[tuple[str, Any]]:
    """Yield the friction cones of a contact and, where it is known, its force over time."""
    n, c = shapes.cones.shape[:2]
    corners = np.concatenate([shapes.cones.reshape(-1, 2), np.full((3 * n * c, 1), _CONE_HEIGHT)], axis=-1)
    paint = [(*red_green_blue(mark), _CONE_OPACITY)] * (3 * n * c)
    cones = rerun.Mesh3D.columns(vertex_positions=corners, vertex_colors=paint)
    yield f"{entity}/cone", cones.partition(np.full(n, 3 * c))
    if shapes.shafts is None or shapes.heads is None:
        return
    origins = np.column_stack([shapes.shafts[:, 0], np.full(n, _FORCE_HEIGHT)])
    vectors = np.column_stack([shapes.heads[:, 0] - shapes.shafts[:, 0], np.zeros(n)])
    yield (
        f"{entity}/force",
        rerun.Arrows3D.columns(vectors=vectors, origins=origins, colors=[red_green_blue(mark)] * n),
    )


_PALE = (185, 201, 230)
"""Of the search tree: Rerun draws no line that shines through."""

_FORCE_HEIGHT, _CONE_HEIGHT, _CONE_OPACITY = 0.01, 0.003, 90
"""Above the floor, m; of 255."""


def _curves(chain: Chain) -> Iterator[tuple[str, str, str]]:
    """Yield entity, colour and name of every line of a plot that belongs to a contact."""
    for k, colour in enumerate(contact_colours(len(chain.contacts))):
        name = chain.contact_name(k)
        for kind in ("margins", "friction_margins", "lambdas"):
            yield f"{kind}/{name}", colour, name


def _numbers(chain: Chain, execution: Execution) -> Mapping[str, FloatArray]:
    """Return the values (m,) to plot, by entity."""
    found = {
        f"twist/{name}": values
        for name, values in zip(("vx", "vy", "omega"), execution.twists.T, strict=True)
    }
    for k in range(len(chain.contacts)):
        name = chain.contact_name(k)
        found[f"margins/{name}"] = execution.margins[:, k]
        if execution.friction_margins is not None:
            found[f"friction_margins/{name}"] = execution.friction_margins[:, k]
        if execution.lambdas is not None:
            found[f"lambdas/{name}"] = execution.lambdas[:, k]
    return found


def _blueprint(rerun: Any, run: RecordedRun) -> Any:
    """The viewer's panels: the scene from above, the margins, the log."""
    views = optional("rerun.blueprint", "a Rerun recording", "rerun-sdk", "rerun")
    view, solved = window(run.scenario, run.plan), run.plan is not None and run.plan.path is not None
    x, y = 0.5 * (view.xmin + view.xmax), 0.5 * (view.ymin + view.ymax)
    height = 1.2 * max(view.xmax - view.xmin, view.ymax - view.ymin)
    eye = views.EyeControls3D(position=(x, y, height), look_target=(x, y, 0.0), eye_up=(0.0, 1.0, 0.0))
    hidden = {f"{WORLD}/tree": views.EntityBehavior(visible=False)} if solved else {}
    scene_view = views.Spatial3DView(
        origin=WORLD, name=run.scenario.name, eye_controls=eye, line_grid=False, overrides=hidden
    )
    log = views.TextLogView(origin="log", name="Log")
    if not solved:
        why = views.TextDocumentView(origin=_WHY, name="Why there is no plan")
        return views.Blueprint(views.Horizontal(scene_view, views.Vertical(why, log)))
    plots = (
        views.TimeSeriesView(origin="margins", name="Margin of each contact"),
        views.TimeSeriesView(origin="lambdas", name="Where the force acts"),
        views.BarChartView(origin=_COSTS, name="Cost of the best path over iterations"),
    )
    return views.Blueprint(views.Horizontal(scene_view, views.Vertical(*plots, log)))


_WHY = "why"
"""Entity of the reason why there is no plan."""
