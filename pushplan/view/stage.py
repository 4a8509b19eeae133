"""Contents of the window: the scene of a draft and its plan, drawn with viser."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import shapely
import trimesh

from pushplan.drawing import palette
from pushplan.drawing.scene import Line, Scene, piece_colours
from pushplan.geometry import se2
from pushplan.mechanics.chain import BodyKind
from pushplan.util.arrays import FloatArray
from pushplan.view.draft import GOAL, MOST_DRAGGED, ROBOT, START, Draft
from pushplan.view.tone import of_body, of_line

_HEIGHT = 0.04
"""Height of all bodies, m."""
_PLAYED = 0.002
"""Height of the bodies that play the plan above the other bodies, m."""
_CELL = 0.5
"""Distance between the lines of the floor, m."""
_GRID = "#bcc1c7"
"""Colour of these lines for light and dark backgrounds: the server does not know which one is used."""
_FLOOR = 10.0
"""Half side of the floor without walls, m."""
_AMBIENT, _SUN = 5.0, 4.4
"""Intensities of the lights in viser's units; `tone.LIGHT` was measured with them."""
_OUTLINES = 12
"""Number of outlines of the chain along a single push."""

Moved = Callable[[FloatArray, bool], None]
"""Function that receives the pose (3,) of a handle, and whether the user has dropped it."""


