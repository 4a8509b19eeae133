"""A run as a recording for the Rerun viewer: the scene, the motion, and each contact's state over time.

Rerun draws the transforms, poses and texts of a run log, but not its scene; this export has everything.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pushplan.basics.arrays import FloatArray
from pushplan.basics.extras import optional
from pushplan.basics.names import PUSHER
from pushplan.execution import Execution
from pushplan.logging.messages.recorded import RecordedRun
from pushplan.logging.view.scene import CHAIN, WORLD, scene, tree
from pushplan.logging.view.shapes import corners
from pushplan.logging.view.window import path_points, window
from pushplan.mechanics.chain import Chain
from pushplan.outputs.write import write_whole

TIMELINE = "time"
"""Name of the timeline: simulated seconds."""

LONGEST_ARROW = 0.15
"""Length of the arrow of the largest contact force, m."""

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
    for obj in run.scenario.chain.objects:
        recording.log(_frame(rerun, obj.name), _place(rerun, obj.pose_chain), static=True)
    if run.execution is not None and len(run.execution.t):
        for entity, columns in _columns(rerun, run.scenario.chain, run.execution):
            index = rerun.TimeColumn(TIMELINE, duration=run.execution.t)
            recording.send_columns(entity, indexes=[index], columns=columns)
    else:
        recording.log(_MOVING, _place(rerun, run.scenario.start), static=True)
    for line in run.lines:
        recording.set_time(TIMELINE, duration=line.time)
        recording.log("log", rerun.TextLog(line.text, level=_LEVELS[line.level]))


_LEVELS = {"debug": "DEBUG", "info": "INFO", "warning": "WARN", "error": "ERROR", "fatal": "CRITICAL"}


def _frame(rerun: Any, name: str) -> str:
    """Return the entity that a frame of the log becomes."""
    fixed = {WORLD: WORLD, CHAIN: _MOVING, PUSHER: f"{_MOVING}/{PUSHER}"}
    return fixed.get(name) or f"{_MOVING}/objects/{rerun.escape_entity_path_part(name)}"


def _shapes(rerun: Any, run: RecordedRun) -> Iterator[tuple[str, list[Any]]]:
    """Yield what does not change over time: every body in its frame, the search tree, the path."""
    entities = list(scene(run.scenario).entities)
    entities += [] if run.plan is None else tree(run.plan.tree).entities
    for entity in entities:
        frame = _frame(rerun, entity.frame_id)
        parts = "/".join(rerun.escape_entity_path_part(part) for part in entity.id.split("/"))
        for kind, shapes in (("inside", entity.triangles), ("outline", entity.lines)):
            if shapes:
                yield f"{frame}/{parts}/{kind}", [_shape(rerun, kind, shapes)]
    points = path_points(run.plan)
    if len(points):
        strip = np.column_stack([points, np.full(len(points), _PATH_HEIGHT)])
        yield f"{WORLD}/path", [rerun.LineStrips3D([strip], colors=[(31, 111, 178)])]


_PATH_HEIGHT = 0.0005
"""Between the floor and the bodies, m."""


def _shape(rerun: Any, kind: str, shapes: Any) -> Any:
    colors = [
        tuple(round(255 * part) for part in (s.color.r, s.color.g, s.color.b, s.color.a)) for s in shapes
    ]
    if kind == "inside":
        vertices = np.concatenate([corners(shape) for shape in shapes])
        paints = np.repeat(colors, [len(shape.points) for shape in shapes], axis=0)
        return rerun.Mesh3D(vertex_positions=vertices, vertex_colors=paints)
    strips = [strip for shape in shapes for strip in _strips(shape)]
    return rerun.LineStrips3D(
        strips, colors=[c for c, s in zip(colors, shapes, strict=True) for _ in _strips(s)]
    )


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


def _columns(rerun: Any, chain: Chain, execution: Execution) -> Iterator[tuple[str, Any]]:
    """Yield what changes over time, a column for each entity."""
    count = len(execution.t)
    half = 0.5 * execution.poses[:, 2]
    still = np.zeros(count)
    turns = np.column_stack([still, still, np.sin(half), np.cos(half)])
    moves = np.column_stack([execution.poses[:, :2], still])
    yield _MOVING, rerun.Transform3D.columns(translation=moves, quaternion=turns)
    for name, values in _numbers(chain, execution).items():
        yield name, rerun.Scalars.columns(scalars=values)
    if execution.forces is None or execution.lambdas is None:
        return
    largest = float(np.hypot(execution.forces[..., 0], execution.forces[..., 1]).max()) or 1.0
    for k, contact in enumerate(chain.contacts):
        share = execution.lambdas[:, k, None]
        origins = np.column_stack(
            [contact.right + share * (contact.left - contact.right), still + _FORCE_HEIGHT]
        )
        vectors = np.column_stack([LONGEST_ARROW / largest * execution.forces[:, k], still])
        part = rerun.escape_entity_path_part(chain.contact_name(k))
        yield f"{_MOVING}/forces/{part}", rerun.Arrows3D.columns(vectors=vectors, origins=origins)


_FORCE_HEIGHT = 0.01
"""Above the bodies, m."""


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
    view = window(run.scenario, run.plan)
    x, y = 0.5 * (view.xmin + view.xmax), 0.5 * (view.ymin + view.ymax)
    height = 1.2 * max(view.xmax - view.xmin, view.ymax - view.ymin)
    eye = views.EyeControls3D(position=(x, y, height), look_target=(x, y, 0.0), eye_up=(0.0, 1.0, 0.0))
    return views.Blueprint(
        views.Horizontal(
            views.Spatial3DView(origin=WORLD, name=run.scenario.name, eye_controls=eye, line_grid=False),
            views.Vertical(
                views.TimeSeriesView(origin="margins", name="Margins"),
                views.TimeSeriesView(origin="lambdas", name="Point of application"),
                views.TextLogView(origin="log", name="Log"),
            ),
        )
    )
