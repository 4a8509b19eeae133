"""A run as a ROS 2 bag: one MCAP file of CDR messages that `ros2 bag play` plays and RViz shows.

Topics: /tf_static and /tf (see `bag.frames`), /scene and /contacts (markers), /plan/path and /plan/smoothed, or
/plan/nearest where there is no plan, /pusher/twist, /margins/... (a number each, as PlotJuggler plots them), /log; of
the robot's base, for path followers, /base/path, /base/twist and /footprint, the outline of all that moves with it.
Scene, paths and footprint are offered as transient local, and sent again every second for programs that only listen.
Beside the bag come a file for RViz and one for PlotJuggler.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

from pushplan.geometry import se2
from pushplan.logging.export.bag import messages
from pushplan.logging.export.bag.beside import margin_topics, plotjuggler_layout, rviz_file
from pushplan.logging.export.bag.file import BagFile
from pushplan.logging.export.bag.frames import Frames, turn
from pushplan.logging.export.bag.markers import line_width, markers
from pushplan.logging.messages import metadata
from pushplan.logging.messages.recorded import LogLine, RecordedRun
from pushplan.logging.messages.schemas import LEVELS
from pushplan.logging.view.contact_messages import contact_messages
from pushplan.logging.view.contacts import PushedContacts, resting
from pushplan.logging.view.scene import CHAIN, PATH_SPACING, nearest, scene
from pushplan.logging.view.views import viewed
from pushplan.logging.view.window import smoothed_times, window
from pushplan.mechanics.body import outline_of_all
from pushplan.mechanics.chain import Chain
from pushplan.plans.execution import Execution
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray
from pushplan.util.names import BESIDE_A_BAG
from pushplan.util.outputs.target import look
from pushplan.util.outputs.write import write_whole

Message = dict[str, Any]

_NANO = 1_000_000_000

_EARLIEST = 1.0
"""Epoch of a run whose log does not say when it began, s: tf2 takes 0 for `latest`."""

_AGAIN = 1.0
"""Time after which scene and paths are sent again, s."""


def write_ros2(
    run: RecordedRun, path: Path | str, *, frames: Frames | None = None, epoch: float | None = None
) -> None:
    """Write the bag, an .mcap file, and beside it `.rviz` and `.plotjuggler.xml` of the same name.

    Args:
        run: What to write.
        path: The bag. Where it is streamed, as into a pipe, there is nothing beside it.
        frames: Names of the frames above the chain.
        epoch: ROS time, s, at which the simulated time begins; by default when the run was begun.

    Raises:
        FrameNamesError: When the chain has a frame of one of these names.
        OutputError: When a file cannot be written.
    """
    frames = Frames() if frames is None else frames
    frames.check(run.scenario.chain)
    buffer = io.BytesIO()
    bag = BagFile(buffer, round(_NANO * (_begun(run) if epoch is None else epoch)))
    for part in (_scene, _motion, _margins, _log):
        part(bag, run, frames)
    bag.finish()
    write_whole(path, buffer.getvalue())
    if not look(Path(path)).streamed:
        for suffix, text in zip(BESIDE_A_BAG, (rviz_file(run, frames), plotjuggler_layout(run)), strict=True):
            write_whole(Path(path).with_suffix(suffix), text.encode())


def _begun(run: RecordedRun) -> float:
    words = run.words.get(metadata.RUN, {})
    try:
        return max(_EARLIEST, datetime.fromisoformat(words["started_at"]).timestamp())
    except (KeyError, ValueError):
        return _EARLIEST


def _executed(run: RecordedRun) -> Execution | None:
    return run.execution if run.execution is not None and len(run.execution.t) else None


def _scene(bag: BagFile, run: RecordedRun, frames: Frames) -> None:
    """Send what stands still, at once and again and again."""
    execution, plan = _executed(run), run.plan
    width = line_width(window(run.scenario, plan))
    still = [("/scene", messages.MARKERS, markers(scene(run.scenario).entities, frames, width))]
    still += [(topic, messages.PATH, _path(poses, frames)) for topic, poses in _paths(run)]
    still.append(("/footprint", messages.POLYGON, _footprint(run.scenario, frames)))
    ghost = () if plan is None else nearest(run.scenario.chain, plan).entities
    if ghost:
        still.append(("/plan/nearest", messages.MARKERS, markers(ghost, frames, width)))
    rigid = frames.rigid(run.scenario.chain, _attached(run))
    bag.send("/tf_static", messages.TF, 0.0, rigid, latched=True)
    for time in np.arange(0.0, 1e-9 if execution is None else execution.t[-1] + 1e-9, _AGAIN):
        for topic, kind, message in still:
            bag.send(topic, kind, float(time), message, latched=True)


def _motion(bag: BagFile, run: RecordedRun, frames: Frames) -> None:
    """Send frames, contacts and twists at each sample to show; the start where nothing was executed."""
    chain, execution = run.scenario.chain, _executed(run)
    width = line_width(window(run.scenario, run.plan))
    if execution is None:
        shapes, samples, times = resting(chain), np.zeros(1, dtype=np.int64), np.zeros(1)
        poses, twists = run.scenario.first_pose[None], np.zeros((1, 3))
        objects = _places(chain, run.scenario.start[None])
    else:
        samples = viewed(execution)
        shapes, times = PushedContacts(chain, execution).at(samples), execution.t[samples]
        poses, twists = execution.poses[samples], execution.twists[samples]
        slipped = execution.object_poses
        objects = _places(chain, execution.load_poses[samples]) if slipped is None else slipped[samples]
    contacts = contact_messages(chain, shapes, np.zeros(len(samples), dtype=np.int64))
    attached = _attached(run)
    for time, pose, places, twist, row in zip(times.tolist(), poses, objects, twists, contacts, strict=True):
        entities = SceneUpdate.FromString(row.tobytes()).entities if run.scenario.pushes is None else ()
        bag.send("/tf", messages.TF, time, frames.moving(chain, pose, None if attached else places))
        bag.send("/contacts", messages.MARKERS, time, markers(entities, frames, width))
        bag.send("/pusher/twist", messages.TWIST, time, _twist(twist, CHAIN))
        base = se2.twist_of(chain.pusher.base_pose, twist)
        bag.send("/base/twist", messages.TWIST, time, _twist(base, frames.base))


def _attached(run: RecordedRun) -> bool:
    """Whether the objects never leave their places in the chain."""
    slipped = run.execution is not None and run.execution.object_poses is not None
    return run.scenario.pushes is None and not slipped


def _places(chain: Chain, loads: FloatArray) -> FloatArray:
    """Return the poses (k, n, 3) of the objects in the world, given those of their frame (k, 3)."""
    return se2.compose(loads[:, None], chain.places)


def _margins(bag: BagFile, run: RecordedRun, frames: Frames) -> None:
    """Send the margin of each contact as a number of its own."""
    execution = _executed(run)
    if execution is None:
        return
    for i in viewed(execution):
        for topic, margin in zip(margin_topics(run.scenario.chain), execution.margins[i], strict=True):
            bag.send(topic, messages.NUMBER, float(execution.t[i]), {"data": float(margin)})


def _log(bag: BagFile, run: RecordedRun, frames: Frames) -> None:
    for line in run.lines:
        bag.send("/log", messages.LOG, line.time, _line(line))


def _paths(run: RecordedRun) -> Iterator[tuple[str, FloatArray]]:
    if run.plan is not None and run.plan.path is not None:
        yield "/plan/path", run.plan.path.sampled(PATH_SPACING)
    if run.trajectory is not None:
        times = smoothed_times(run.trajectory)
        yield "/plan/smoothed", run.trajectory.poses_at(times)
        yield "/base/path", run.trajectory.base_poses_at(times)


def _path(poses: FloatArray, frames: Frames) -> Message:
    header = {"frame_id": frames.map}
    stamped = [
        {"header": header, "pose": {"position": {"x": x, "y": y}, "orientation": turn(theta)}}
        for x, y, theta in poses
    ]
    return {"header": header, "poses": stamped}


def _line(line: LogLine) -> Message:
    return {"level": 10 * (1 + LEVELS.index(line.level)), "name": "pushplan", "msg": line.text}


def _footprint(scenario: Scenario, frames: Frames) -> Message:
    """Return the outline of robot and plate, and of the objects if they stay there, in the frame of the base."""
    chain, attached = scenario.chain, scenario.pushes is None
    around = outline_of_all(chain.bodies if attached else chain.carried)
    corners = se2.transform_points(se2.inverse(chain.pusher.base_pose), around)
    return {
        "header": {"frame_id": frames.base},
        "polygon": {"points": [{"x": x, "y": y} for x, y in corners.tolist()]},
    }


def _twist(twist: FloatArray, frame: str) -> Message:
    vx, vy, omega = twist
    return {
        "header": {"frame_id": frame},
        "twist": {"linear": {"x": vx, "y": vy}, "angular": {"z": omega}},
    }