class Stage:
    """Drawn contents of the window: a draft and its plan.

    Args:
        scene: Scene of a viser server.
        draft: Initial draft.

    Attributes:
        handle_size: Length of the arrows of handles, m.
    """

    def __init__(self, scene: Any, draft: Draft) -> None:
        self._scene = scene
        self._drawn: dict[str, Any] = {}
        self._handles: dict[str, tuple[Any, Moved]] = {}
        self._obstacles: list[tuple[Any, str]] = []
        self.handle_size = 0.8 * max(load.chain.reach for load in draft.original.loads)
        scene.set_up_direction("+z")
        # Without a graphics card, shadows take most of the time. Without viser's lights, standard material and grid,
        # the rest takes 26 ms a picture instead of 44 ms (two cores).
        scene.configure_default_lights(enabled=False)
        scene.add_light_ambient("/lights/ambient", intensity=_AMBIENT)
        scene.add_light_directional("/lights/sun", intensity=_SUN, position=(-0.5, -0.8, 2.0))
        drawn = Scene.of(draft.original)
        self._floor(drawn)
        frames = (f"/played/{k}" for k in range(len(drawn.bodies)))
        self._played = [scene.add_frame(name, show_axes=False, visible=False) for name in frames]

    def handle(
        self,
        name: str,
        pose: FloatArray,
        moved: Moved,
        axes: tuple[bool, bool, bool] = (True, True, False),
        arrows: bool = True,
    ) -> None:
        """Add handles that drag all children of `name` along some axes, with or without arrows."""
        controls = self._scene.add_transform_controls(
            name, scale=self.handle_size, active_axes=axes, disable_axes=not arrows, depth_test=False, **_placed(pose)
        )

        async def update(event: Any) -> None:  # async runs on the server's loop and keeps the order of events
            now = _pose(event.target)
            if np.isfinite(now).all():  # a page can send any value
                moved(now, event.phase == "end")

        controls.on_update(update)
        self._handles[name] = controls, moved

    def _dragged_itself(self, mesh: Any, name: str) -> None:
        """Make a body draggable with the mouse; its parent frame moves with it."""
        if name not in self._handles:  # a fixed obstacle of a map
            return
        controls, moved = self._handles[name]
        held: dict[str, FloatArray] = {}

        async def drag(event: Any) -> None:
            if event.phase == "start":
                held.update(pose=_pose(controls), point=np.array(event.start_position))
            if not held:
                return
            shift = (np.array(event.end_position) - held["point"])[:2]
            pose = held["pose"] + [*shift, 0.0]
            if np.isfinite(pose).all():
                controls.position = (float(pose[0]), float(pose[1]), 0.0)
                moved(pose, event.phase == "end")

        mesh.on_drag(drag)

    def draw_obstacles(self, draft: Draft) -> None:
        """Draw each obstacle as a child of its own frame."""
        for k, one in enumerate(Scene.of(draft.original).obstacles):
            key = f"obstacle/{k}"
            place = Draft.of(draft.original).poses[key]
            if len(draft.original.obstacles) > MOST_DRAGGED:
                self._scene.add_frame(f"/{key}", show_axes=False, **_placed(place))
            colour = palette.mixed(one.colour, "#ffffff", 0.5) if one.unknown else one.colour
            mesh = self._body(f"/{key}/body", se2.transform_points(se2.inverse(place), one.outline), colour)
            self._dragged_itself(mesh, f"/{key}")
            self._obstacles.append((mesh, colour))

    def tint(self, blocking: frozenset[int]) -> None:
        """Tint only the obstacles with these indices, which are in the way of a plan."""
        for k, (mesh, colour) in enumerate(self._obstacles):
            wanted = of_body(palette.BLOCKING if k in blocking else colour)
            if mesh.color != wanted:
                mesh.color = wanted

    def draw_bodies(self, draft: Draft, scene: Scene) -> None:
        """Draw bodies and goals as children of their handles, and the bodies that play the plan."""
        for k, (body, pose) in enumerate(zip(scene.bodies, scene.start, strict=True)):
            key = _key_of(draft, body.name, body.kind)
            local = se2.relative(draft.poses[key], pose)
            mesh = self._body(f"/{key}/body{k}", se2.transform_points(local, body.outline), body.colour)
            self._dragged_itself(mesh, f"/{key}")
            self._body(f"/played/{k}/body", body.outline, body.colour, z=_PLAYED)
        for k, goal in enumerate(scene.goals):
            known = [name for name in (GOAL, f"{GOAL}/{goal.name}", f"{GOAL}/row") if name in draft.poses]
            key = known[0] if known else f"{GOAL}/{goal.name}"  # the goal of a row at a wall has no pose
            outline = se2.transform_points(se2.inverse(draft.poses.get(key, np.zeros(3))), goal.outline)
            tinted = palette.mixed(goal.colour, palette.GOAL, 0.5)
            self._dragged_itself(self._body(f"/{key}/body{k}", outline, tinted, opacity=0.5), f"/{key}")
            ring = np.stack([outline, np.roll(outline, -1, axis=0)], axis=1)
            self._lines(f"/{key}/edge{k}", ring, [palette.GOAL] * len(ring), 3.0)

    def draw_plan(self, scene: Scene | None) -> None:
        """Draw the plate's path and the outlines of the bodies along it; None removes them."""
        lines: Sequence[Line] = () if scene is None else scene.lines
        for kind, width in ((True, 4.0), (False, 2.0)):
            chosen = [line for line in lines if line.pushes is kind and len(line.points) > 1]
            pieces = [np.stack([line.points[:-1], line.points[1:]], axis=1) for line in chosen]
            colours = [
                colour
                for line in chosen
                for colour in (piece_colours(line.margins) if kind else [palette.ALONE] * (len(line.points) - 1))
            ]
            name = "/plan/pushed" if kind else "/plan/alone"
            self._lines(name, np.concatenate(pieces) if pieces else np.zeros((0, 2, 2)), colours, width)
        rings = [] if scene is None else [np.stack([one, np.roll(one, -1, axis=0)], axis=1) for one in _along(scene)]
        edges = np.concatenate(rings) if rings else np.zeros((0, 2, 2))
        self._lines("/plan/outlines", edges, [palette.PATH] * len(edges), 1.0)

    def show_played(self, poses: FloatArray | None) -> None:
        """Show the bodies that play the plan at poses (b, 3); None hides them."""
        for k, frame in enumerate(self._played):
            frame.visible = poses is not None
            if poses is not None:
                for name, value in _placed(poses[k]).items():
                    setattr(frame, name, value)

    @property
    def played(self) -> FloatArray | None:
        """(b, 3) poses of the bodies that play the plan; None if nothing is played."""
        return np.array([_pose(frame) for frame in self._played]) if self._played[0].visible else None

    def _lines(
        self, name: str, segments: FloatArray, colours: Sequence[str], width: float, z: float = 1.2 * _HEIGHT
    ) -> None:
        visible = len(segments) > 0
        if not visible:
            segments, colours = np.zeros((1, 2, 2)), [palette.FAINT]
        points = np.concatenate([segments, np.full((*segments.shape[:2], 1), z)], axis=2).astype(np.float32)
        paints = np.repeat(np.array([of_line(one) for one in colours], dtype=np.uint8)[:, None], 2, axis=1)
        if name in self._drawn:  # new lines would compile a shader in the browser: 50 ms without a graphics card
            drawn = self._drawn[name]
            drawn.points, drawn.colors, drawn.visible = points, paints, visible
            return
        look = {"thickness": width, "thickness_units": "screen", "visible": visible}
        self._drawn[name] = self._scene.add_line_segments(name, points, paints, **look)

    def _body(self, name: str, outline: FloatArray, colour: str, opacity: float | None = None, z: float = 0.0) -> Any:
        vertices, faces = _solid(outline)
        return self._scene.add_mesh_simple(
            name,
            vertices + np.array([0.0, 0.0, z]),
            faces,
            color=of_body(colour),
            opacity=opacity,
            material="toon3",
            flat_shading=True,
            side="double",
            cast_shadow=False,
        )

    def _floor(self, scene: Scene) -> None:
        walls = scene.walls
        low, high = (
            (np.full(2, -_FLOOR), np.full(2, _FLOOR)) if walls is None else (walls.min(axis=0), walls.max(axis=0))
        )
        grid = _grid(low, high)
        self._lines("/floor", grid, [_GRID] * len(grid), 1.0, z=0.0)
        if walls is not None:
            ring = np.stack([walls, np.roll(walls, -1, axis=0)], axis=1)
            self._lines("/walls", ring, [palette.WALL] * len(ring), 3.0)


