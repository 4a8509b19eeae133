"""From objects in a file to the chain: stacking, stated poses, the chain frame, contacts, trees."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from scenarios.conftest import Changed

from pushplan.errors import ScenarioError
from pushplan.geometry import se2
from pushplan.mechanics.chain import PLATE
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.model import Scenario


def chain_file(*objects: str, pusher: str = "width: 0.4, friction: 0.5") -> str:
    """Return a scenario in free space with these objects."""
    listed = "\n".join(f"  - {{{text}}}" for text in objects)
    return (
        f"format: pushplan/1\nfloor: {{friction: 0.3}}\nobjects:\n{listed}\n"
        f"contacts: {{friction: 0.4}}\npusher: {{{pusher}}}\ngoal: {{pose: [5, 5, 0]}}\n"
    )


def load(*objects: str, pusher: str = "width: 0.4, friction: 0.5") -> Scenario:
    return scenario_from_text(chain_file(*objects, pusher=pusher))


@given(
    st.lists(
        st.tuples(st.floats(0.05, 0.5), st.floats(0.05, 0.5), st.floats(-0.8, 0.8)), min_size=1, max_size=5
    ),
    st.floats(0.1, 1.0),
)
def test_stacked_boxes_lie_flush_and_touch_where_shapely_says(
    boxes: list[tuple[float, float, float]], plate: float
) -> None:
    texts, before = [], plate
    for i, (length, width, share) in enumerate(boxes):
        offset = share * 0.5 * (before + width)
        texts.append(f"name: b{i}, shape: {{box: [{length}, {width}]}}, mass: 1, offset: {offset}")
        before = width
    chain = load(*texts, pusher=f"width: {plate}, friction: 0.5").chain
    outlines = [chain.pusher.outline, *(obj.outline_chain for obj in chain.objects)]
    for contact, rear, front in zip(chain.contacts, outlines, outlines[1:], strict=False):
        assert contact.pusher == contact.pushed - 1
        low, high = max(rear[:, 1].min(), front[:, 1].min()), min(rear[:, 1].max(), front[:, 1].max())
        np.testing.assert_allclose([contact.right[1], contact.left[1]], [low, high], atol=1e-9)
        assert contact.right[0] == pytest.approx(rear[:, 0].max(), abs=1e-9)
        np.testing.assert_allclose(contact.normal, [1.0, 0.0], atol=1e-9)
        assert shapely.intersection(shapely.Polygon(rear), shapely.Polygon(front)).area < 1e-12
    np.testing.assert_allclose(chain.contacts[0].left + chain.contacts[0].right, 0.0, atol=1e-9)
    assert np.ptp(chain.pusher.outline[:, 1]) == pytest.approx(plate)


def test_stacking_follows_the_frame_of_a_turned_object() -> None:
    chain = load(
        "name: a, shape: {polygon: [[0, -0.1], [0.2, -0.1], [0.2, 0.1], [0, 0.1]]}, mass: 1",
        "name: b, shape: {polygon: [[-0.1, -0.05], [0.1, -0.05], [0.1, 0.05], [-0.1, 0.05]]}, mass: 1, "
        "pose: [0.25, 0, 90 deg]",
        "name: c, shape: {box: [0.1, 0.04]}, mass: 1, pose: [0.25, 0.15, 90 deg]",
        "name: d, shape: {box: [0.1, 0.04]}, mass: 1, offset: 0.01",
    ).chain
    assert [contact.pusher for contact in chain.contacts] == [PLATE, 0, 1, 2]
    np.testing.assert_allclose(chain.contacts[2].normal, [0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(chain.objects[3].pose_chain, [0.24, 0.25, math.pi / 2], atol=1e-12)


@given(st.floats(-0.5, 0.5), st.floats(-0.05, 0.05))
def test_a_leaning_contact_is_found_at_any_angle(lean: float, slide: float) -> None:
    tip = 0.3 + 0.1 * math.tan(lean)
    base = 0.3 - 0.1 * math.tan(lean)
    along = np.array([-math.sin(lean), math.cos(lean)])
    x, y = (np.array([0.3, 0.0]) + slide * along).tolist()
    chain = load(
        f"name: a, shape: {{polygon: [[0, -0.1], [{tip!r}, -0.1], [{base!r}, 0.1], [0, 0.1]]}}, mass: 1",
        f"name: b, shape: {{polygon: [[0, -0.03], [0.1, -0.03], [0.1, 0.03], [0, 0.03]]}}, mass: 1, "
        f"pose: [{x!r}, {y!r}, {lean!r}]",
    ).chain
    contact = chain.contacts[1]
    np.testing.assert_allclose(contact.normal, [math.cos(lean), math.sin(lean)], atol=1e-6)
    assert contact.length == pytest.approx(0.06, abs=1e-6)
    np.testing.assert_allclose(0.5 * (contact.left + contact.right), [x, y], atol=1e-6)


def test_a_loop_is_refused_with_the_reason() -> None:
    with pytest.raises(
        ScenarioError, match="'c' touches 'a' and 'b': how a loop of contacts shares its forces"
    ):
        load(
            "name: a, shape: {box: [0.1, 0.1]}, mass: 1, offset: 0.1",
            "name: b, shape: {box: [0.1, 0.1]}, mass: 1, pose: [0.05, -0.2, 0]",
            "name: c, shape: {box: [0.1, 0.4]}, mass: 1, pose: [0.15, -0.1, 0]",
        )


def test_an_object_in_a_corner_of_another_is_refused() -> None:
    corner = "[[0, -0.1], [0.3, -0.1], [0.3, -0.05], [0.1, -0.05], [0.1, 0.1], [0, 0.1]]"
    with pytest.raises(ScenarioError, match="'b' touches 'a' along 2 lines; allowed: one straight line"):
        load(
            f"name: a, shape: {{polygon: {corner}}}, mass: 1",
            "name: b, shape: {box: [0.1, 0.1]}, mass: 1, pose: [0.15, 0, 0]",
        )


def test_frictions_come_from_the_pair_then_from_the_default_then_from_the_pusher(valid: Changed) -> None:
    def frictions(*changes: tuple[str, str]) -> list[float]:
        return [contact.friction for contact in valid.scenario(*changes).chain.contacts]

    assert frictions() == [0.55, 0.2]
    assert frictions(("  between", "  #")) == [0.55, 0.25]
    assert frictions(("[near, far], friction: 0.20", "[far, near], friction: 45 deg")) == pytest.approx(
        [0.55, 1.0]
    )
    assert frictions(("[near, far], friction: 0.20", "[pusher, near], friction: 0.9")) == [0.9, 0.25]


@given(st.floats(-3.0, 3.0), st.floats(0.3, 1.5), st.floats(-3.1, 3.1))
def test_the_goal_of_an_object_brings_that_object_there(x: float, y: float, theta: float) -> None:
    text = chain_file(
        "name: a, shape: {box: [0.1, 0.2]}, mass: 1, offset: 0.05",
        "name: b, shape: {box: [0.2, 0.1]}, mass: 1, offset: -0.02",
    )
    scenario = scenario_from_text(text.replace("{pose: [5, 5, 0]}", f"{{pose: [{x}, {y}, {theta}], of: b}}"))
    reached = se2.compose(scenario.goal.pose_chain, scenario.chain.objects[1].pose_chain)
    np.testing.assert_allclose(reached, [x, y, theta], atol=1e-12)
    np.testing.assert_array_equal(scenario.goal.pose, [x, y, theta])
