"""A scenario whose poses are being changed: what was dragged, and the scenario that comes of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
import yaml

from pushplan.errors import PlanningError
from pushplan.geometry import se2
from pushplan.mechanics.chain import PLATE
from pushplan.scenario.builders import obstacle_document
from pushplan.scenario.file import scenario_from_document
from pushplan.scenario.model import CircleObstacle, Obstacle, PolygonObstacle, Scenario
from pushplan.util.arrays import FloatArray, frozen

_TOUCHING = 1e-6
"""Distance from the plate's front at which a corner still lies on it, m."""


@dataclass(frozen=True, eq=False)
class Draft:
    """Where things were dragged to; it need not be a scenario that can be planned in.

    Attributes:
        original: The scenario that all began with.
        start: (3,) pose in the world of the original's chain frame, which stays with the plate.
        goal: (3,) pose of the chain frame in the world at the goal, whichever object's goal the file states.
        slides: (n,) how far each object was moved to the left along its contact, with all that it carries, m.
        places: (m, 3) poses of the obstacles' frames in the world; they began unturned in their middles.
    """

    original: Scenario
    start: FloatArray
    goal: FloatArray
    slides: FloatArray
    places: FloatArray

    def __post_init__(self) -> None:
        for name, shape in (("start", (3,)), ("goal", (3,)), ("slides", (None,)), ("places", (None, 3))):
            object.__setattr__(self, name, frozen(getattr(self, name), shape, name))

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """Return a scenario of one push with nothing moved yet.

        Raises:
            PlanningError: When it asks for several pushes.
        """
        if scenario.pushes is not None:
            raise PlanningError(
                "the scenario asks for several pushes (robot.start); the window plans one push, "
                "with the plate in contact"
            )
        places = [(*middle(obstacle), 0.0) for obstacle in scenario.obstacles]
        slides = np.zeros(len(scenario.chain.objects))
        return cls(
            scenario, scenario.start, scenario.goal.pose_chain, slides, np.array(places).reshape(-1, 3)
        )

    def with_start(self, pose: FloatArray) -> Self:
        """Return the draft with the chain elsewhere at the start."""
        return self if np.array_equal(pose, self.start) else replace(self, start=pose)

    def with_goal(self, pose: FloatArray) -> Self:
        """Return the draft with the chain elsewhere at the goal."""
        return self if np.array_equal(pose, self.goal) else replace(self, goal=pose)

    def with_slide(self, index: int, slide: float) -> Self:
        """Return the draft with an object elsewhere along its contact."""
        return self if slide == self.slides[index] else replace(self, slides=_with(self.slides, index, slide))

    def with_place(self, index: int, pose: FloatArray) -> Self:
        """Return the draft with an obstacle elsewhere."""
        same = np.array_equal(pose, self.places[index])
        return self if same else replace(self, places=_with(self.places, index, pose))

    @property
    def shifts(self) -> FloatArray:
        """(n, 2) how far every object was moved in the chain frame: by itself, and by what carries it, m."""
        shifts = np.zeros((len(self.slides), 2))
        for i, contact in enumerate(self.original.chain.contacts):  # what carries comes first
            carried = shifts[contact.pusher] if contact.pusher != PLATE else 0.0
            shifts[i] = carried + self.slides[i] * contact.tangent
        return shifts

    @property
    def frame(self) -> FloatArray:
        """(2,) where the chain frame has come in the original one: to the middle of the plate's new contact, m.

        The plate stays where it is; of an object that hangs over its end only a part touches it.
        """
        aside = float(self.shifts[0, 1])
        if aside == 0.0:
            return np.zeros(2)
        chain = self.original.chain
        outline = chain.objects[0].outline_chain
        face = outline[np.abs(outline[:, 0]) < _TOUCHING, 1] + aside
        plate = chain.pusher.outline[:, 1]
        return np.array([0.0, 0.5 * (max(face.min(), plate.min()) + min(face.max(), plate.max()))])

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """What is in the way, where it was dragged to."""
        pairs = zip(self.original.obstacles, self.places, strict=True)
        return tuple(_moved(obstacle, place) for obstacle, place in pairs)

    def document(self) -> dict[str, Any]:
        """Return the draft in the form of a scenario file, nothing left open."""
        document = self.original.resolved()
        for stated, shift in zip(document["objects"], self.shifts - self.frame, strict=True):
            x, y, theta = stated["pose"]
            stated["pose"] = [x + float(shift[0]), y + float(shift[1]), theta]
        document["objects"][0]["offset"] += float(self.shifts[0, 1])
        document["start"] = se2.compose(self.start, np.array([*self.frame, 0.0])).tolist()
        document["goal"]["pose"] = self._stated_goal(document).tolist()
        document["obstacles"] = [obstacle_document(obstacle) for obstacle in self.obstacles]
        return document

    def scenario(self) -> Scenario:
        """Return the draft as a scenario.

        Raises:
            ScenarioError: With everything found wrong.
        """
        return scenario_from_document(self.document(), self.original.path, self.original.attachments)

    def to_yaml(self) -> str:
        """Return the text of a scenario file."""
        text: str = yaml.safe_dump(self.document(), sort_keys=False, default_flow_style=None, width=110)
        return text

    def _stated_goal(self, document: dict[str, Any]) -> FloatArray:
        """Return the goal as the pose of the body that the file states it for."""
        of = self.original.goal.of
        if of is None:
            return self.goal
        return se2.compose(self.goal, document["objects"][self.original.chain.index_of(of)]["pose"])


def middle(obstacle: Obstacle) -> FloatArray:
    """Return the point (2,) that an obstacle is dragged by."""
    if isinstance(obstacle, CircleObstacle):
        return obstacle.center
    return np.asarray(0.5 * (obstacle.outline.min(axis=0) + obstacle.outline.max(axis=0)))


def _moved(obstacle: Obstacle, place: FloatArray) -> Obstacle:
    began = middle(obstacle)
    if np.array_equal(place, [*began, 0.0]):
        return obstacle  # to the last bit
    if isinstance(obstacle, CircleObstacle):
        return CircleObstacle(place[:2], obstacle.radius)
    return PolygonObstacle(se2.transform_points(place, obstacle.outline - began), obstacle.unknown)


def _with(values: FloatArray, index: int, value: float | FloatArray) -> FloatArray:
    changed = values.copy()
    changed[index] = value
    return changed
