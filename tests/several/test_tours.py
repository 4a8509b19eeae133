"""Tours through several objects: what orders cost before any of them is planned."""

from itertools import permutations

import numpy as np
import pytest
from conftest import there
from several.test_rearrangement import LIMIT, boxes, moves, require

from pushplan.core.driving import shortest_drive
from pushplan.geometry import se2
from pushplan.planners.multi.rearrangement import RearrangementSearch
from pushplan.planners.multi.tours import Ends, Rooms, Tours
from pushplan.planners.multi.transfers import Situation
from pushplan.planners.planner import plan
from pushplan.plans.settings import PlanSettings

BOXES = {"a": ((1.0, 1.0), (1.0, 2.0)), "b": ((2.0, 1.0), (2.5, 2.0)), "c": ((3.0, 2.0), (1.0, 3.0))}


def test_a_tour_costs_what_the_cheapest_of_all_orders_costs() -> None:
    """Every order is gone through by itself, from each end of a push to each face."""
    scenario = boxes(BOXES)
    pieces = RearrangementSearch.of(scenario, PlanSettings().completed(scenario)).pieces
    poses = np.array([scenario.bodies[piece.name].start for piece in pieces])
    now = Situation(there(scenario.pushes).robot_start, poses, frozenset(range(3)))
    rooms = Rooms(pieces, now, range(3))
    ends = [Ends.of(pieces, now, k, rooms) for k in range(3)]
    wheels, inner = pieces[0].search.room(0).wheels, se2.inverse(scenario.bodies["a"].chain.pusher.plate_pose)
    begun = dict.fromkeys(range(3), np.inf)
    for order in permutations(range(3)):
        plates, costs = now.plate[None], np.zeros(1)
        for at, piece in enumerate(order):
            others = [ends[piece].waiting[k] for k in order[at + 1 :]]
            others += [ends[piece].brought[k] for k in order[:at]]
            pushes = np.max([ends[piece].costs, *others], axis=0)
            faces = se2.compose(ends[piece].entries, inner)
            ways = [
                [shortest_drive(wheels, left, face) for face in faces] for left in se2.compose(plates, inner)
            ]
            begins = (costs[:, None] + there(scenario.pushes).transit_weight * np.array(ways)).min(axis=0)
            costs, plates = (begins[:, None] + pushes).min(axis=0), ends[piece].exits
        begun[order[0]] = min(begun[order[0]], float(costs.min()))
    assert Tours.of(pieces, now).begun(now.plate, now.left) == pytest.approx(begun, abs=1e-9)


def test_a_box_in_anothers_way_is_brought_away_first() -> None:
    """The one that is nearest to the robot waits: what it costs to push it round the other one is not paid."""
    scenario = boxes({"near": ((1.0, 1.0), (1.0, 2.6)), "in its way": ((1.0, 2.0), (3.0, 2.0))})
    found = plan(scenario, first=True, time_limit=LIMIT)
    require(scenario, found)
    assert moves(found) == ["in its way", "near"]
    assert there(found.pushed_distance) < 1.6 + 2.0 + 0.2
