"""Where objects are believed to stand, whether one has moved that nothing pushed, and which are at their goals."""

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
"""So many times the patience of the settings is waited for objects that are not seen."""


TURNED = 2.0
"""So many times its tolerance an object of a row may be turned while others are yet to close onto it."""


class Standing:
    """Where all objects of a scenario are believed to stand.

    Args:
        poses: Of all objects, as stated.
        settings: See there.
        sightings: What was measured.

    Attributes:
        names: Of the objects.
        poses: (n, 3) as believed.
    """

    def __init__(self, poses: Poses, settings: ControlSettings, sightings: Sightings) -> None:
        self.names = tuple(poses)
        self.poses = np.array(list(poses.values()))
        self._settings, self._sightings = settings, sightings
        self._resting = np.full_like(self.poses, np.nan)
        self._recent: deque[FloatArray] = deque(maxlen=max(2, settings.looks // 2))

    @property
    def by_name(self) -> dict[str, FloatArray]:
        """Poses (3,) by name, as they are now."""
        return dict(zip(self.names, self.poses.copy(), strict=True))

    def columns(self, names: Iterable[str]) -> list[int]:
        """Return the numbers of some objects."""
        return [self.names.index(name) for name in names]

    def let_go(self, columns: list[int]) -> None:
        """Watch some objects no longer: they are pushed from now on."""
        self._resting[columns] = np.nan

    def put(self, columns: list[int], poses: FloatArray) -> None:
        """Take objects to be at poses (k, 3)."""
        self.poses[columns] = poses

    def measured(self, poses: FloatArray) -> None:
        """Take down measured poses (n, 3), NaN where unseen."""
        self._recent.append(poses)

    def look(self, since: float, now: float) -> bool:
        """Take over where objects were measured at rest since a time; False while that is not known of all.

        Objects that are not seen are waited for a while, then taken to stand where they were.
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
        """Tell of each object that has moved; return whether there is one.

        As for the load, several measurements tell of a slow departure, two of a quick one.
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
                    tell("moved", f"{name} stands {far} away from where it stood, and is not pushed")
                    break
        return not np.array_equal(before, self._resting, equal_nan=True)

    def _is_off(self, mean: FloatArray, count: int) -> bool:
        s = self._settings
        noise = self._sightings.noise
        most = np.maximum([s.position_slack, s.angle_slack], SLOW / math.sqrt(count) * noise) + noise
        return bool(np.hypot(mean[0], mean[1]) > most[0] or abs(mean[2]) > most[1])


class Deliveries:
    """Which objects were brought to their goals, and are there still.

    Args:
        scenario: With a goal for every object that is to be brought to one.
        settings: See there.
        standing: Where objects are believed to stand.

    Attributes:
        tolerance: Distance (m) and angle (rad) that an object may be off its goal.
    """

    def __init__(self, scenario: Scenario, settings: ControlSettings, standing: Standing) -> None:
        self._scenario, self._settings, self._standing = scenario, settings, standing
        self.tolerance = tolerance_of(scenario, settings.position_tolerance, settings.angle_tolerance)
        self._there: dict[str, FloatArray] = {}

    @property
    def names(self) -> frozenset[str]:
        """Of those that are there."""
        return frozenset(self._there)

    def aim_at(self, scenario: Scenario) -> None:
        """Go by other goals from now on: a plan for the rest of a row may give its objects other places."""
        self._scenario = scenario

    def take(self, names: Iterable[str]) -> None:
        """Take objects for delivered, where they are seen next."""
        self._there |= {name: np.full(3, np.nan) for name in names}

    def left(self) -> set[str]:
        """Return the objects that have to be pushed yet; one that was delivered and moved is one of them."""
        standing, settings = self._standing, self._settings
        wanted = set[str]()
        for name in self._scenario.goals:
            wanted |= set(self._scenario.task.by_name[name].names)
        most = dict[str, FloatArray]()
        for goal in self._scenario.task.goals:
            allowed = np.array(goal.slack(self.tolerance))
            if goal.flush and wanted - set(self._there):
                allowed[1] *= TURNED  # what is pushed flush onto it turns it
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
