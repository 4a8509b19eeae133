"""The scene of the window: bodies, obstacles, what they are dragged by, and the plan, drawn with viser."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import shapely
import trimesh

from pushplan.drawing.palette import GOAL, PATH, red_green_blue
from pushplan.geometry import se2
from pushplan.logging.view.scene import obstacle_outline
from pushplan.logging.view.shapes import body_colours
from pushplan.mechanics.chain import Chain
from pushplan.util.arrays import FloatArray
from pushplan.view.draft import Draft, middle

MOST_DRAGGED = 40
"""Obstacles up to which each is dragged by handles of its own; those of a map stand still."""

_HEIGHT = 0.04
"""Of all bodies in the picture, m."""
_OBSTACLE, _UNKNOWN = "#8b8f96", "#c9c3b4"
_CELL = 0.5
"""Between the lines of the floor, m."""
_FLOOR = 10.0
"""Half the side of the floor of a room without walls, m."""
_AMBIENT, _SUN = 1.8, 1.6
"""Strengths of the lights, in viser's measure: colours of the top look as in other pictures."""
_OUTLINES = 12
"""Places along a plan at which the chain is outlined."""

Moved = Callable[[FloatArray, bool], None]
"""Called with the pose (3,) of a handle, and whether it was let go."""


class Stage:
    """What is seen of a draft and its plan.

    Args:
        scene: The scene of a viser server.
        draft: What is shown at first.

    Attributes:
        handle_size: Length of the arrows that things are dragged by, m.
    """

    def __init__(self, scene: Any, draft: Draft) -> None:
        self._scene = scene
        self._drawn: dict[str, Any] = {}
        self.handle_size = 0.8 * draft.original.chain.reach
        scene.set_up_direction("+z")
        # Without a graphics card shadows cost most of the time; viser's lights, standard material and grid cost
        # half of the rest (a picture took 44 ms, and takes 26, on two cores).
        scene.configure_default_lights(enabled=False)
        scene.add_light_ambient("/lights/ambient", intensity=_AMBIENT)
        scene.add_light_directional("/lights/sun", intensity=_SUN, position=(-0.5, -0.8, 2.0))
        self._floor(draft)
        self._chain = draft.original.chain
        self._played = scene.add_frame("/played", show_axes=False, visible=False)

    def handle(
        self,
        name: str,
        pose: FloatArray,
        moved: Moved,
        axes: tuple[bool, bool, bool] = (True, True, False),
        arrows: bool = True,
    ) -> None:
        """Add handles that drag what hangs under `name` along some axes, which arrows show or not."""
        controls = self._scene.add_transform_controls(
            name,
            scale=self.handle_size,
            active_axes=axes,
            disable_axes=not arrows,
            depth_test=False,
            **_placed(pose),
        )

        async def update(event: Any) -> None:  # on the server's loop, so that the order of events is kept
            moved(_pose(event.target), event.phase == "end")

        controls.on_update(update)

    def draw_obstacles(self, draft: Draft) -> None:
        """Draw each obstacle under its own frame, about its middle."""
        for i, (obstacle, place) in enumerate(zip(draft.original.obstacles, draft.places, strict=True)):
            name = f"/obstacle{i}"
            if len(draft.places) > MOST_DRAGGED:
                self._scene.add_frame(name, show_axes=False, **_placed(place))
            colour = _UNKNOWN if getattr(obstacle, "unknown", False) else _OBSTACLE
            self._body(f"{name}/body", obstacle_outline(obstacle) - middle(obstacle), colour)

    def draw_chain(self, chain: Chain, frame: FloatArray) -> None:
        """Draw the chain at the start, where its frame is `frame` (2,) aside, at the goal and as it is played."""
        self._chain = chain
        for k, (body, colour) in enumerate(zip(chain.bodies, body_colours(chain), strict=True)):
            self._body(f"/start/body{k}", body.outline + frame, colour)
            self._body(f"/goal/body{k}", body.outline, GOAL, opacity=0.35)
            self._body(f"/played/body{k}", body.outline, colour, z=0.002)

    def draw_plan(self, poses: FloatArray | None) -> None:
        """Draw the way (k, 3) of the chain frame, and the chain's outline along it; None stands for no plan."""
        points = np.zeros((2, 2)) if poses is None else poses[:, :2]
        outlines = [] if poses is None else self._outlines(poses)
        self._lines("/plan/way", np.stack([points[:-1], points[1:]], axis=1), PATH, 4.0, poses is not None)
        segments = np.concatenate(outlines) if outlines else np.zeros((1, 2, 2))
        self._lines("/plan/outlines", segments, PATH, 1.0, bool(outlines))

    def show_played(self, pose: FloatArray | None) -> None:
        """Put the chain that plays the plan somewhere, or take it away."""
        self._played.visible = pose is not None
        if pose is not None:
            for name, value in _placed(pose).items():
                setattr(self._played, name, value)

    @property
    def played(self) -> FloatArray | None:
        """Where the chain that plays the plan is, (3,); None when nothing is played."""
        return _pose(self._played) if self._played.visible else None

    def _outlines(self, poses: FloatArray) -> list[FloatArray]:
        chosen = poses[np.linspace(0, len(poses) - 1, _OUTLINES).round().astype(int)]
        return [
            np.stack([outline, np.roll(outline, -1, axis=0)], axis=1)
            for pose in chosen
            for outline in self._chain.outlines_at(pose)
        ]

    def _lines(
        self,
        name: str,
        segments: FloatArray,
        colour: str,
        width: float,
        visible: bool,
        z: float = 1.2 * _HEIGHT,
    ) -> None:
        points = np.concatenate([segments, np.full((*segments.shape[:2], 1), z)], axis=2)
        if (
            name in self._drawn
        ):  # made anew, the browser compiles its shader again: 50 ms without a graphics card
            self._drawn[name].points, self._drawn[name].visible = points.astype(np.float32), visible
            return
        look = {"thickness": width, "thickness_units": "screen", "visible": visible}
        self._drawn[name] = self._scene.add_line_segments(name, points, red_green_blue(colour), **look)

    def _body(
        self, name: str, outline: FloatArray, colour: str, opacity: float | None = None, z: float = 0.0
    ) -> None:
        vertices, faces = _solid(outline)
        self._scene.add_mesh_simple(
            name,
            vertices + np.array([0.0, 0.0, z]),
            faces,
            color=red_green_blue(colour),
            opacity=opacity,
            material="toon3",
            flat_shading=True,
            side="double",
            cast_shadow=False,
        )

    def _floor(self, draft: Draft) -> None:
        area = draft.original.workspace
        low, high = (
            (np.full(2, -_FLOOR), np.full(2, _FLOOR))
            if area is None
            else (np.array([area.xmin, area.ymin]), np.array([area.xmax, area.ymax]))
        )
        self._lines("/floor", _grid(low, high), "#d8dade", 1.0, True, z=0.0)
        if area is not None:
            ring = np.stack([area.outline, np.roll(area.outline, -1, axis=0)], axis=1)
            self._lines("/walls", ring, _OBSTACLE, 3.0, True)


