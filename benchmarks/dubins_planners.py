"""OMPL's geometric planners over Dubins' car: a chain that turns about two of its own points is such a car.

Positive combinations of a left turn about cL and a right turn about cR move m = (cL + cR) / 2 along J (cR - cL) with
curvature 2 / |cR - cL| at most: Dubins' car of radius R = |cR - cL| / 2. OMPL searches there; every edge is a word of
our own three arcs, swept by our own check, and the path consists of exactly these arcs.
"""

from __future__ import annotations

import itertools
import math
from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from ompl import base as ob
from ompl import geometric as og

from pushplan.core.collision import separations
from pushplan.core.problem import LEFT, RIGHT, STRAIGHT, TRIES, connect
from pushplan.errors import PlanningError
from pushplan.geometry import se2
from pushplan.planners.problem import Box
from pushplan.planners.search.form import PushInformation, bounds, state_at
from pushplan.planners.search.planners import AnytimePlanner
from pushplan.planners.search.session import Session
from pushplan.util.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Car:
    """The chain as Dubins' car.

    Attributes:
        family: (3, 3) left, straight and right twists, scaled to a cost rate of 1; see `steering`.
        middle: (3,) pose of the car in the chain frame: the point m and the heading J (cR - cL).
        radius: Smallest turning radius of m, m.
    """

    family: FloatArray
    middle: FloatArray
    radius: float

    @classmethod
    def from_families(cls, families: FloatArray) -> Car:
        """Return the car whose turns are those of the first family.

        Args:
            families: (f, 3, 3) left, straight and right twists; the straight ones span the stable translations.

        Raises:
            PlanningError: If there are no turns to both sides, or no stable push along J (cR - cL).
        """
        left, right = families[0, LEFT], families[0, RIGHT]
        if left[2] == 0.0 or right[2] == 0.0 or not families[:, STRAIGHT].any():
            raise PlanningError("the chain is no Dubins' car: it cannot turn to both sides and go straight")
        cors = np.array([[-twist[1], twist[0]] / twist[2] for twist in (left, right)])
        x, y = cors[1] - cors[0]
        heading = math.atan2(x, -y)
        straight = se2.rotate(-heading, families[:, STRAIGHT, :2])
        leaning = np.arctan2(straight[:, 1], straight[:, 0])
        if not leaning.min() - 1e-9 <= 0.0 <= leaning.max() + 1e-9:
            raise PlanningError(f"the chain is no Dubins' car: a push at {heading:.3f} rad is not stable")
        angle = heading + min(max(0.0, float(leaning.min())), float(leaning.max()))
        family = np.stack([left, np.array([math.cos(angle), math.sin(angle), 0.0]), right])
        return cls(family, np.append(cors.mean(axis=0), heading), 0.5 * math.hypot(x, y))

    def chain_at(self, state: Any) -> FloatArray:
        """Return the pose (3,) of the chain frame for an OMPL state of the car."""
        return se2.compose([state.getX(), state.getY(), state.getYaw()], se2.inverse(self.middle))


class SweptWords(ob.MotionValidator):  # type: ignore[misc]
    """Motion validator: whether a collision-free steering path joins two states."""

    def __init__(self, information: Any, session: Session, car: Car) -> None:
        super().__init__(information)
        self._session, self._car = session, car

    def checkMotion(self, first: Any, second: Any) -> bool:  # noqa: N802 OMPL's name
        """Return whether a collision-free steering path joins two states."""
        self._session.spent(1)
        return self.word(self._car.chain_at(first), self._car.chain_at(second)) is not None

    def word(self, begin: FloatArray, end: FloatArray) -> FloatArray | None:
        """Return the arcs (3, 4) between two poses of the chain frame; None if they are blocked."""
        return connect(self._session.problem.scene, self._car.family[None], begin, end, tries=TRIES)[2]


class OverDubins(AnytimePlanner):
    """A geometric planner over the car, run again until the search is over.

    Attributes:
        anew: Whether it begins anew after every path instead of going on.
    """

    anew: bool

    @abstractmethod
    def make(self, information: Any) -> Any:
        """Return the geometric planner for a space information."""

    def rounds(self, information: PushInformation) -> Iterator[None]:
        """Run the geometric planner again and again, and yield after each run."""
        session = information.session
        car = Car.from_families(session.problem.families)
        information.admit(car.family[STRAIGHT])
        over_car, words = _space(session, information.box, car)
        definition = ob.ProblemDefinition(over_car)
        ends = (session.start, session.problem.goal)
        definition.setStartAndGoalStates(*(state_at(over_car, se2.compose(pose, car.middle)) for pose in ends))
        planner = self.make(over_car)
        planner.setProblemDefinition(definition)
        planner.setup()
        while True:
            planner.solve(ob.PlannerTerminationCondition(session.stop))
            if definition.hasExactSolution():
                session.offer(_arcs(definition.getSolutionPath(), car, words, ends))
            session.refine()
            if self.anew:
                planner.clear()
                definition.clearSolutionPaths()
            yield


class RRTOverDubins(OverDubins):
    """RRT (LaValle and Kuffner 2001)."""

    name, anew = "rrt-dubins", True

    def make(self, information: Any) -> Any:
        planner = og.RRT(information)
        planner.setGoalBias(0.2)
        return planner


class BITStarOverDubins(OverDubins):
    """BIT* (Gammell, Srinivasa and Barfoot 2015)."""

    name, anew = "bitstar-dubins", False

    def make(self, information: Any) -> Any:
        planner = og.BITstar(information)
        planner.setStopOnSolnImprovement(True)
        planner.setUseKNearest(False)  # neighbours within a radius: ten times as many edges per second
        planner.setRewireFactor(10.0)  # the radius is made for spaces without turning circles
        return planner


def _space(session: Session, box: Box, car: Car) -> tuple[Any, SweptWords]:
    """Return OMPL's space information and the motion validator."""
    space = ob.DubinsStateSpace(car.radius)
    reach = math.hypot(car.middle[0], car.middle[1])
    space.setBounds(bounds([(box[i] - reach, box[i + 2] + reach) for i in range(2)]))
    information = ob.SpaceInformation(space)
    scene = session.problem.scene

    def valid(state: Any) -> bool:
        return bool(separations(scene, car.chain_at(state)[None], 2.0 * scene.clearance)[0] >= scene.clearance)

    words = SweptWords(information, session, car)
    information.setStateValidityChecker(valid)
    information.setMotionValidator(words)
    information.setup()
    return information, words


def _arcs(path: Any, car: Car, words: SweptWords, ends: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Return the arcs (k, 4) of our words through the states of OMPL's path."""
    poses = [ends[0], *(car.chain_at(state) for state in path.getStates()[1:-1]), ends[1]]
    arcs = [words.word(begin, end) for begin, end in itertools.pairwise(poses)]
    if any(word is None for word in arcs):
        raise PlanningError("OMPL returned a path with an edge that is not free")
    return np.concatenate([word for word in arcs if word is not None])
