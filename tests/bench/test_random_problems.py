"""Random problems: the same text for the same seed, accepted by the loader, and as the parameters say."""

import numpy as np
import pytest
import shapely

from pushplan.bench.random_problems import (
    DRIVES,
    LEAST_MARGIN,
    GeneratorError,
    generate,
    tightest_turn,
)
from pushplan.bench.schema import ProblemParameters
from pushplan.geometry.se2 import compose
from pushplan.planners.clearance import find_collision
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.model import CircleObstacle, Scenario
from pushplan.sets.named import stable_set

VARIED = ProblemParameters(drives=DRIVES, supports=("uniform", "feet"))


def _scenario(parameters: ProblemParameters, seed: int) -> Scenario:
    return scenario_from_text(generate(parameters, seed))


@pytest.mark.parametrize("seed", range(20))
def test_problems_pass_the_loader_and_their_chains_can_be_pushed(seed: int) -> None:
    scenario = _scenario(VARIED, seed)
    chain = scenario.chain
    assert 1 <= len(chain.objects) <= 5
    assert len(scenario.obstacles) <= 30
    assert stable_set(chain, "ecof").margin([[1.0, 0.0, 0.0]])[0] > LEAST_MARGIN
    assert np.isfinite(tightest_turn(chain, VARIED.turning_radius))


def test_the_same_seed_gives_the_same_text_and_another_one_another() -> None:
    texts = [generate(VARIED, seed) for seed in (3, 3, 4)]
    assert texts[0] == texts[1] != texts[2]


@pytest.mark.parametrize("seed", range(5))
def test_the_ways_out_of_the_start_and_into_the_goal_are_free(seed: int) -> None:
    parameters = ProblemParameters(obstacles=(30, 30))
    scenario = _scenario(parameters, seed)
    for pose, sense in ((scenario.start, 1.0), (scenario.goal.pose_chain, -1.0)):
        way = compose(pose, np.array([sense * parameters.room, 0.0, 0.0]))
        assert find_collision(scenario, np.array([pose, way])) is None


@pytest.mark.parametrize("seed", range(5))
def test_a_wall_with_a_gap_parts_start_from_goal(seed: int) -> None:
    parameters = ProblemParameters(gap=(1.5, 2.0), obstacles=(0, 0))
    scenario = _scenario(parameters, seed)
    assert len(scenario.obstacles) == 2
    assert not any(isinstance(piece, CircleObstacle) for piece in scenario.obstacles)
    sides = [shapely.Polygon(piece.outline) for piece in scenario.obstacles]  # type: ignore[union-attr]
    chain, pusher = scenario.chain, scenario.chain.pusher.outline
    width = np.ptp(np.concatenate([pusher, *(obj.outline_chain for obj in chain.objects)])[:, 1])
    assert 1.49 * width <= sides[0].distance(sides[1]) <= 2.01 * width
    way = shapely.LineString([scenario.start[:2], scenario.goal.pose_chain[:2]])
    assert way.intersects(shapely.union_all(sides).convex_hull)


def test_parameters_without_room_are_refused() -> None:
    with pytest.raises(GeneratorError, match="start and goal find no place in a workspace"):
        generate(ProblemParameters(workspace=(0.5, 0.5)), 1)
    with pytest.raises(GeneratorError, match="none of 10 random chains can be pushed"):
        generate(
            ProblemParameters(contact_friction=(0.0, 0.0), objects=(4, 4), pusher_friction=(0.0, 0.0)), 1
        )
    with pytest.raises(GeneratorError, match="places for the robot"):
        generate(ProblemParameters(robot=(50.0, 60.0), workspace=(3.0, 3.0), obstacles=(0, 0)), 1)


@pytest.mark.parametrize("seed", range(3))
def test_a_robot_stands_as_far_away_as_is_asked_for(seed: int) -> None:
    parameters = ProblemParameters(objects=(1, 1), obstacles=(2, 4), drives=DRIVES, robot=(0.5, 1.0))
    scenario = _scenario(parameters, seed)
    assert scenario.pushes is not None
    away = float(np.hypot(*(scenario.pushes.robot_start - scenario.start)[:2]))
    assert 0.499 < away < 1.001
    assert scenario.chain.pusher.footprint