def _grid(low: FloatArray, high: FloatArray) -> FloatArray:
    """Return lines (k, 2, 2) half a metre apart over a rectangle."""
    lines = []
    for axis in (0, 1):
        for at in np.arange(np.ceil(low[axis] / _CELL), np.floor(high[axis] / _CELL) + 1) * _CELL:
            line = np.array([low, high])
            line[:, axis] = at
            lines.append(line)
    return np.array(lines).reshape(-1, 2, 2)


def _solid(outline: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return vertices (v, 3) and triangles (f, 3) of a simple polygon made as high as bodies are."""
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(shapely.Polygon(outline)))
    rings = shapely.get_coordinates(shapely.orient_polygons(triangles)).reshape(-1, 4, 2)[:, :3]
    points, index = np.unique(rings.reshape(-1, 2), axis=0, return_inverse=True)
    solid = trimesh.creation.extrude_triangulation(points, index.reshape(-1, 3), _HEIGHT)
    return np.asarray(solid.vertices), np.asarray(solid.faces)


def _placed(pose: FloatArray) -> dict[str, Any]:
    """Return a pose in the plane in viser's words."""
    half = 0.5 * float(pose[2])
    return {
        "position": (float(pose[0]), float(pose[1]), 0.0),
        "wxyz": (np.cos(half), 0.0, 0.0, np.sin(half)),
    }


def _pose(node: Any) -> FloatArray:
    """Return the pose (3,) in the plane of something in the scene."""
    w, _, _, z = node.wxyz
    angle = float(se2.wrap_angle(2.0 * np.arctan2(z, w)))
    return np.array([node.position[0], node.position[1], angle])
