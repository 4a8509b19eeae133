"""Believed object poses, detection of objects that moved without a push, and the objects that are at their goals."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable

import numpy as np

from pushplan.geometry.se2 import pose_error, wrap_angle
from pushplan.plans.goals import errors_at_goal, tolerance_of
from pushplan.plans.segment import Poses
from pushplan.scenario.model import Scenario
from pushplan.sim.control.departures import SLOW
from pushplan.sim.control.sensing import Sightings
from pushplan.sim.control.settings import ControlSettings, words
from pushplan.util.arrays import FloatArray

PATIENT = 4.0
"""Waiting time for objects that are not seen, as a multiple of the settings' patience."""


TURNED = 2.0
"""Largest turn of an object of a row, as a multiple of its tolerance, while others must still close onto it."""


class Standing:
    """Believed poses of all objects of a scenario.

    Args:
        poses: Nominal poses of all objects.
        settings: Settings of the controller.
        sightings: Recent measurements.

    Attributes:
        names: Names of the objects.
        poses: Believed poses, (n, 3).
    """

    def __init__(self, poses: Poses, settings: ControlSettings, sightings: Sightings) -> None:
        self.names = tuple(poses)
        self.poses = np.array(list(poses.values()))
        self._settings, self._sightings = settings, sightings
        self._resting = np.full_like(self.poses, np.nan)
        self._recent: deque[FloatArray] = deque(maxlen=max(2, settings.looks // 2))

    @property
    def by_name(self) -> dict[str, FloatArray]:
        """Believed poses (3,) by name."""
        return dict(zip(self.names, self.poses.copy(), strict=True))

    def columns(self, names: Iterable[str]) -> list[int]:
        """Return the indices of some objects."""
        return [self.names.index(name) for name in names]

    def let_go(self, columns: list[int]) -> None:
        """Stop watching some objects because they are pushed from now on."""
        self._resting[columns] = np.nan

    def put(self, columns: list[int], poses: FloatArray) -> None:
        """Set the believed poses (k, 3) of some objects."""
        self.poses[columns] = poses

    def measured(self, poses: FloatArray) -> None:
        """Record measured poses (n, 3), NaN for unseen objects."""
        self._recent.append(poses)

    def look(self, since: float, now: float) -> bool:
        """Set the believed poses to those measured at rest since a time; return False while some are missing.

        Objects that stay unseen for `PATIENT` times the patience keep their poses.
        """
        count, patient = self._settings.looks, PATIENT * self._settings.patience
        for k in range(len(self.names)):
            mean = self._sightings.mean(self.poses[k, None], count, since, [k])
            if mean is not None:
                self.poses[k] = self._resting[k] = mean[0]
            elif now - since < patient:
                return False
        return True

    def watch(self, tell: Callable[[str, str], None]) -> bool:
        """Report each object that has moved; return whether there is one.

        As for the load, several measurements show a slow motion, two show a quick one.
        """
        before = self._resting.copy()
        for k, name in enumerate(self.names):
            off = [poses[k] - self._resting[k] for poses in self._recent]
            off = [one for one in off if not np.isnan(one[0])]
            for last in (self._recent.maxlen or 2, 2):
                mean = np.mean(off[-last:], axis=0) if len(off) >= last else np.zeros(3)
                mean[2] = np.mean([wrap_angle(one[2]) for one in off[-last:]]) if len(off) >= last else 0.0
                if self._is_off(mean, last):
                    self.poses[k], self._resting[k] = self._resting[k] + mean, np.nan
                    far = words(float(np.hypot(*mean[:2])), abs(float(mean[2])))
                    tell("moved", f"{name} moved by {far} although it is not pushed")
                    break
        return not np.array_equal(before, self._resting, equal_nan=True)

    def _is_off(self, mean: FloatArray, count: int) -> bool:
        s = self._settings
        noise = self._sightings.noise
        most = np.maximum([s.position_slack, s.angle_slack], SLOW / math.sqrt(count) * noise) + noise
        return bool(np.hypot(mean[0], mean[1]) > most[0] or abs(mean[2]) > most[1])


class Deliveries:
    """Objects that were delivered to their goals and are still there.

    Args:
        scenario: Scenario with the goals of the objects.
        settings: Settings of the controller.
        standing: Believed poses of the objects.

    Attributes:
        tolerance: Largest distance (m) and angle (rad) of an object from its goal.
    """

    def __init__(self, scenario: Scenario, settings: ControlSettings, standing: Standing) -> None:
        self._scenario, self._settings, self._standing = scenario, settings, standing
        self.tolerance = tolerance_of(scenario, settings.position_tolerance, settings.angle_tolerance)
        self._there: dict[str, FloatArray] = {}

    @property
    def names(self) -> frozenset[str]:
        """Names of the delivered objects."""
        return frozenset(self._there)

    def aim_at(self, scenario: Scenario) -> None:
        """Use the goals of another scenario: a plan for the rest of a row can give its objects other places."""
        self._scenario = scenario

    def take(self, names: Iterable[str]) -> None:
        """Mark objects as delivered; their next measured poses are the reference."""
        self._there |= {name: np.full(3, np.nan) for name in names}

    def left(self) -> set[str]:
        """Return the objects that must still be pushed, with those that moved after their delivery."""
        standing, settings = self._standing, self._settings
        wanted = set[str]()
        for name in self._scenario.goals:
            wanted |= set(self._scenario.task.by_name[name].names)
        most = dict[str, FloatArray]()
        for goal in self._scenario.task.goals:
            allowed = np.array(goal.slack(self.tolerance))
            if goal.flush and wanted - set(self._there):
                allowed[1] *= TURNED  # an object that closes onto it turns it
            most |= {name: allowed for load in goal.names for name in self._scenario.task.by_name[load].names}
        errors = errors_at_goal(self._scenario, standing.poses)
        slack = settings.position_slack, settings.angle_slack
        for name, error in zip(standing.names, errors, strict=True):
            pose, before = standing.by_name[name], self._there.get(name)
            if before is None:
                continue
            if np.isnan(before[0]):
                self._there[name] = pose
            elif (np.array(pose_error(pose, before)) > slack).any() and (error > most[name]).any():
                del self._there[name]
        return wanted - set(self._there)
