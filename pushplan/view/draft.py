"""Drafts: scenarios whose poses the user changes by dragging."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Self

import numpy as np
import yaml

from pushplan.geometry import se2
from pushplan.mechanics.chain import PLATE
from pushplan.scenario.file import scenario_from_document
from pushplan.scenario.goals import Row
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import CircleObstacle, Obstacle, PolygonObstacle
from pushplan.util.arrays import FloatArray, frozen

START, GOAL, ROBOT = "start", "goal", "robot"
"""Keys of the dragged frames of one load: its chain frame at start and goal, and the plate if it is not in contact.

For several objects, `start/NAME` and `goal/NAME` are an object's own frame. `obstacle/K` is an obstacle.
"""

MOST_DRAGGED = 40
"""Largest number of obstacles that can be dragged; with more, as in maps, they are fixed."""

_TOUCHING = 1e-6
"""Largest distance of a corner from the plate's front that counts as contact, m."""


@dataclass(frozen=True, eq=False)
class Draft:
    """A scenario with dragged poses; it need not be valid.

    Attributes:
        original: Initial scenario.
        poses: Poses (3,) of all dragged frames in the world, by key. `start` moves with the plate. The frames of
            obstacles start unrotated at their centres. All goals of one object or load move together.
        slides: (n,) displacements of the objects of a load in contact to the left along their contacts, m; each also
            moves the objects that it pushes. Empty for other loads.
    """

    original: Scenario
    poses: Mapping[str, FloatArray]
    slides: FloatArray

    def __post_init__(self) -> None:
        poses = {key: frozen(pose, (3,), key) for key, pose in self.poses.items()}
        object.__setattr__(self, "poses", MappingProxyType(poses))
        object.__setattr__(self, "slides", frozen(self.slides, (None,), "slides"))

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """Return the draft of a scenario before any move."""
        poses: dict[str, FloatArray] = {}
        task = scenario.task
        if task.one_load:
            poses |= {START: scenario.start, GOAL: scenario.goal.pose_chain}
        else:
            poses |= {f"{START}/{load.name}": load.pose for load in scenario.loads}
            poses |= {f"{GOAL}/{name}": goals[0].pose for name, goals in scenario.goals.items()}
            rows = (goal for goal in task.goals if isinstance(goal, Row))
            poses |= {f"{GOAL}/row": row.pose for row in rows if row.pose is not None}
        if not task.held:
            poses[ROBOT] = scenario.plate_start
        for k, obstacle in enumerate(scenario.obstacles):
            poses[f"obstacle/{k}"] = np.array([*obstacle.box.mean(axis=0), 0.0])
        return cls(scenario, poses, np.zeros(sum(len(load.names) for load in task.held)))

    def moved(self, key: str, pose: FloatArray) -> Self:
        """Return the draft with another pose of a frame."""
        same = np.array_equal(pose, self.poses[key])
        return self if same else replace(self, poses={**self.poses, key: np.asarray(pose, dtype=np.float64)})

    def slid(self, index: int, slide: float) -> Self:
        """Return the draft with another displacement of an object along its contact."""
        if slide == self.slides[index]:
            return self
        slides = self.slides.copy()
        slides[index] = slide
        return replace(self, slides=slides)

    @property
    def shifts(self) -> FloatArray:
        """(n, 2) displacements of the objects in the chain frame, m, including those of their pushing objects."""
        shifts = np.zeros((len(self.slides), 2))
        for i in range(len(self.slides)):  # pushing objects come before pushed ones
            contact = self.original.chain.contacts[i]
            carried = shifts[contact.pusher] if contact.pusher != PLATE else 0.0
            shifts[i] = carried + self.slides[i] * contact.tangent
        return shifts

    @property
    def frame(self) -> FloatArray:
        """(2,) position of the new chain frame, the middle of the plate's new contact, in the original one, m.

        The plate does not move. Only a part of an object that overhangs the plate's end touches it.
        """
        aside = float(self.shifts[0, 1]) if len(self.slides) else 0.0
        if aside == 0.0:
            return np.zeros(2)
        chain = self.original.chain
        outline = chain.objects[0].outline_chain
        face = outline[np.abs(outline[:, 0]) < _TOUCHING, 1] + aside
        plate = chain.pusher.outline[:, 1]
        return np.array([0.0, 0.5 * (max(face.min(), plate.min()) + min(face.max(), plate.max()))])

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """Obstacles at their dragged poses."""
        each = enumerate(self.original.obstacles)
        return tuple(_moved(obstacle, self.poses[f"obstacle/{k}"]) for k, obstacle in each)

    def document(self) -> dict[str, Any]:
        """Return the draft as the complete document of a scenario file."""
        document = self.original.resolved()
        if self.original.task.one_load:
            self._move_load(document)
        else:
            for stated in document["objects"]:
                stated["pose"] = self.poses[f"{START}/{stated['name']}"].tolist()
            if f"{GOAL}/row" in self.poses:
                document["goals"]["row"]["pose"] = self.poses[f"{GOAL}/row"].tolist()
            for name, goals in self.original.goals.items():
                for goal in document["goals"][name]:
                    pose = se2.compose(self.poses[f"{GOAL}/{name}"], se2.relative(goals[0].pose, goal["pose"]))
                    goal["pose"] = pose.tolist()
        if ROBOT in self.poses:
            document["robot"]["start"] = self.poses[ROBOT].tolist()
        document["obstacles"] = [obstacle.document() for obstacle in self.obstacles]
        return document

    def _move_load(self, document: dict[str, Any]) -> None:
        if len(self.slides):
            for stated, shift in zip(document["objects"], self.shifts - self.frame, strict=True):
                x, y, theta = stated["pose"]
                stated["pose"] = [x + float(shift[0]), y + float(shift[1]), theta]
            document["objects"][0]["offset"] += float(self.shifts[0, 1])
        document["start"] = se2.compose(self.poses[START], np.array([*self.frame, 0.0])).tolist()
        goals = document["goal"] if isinstance(document["goal"], list) else [document["goal"]]
        chain, first = self.original.chain, self.original.goal.pose_chain
        for stated, goal in zip(goals, self.original.goals[self.original.load.name], strict=True):
            pose = se2.compose(self.poses[GOAL], se2.relative(first, goal.pose_chain))
            if goal.of is not None:
                pose = se2.compose(pose, document["objects"][chain.index_of(goal.of)]["pose"])
            stated["pose"] = pose.tolist()

    def scenario(self) -> Scenario:
        """Return the draft as a scenario.

        Raises:
            ScenarioError: If it is not valid, with all errors.
        """
        return scenario_from_document(self.document(), self.original.path, self.original.attachments)

    def to_yaml(self) -> str:
        """Return the text of a scenario file."""
        text: str = yaml.safe_dump(self.document(), sort_keys=False, default_flow_style=None, width=110)
        return text


def _moved(obstacle: Obstacle, place: FloatArray) -> Obstacle:
    began = obstacle.box.mean(axis=0)
    if np.array_equal(place, [*began, 0.0]):
        return obstacle  # exactly the same numbers
    if isinstance(obstacle, CircleObstacle):
        return CircleObstacle(place[:2], obstacle.radius)
    return PolygonObstacle(se2.transform_points(place, obstacle.outline - began), obstacle.unknown)
