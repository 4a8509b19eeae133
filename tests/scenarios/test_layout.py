"""From objects in a file to the chain: stacking, nominal and measured poses, the chain frame, contacts, trees."""

import math

import numpy as np
import pytest
import shapely
from conftest import there
from hypothesis import given, settings
from hypothesis import strategies as st
from scenarios.conftest import Changed

import pushplan
from pushplan.errors import ScenarioError
from pushplan.geometry import se2
from pushplan.scenario.file import scenario_from_document, scenario_from_text
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
    st.lists(st.tuples(st.floats(0.05, 0.5), st.floats(0.05, 0.5), st.floats(-0.8, 0.8)), min_size=1, max_size=5),
    st.floats(0.1, 1.0),
)
def test_stacked_boxes_are_flush_and_touch_as_in_shapely(
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


@given(st.floats(-0.5, 0.5), st.floats(-0.05, 0.05))
def test_an_oblique_contact_is_found_at_any_angle(lean: float, slide: float) -> None:
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


def test_frictions_come_from_the_pair_then_from_the_default_then_from_the_pusher(valid: Changed) -> None:
    def frictions(*changes: tuple[str, str]) -> list[float]:
        return [contact.friction for contact in valid.scenario(*changes).chain.contacts]

    assert frictions() == [0.55, 0.2]
    assert frictions(("  between", "  #")) == [0.55, 0.25]
    assert frictions(("[near, far], friction: 0.20", "[far, near], friction: 45 deg")) == pytest.approx([0.55, 1.0])
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


def text(objects: list[str], snap: str = "snap: 5 mm") -> str:
    """Return a scenario with measured poses."""
    return chain_file(*objects, pusher="width: 0.6, friction: 0.5") + snap + "\n"


def box(name: str, length: float, width: float, pose: tuple[float, float, float]) -> str:
    x, y, theta = (repr(float(value)) for value in pose)
    return f"name: {name}, shape: {{box: [{length!r}, {width!r}]}}, mass: 1, pose: [{x}, {y}, {theta}]"


def findings(source: str) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        scenario_from_text(source)
    return [f"{finding.where}: {finding.what}" for finding in caught.value.findings]


size = st.floats(0.08, 0.4)
errors = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))


@settings(max_examples=25)
@given(st.lists(st.tuples(size, size, st.floats(-0.4, 0.4), errors), min_size=1, max_size=5))
def test_a_perturbed_stack_snaps_back(boxes: list[tuple[float, float, float, tuple[float, float]]]) -> None:
    """Gaps up to 1.5 mm each and turns up to 1 deg, in both directions; lateral positions stay."""
    texts, x, y, before = [], 0.0, 0.0, 0.6
    for i, (length, width, share, (gap, turn)) in enumerate(boxes):
        y += 0.0 if i == 0 else share * 0.5 * (before + width)
        measured = (x + 0.5 * length + 0.0015 * gap, y, math.radians(turn))
        texts.append(box(f"b{i}", length, width, measured))
        x, before = x + length, width
    scenario = scenario_from_text(text(texts))
    x = y = 0.0
    before = 0.6
    for i, ((length, width, share, _), obj) in enumerate(zip(boxes, scenario.chain.objects, strict=True)):
        y += 0.0 if i == 0 else share * 0.5 * (before + width)
        assert obj.pose_chain == pytest.approx([x + 0.5 * length, y, 0.0], abs=1e-9)
        x, before = x + length, width
    for (_, _, _, (gap, turn)), moved in zip(boxes, there(scenario.load.snapping).objects, strict=True):
        assert moved.turn == pytest.approx(-math.radians(turn), abs=1e-9)
        assert moved.gap == pytest.approx(0.0015 * gap, abs=1e-9)
    assert scenario_from_document(scenario.resolved()) == scenario


@settings(max_examples=15)
@given(size, size, st.floats(1.05, 3.0), st.booleans(), st.sampled_from([-1.0, 1.0]))
def test_a_gap_or_turn_beyond_the_tolerance_is_an_error(
    length: float, width: float, factor: float, turned: bool, sign: float
) -> None:
    """Gap or angle alone."""
    gap, turn = (0.0, 2.0 * factor) if turned else (0.005 * factor, 0.0)
    measured = (0.1 + 0.5 * length + sign * gap, 0.0, sign * math.radians(turn))
    objects = [box("near", 0.1, 0.5, (0.05, 0.0, 0.0)), box("far", length, width, measured)]
    (finding,) = findings(text(objects))
    assert finding == (
        f"objects[1].pose: 'far' is {1e3 * gap:.3g} mm and {turn:.3g} deg from a flush contact with 'near'; snap "
        "allows 5 mm and 2 deg: move it, or give a larger snap"
    )


def test_a_near_contact_in_front_of_another_object_is_an_error() -> None:
    near = box("near", 0.1, 0.08, (0.05, 0.0, 0.0))

    def around(x: float) -> str:
        corners = [[0.0, 0.05], [x, 0.05], [x, 0.0], [0.2, 0.0], [0.2, 0.12], [0.0, 0.12]]
        return f"name: aside, shape: {{polygon: {corners}}}, mass: 1.0, pose: [0.0, 0.0, 0.0]"

    aside = around(0.1004)
    for snap in ("", "snap: 5 mm"):
        assert findings(text([near, aside], snap)) == [
            "objects[1]: 'aside' and 'near' do not touch, but are only 0.4 mm apart: a small error would make "
            "them touch; allowed: at least 1 mm, or a contact"
        ]
    scenario_from_text(text([near, around(0.101)], ""))


@pytest.mark.parametrize("gap", [0.0, 1e-4, 3e-4])
def test_lateral_contacts_and_near_contacts_are_ignored(gap: float) -> None:
    """Two by two boxes on a plate are two chains; neighbours in them do not move relative to one another."""
    rows = [(x, y) for y in (0.0, 0.08 + gap) for x in (0.05, 0.15)]
    boxes = [box(f"b{k}", 0.1, 0.08, (*row, 0.0)) for k, row in enumerate(rows)]
    block = scenario_from_text(text([boxes[0].replace("pose", "offset: -0.04, pose"), *boxes[1:]], ""))
    assert [(contact.pusher, contact.pushed) for contact in block.chain.contacts] == [
        (-1, 0),
        (0, 1),
        (-1, 2),
        (2, 3),
    ]
    plan = pushplan.plan(block, first=True, time_limit=60.0)
    assert plan.solved, plan.reason
    assert pushplan.simulate(plan, pushplan.World.from_scenario(block)).kept