def _key_of(draft: Draft, name: str, kind: BodyKind) -> str:
    if kind is not BodyKind.OBJECT:
        return ROBOT if ROBOT in draft.poses else START
    return START if START in draft.poses else f"{START}/{name}"


def _along(scene: Scene) -> list[FloatArray]:
    """Return the outlines of the bodies along a single push, or of the moved objects after each of several pushes."""
    if len(scene.rests) > 1 or len(scene.t) == 1:
        return [
            body.at(pose)
            for rest in scene.rests
            for body, pose in zip(scene.bodies, rest.poses, strict=True)
            if body.name in rest.names or len(scene.rests) == 1
        ]
    chosen = np.linspace(0, len(scene.t) - 1, _OUTLINES).round().astype(int)
    return [outline for k in chosen for outline in scene.outlines(scene.poses[k])]


def _grid(low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the grid lines (k, 2, 2) over a rectangle, `_CELL` apart."""
    lines = []
    for axis in (0, 1):
        for at in np.arange(np.ceil(low[axis] / _CELL), np.floor(high[axis] / _CELL) + 1) * _CELL:
            line = np.array([low, high])
            line[:, axis] = at
            lines.append(line)
    return np.array(lines).reshape(-1, 2, 2)


def _solid(outline: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return vertices (v, 3) and triangles (f, 3) of a simple polygon extruded to `_HEIGHT`."""
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(shapely.Polygon(outline)))
    rings = shapely.get_coordinates(shapely.orient_polygons(triangles)).reshape(-1, 4, 2)[:, :3]
    points, index = np.unique(rings.reshape(-1, 2), axis=0, return_inverse=True)
    solid = trimesh.creation.extrude_triangulation(points, index.reshape(-1, 3), _HEIGHT)
    return np.asarray(solid.vertices), np.asarray(solid.faces)


def _placed(pose: FloatArray) -> dict[str, Any]:
    """Return a planar pose as viser's position and quaternion."""
    half = 0.5 * float(pose[2])
    return {"position": (float(pose[0]), float(pose[1]), 0.0), "wxyz": (np.cos(half), 0.0, 0.0, np.sin(half))}


def _pose(node: Any) -> FloatArray:
    """Return the planar pose (3,) of a node of the scene."""
    w, _, _, z = node.wxyz
    angle = float(se2.wrap_angle(2.0 * np.arctan2(z, w)))
    return np.array([node.position[0], node.position[1], angle])
