"""Measured poses: objects are moved onto the contacts that they nearly have, or it is told why not."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pushplan.cli.check import rows
from pushplan.errors import ScenarioError
from pushplan.mechanics.chain import PLATE
from pushplan.scenario.file import scenario_from_document, scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray


def text(objects: list[str], snap: str = "snap: 5 mm", pusher: str = "width: 0.6, friction: 0.5") -> str:
    listed = "\n".join(f"  - {{{one}}}" for one in objects)
    return (
        f"format: pushplan/1\nfloor: {{friction: 0.3}}\n{snap}\nobjects:\n{listed}\n"
        f"contacts: {{friction: 0.4}}\npusher: {{{pusher}}}\ngoal: {{pose: [5, 5, 0]}}\n"
    )


def box(name: str, length: float, width: float, pose: tuple[float, float, float]) -> str:
    x, y, theta = (repr(float(value)) for value in pose)
    return f"name: {name}, shape: {{box: [{length!r}, {width!r}]}}, mass: 1, pose: [{x}, {y}, {theta}]"


def findings(source: str) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        scenario_from_text(source)
    return [f"{finding.where}: {finding.what}" for finding in caught.value.findings]


def flush(scenario: Scenario) -> None:
    """Check that every contact's edges lie on one another to 1e-9 in gap and angle."""
    chain = scenario.chain
    for contact in chain.contacts:
        first = (
            chain.pusher.outline if contact.pusher == PLATE else chain.objects[contact.pusher].outline_chain
        )
        second = chain.objects[contact.pushed].outline_chain
        ends = contact.right, contact.left
        for outline in (first, second):
            edges = zip(outline, np.roll(outline, -1, axis=0), strict=True)
            assert min(max(_off(a, b, end) for end in ends) for a, b in edges) < 1e-9
        headings = [np.arctan2(*(np.roll(o, -1, axis=0) - o).T[::-1]) for o in (first, second)]
        facing = np.abs(np.sin(headings[0][:, None] - headings[1])).min()
        assert facing < 1e-9


def _off(a: FloatArray, b: FloatArray, point: FloatArray) -> float:
    along = (b - a) / np.linalg.norm(b - a)
    return float(abs(along[0] * (point - a)[1] - along[1] * (point - a)[0]))


size = st.floats(0.08, 0.4)
errors = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))


@settings(max_examples=25)
@given(st.lists(st.tuples(size, size, st.floats(-0.4, 0.4), errors), min_size=1, max_size=5))
def test_a_perturbed_stack_snaps_back(boxes: list[tuple[float, float, float, tuple[float, float]]]) -> None:
    """Gaps up to 1.5 mm each and turns up to 1 deg, in either direction; sideways everything keeps its place."""
    texts, x, y, before = [], 0.0, 0.0, 0.6
    for i, (length, width, share, (gap, turn)) in enumerate(boxes):
        y += 0.0 if i == 0 else share * 0.5 * (before + width)
        measured = (x + 0.5 * length + 0.0015 * gap, y, math.radians(turn))
        texts.append(box(f"b{i}", length, width, measured))
        x, before = x + length, width
    scenario = scenario_from_text(text(texts))
    flush(scenario)
    x = y = 0.0
    before = 0.6
    for i, ((length, width, share, _), obj) in enumerate(zip(boxes, scenario.chain.objects, strict=True)):
        y += 0.0 if i == 0 else share * 0.5 * (before + width)
        assert obj.pose_chain == pytest.approx([x + 0.5 * length, y, 0.0], abs=1e-9)
        x, before = x + length, width
    assert scenario.snapping is not None
    for (_, _, _, (gap, turn)), moved in zip(boxes, scenario.snapping.objects, strict=True):
        assert moved.turn == pytest.approx(-math.radians(turn), abs=1e-9)
        assert moved.gap == pytest.approx(0.0015 * gap, abs=1e-9)
    again = scenario_from_document(scenario.resolved())
    assert again == scenario
    flush(again)


@settings(max_examples=15)
@given(size, size, st.floats(1.05, 3.0), st.booleans(), st.sampled_from([-1.0, 1.0]))
def test_beyond_the_tolerance_it_is_a_finding(
    length: float, width: float, factor: float, turned: bool, sign: float
) -> None:
    """In the gap alone, or in the angle alone."""
    gap, turn = (0.0, 2.0 * factor) if turned else (0.005 * factor, 0.0)
    measured = (0.1 + 0.5 * length + sign * gap, 0.0, sign * math.radians(turn))
    objects = [box("near", 0.1, 0.5, (0.05, 0.0, 0.0)), box("far", length, width, measured)]
    (finding,) = findings(text(objects))
    assert finding == (
        f"objects[1].pose: 'far' is {1e3 * gap:.3g} mm and {turn:.3g} deg from lying on 'near'; snap allows 5 mm and "
        "2 deg: move it, or state a larger snap"
    )


def test_it_turns_about_the_centroid_and_moves_along_the_normal() -> None:
    """Onto an edge that is askew itself: a pentagon's roof."""
    house = "name: house, shape: {polygon: [[0, -0.1], [0.1, -0.1], [0.2, 0], [0.1, 0.1], [0, 0.1]]}, mass: 1"
    roof = np.array([0.15, 0.05])
    normal, along = np.array([1.0, 1.0]) / math.sqrt(2.0), np.array([-1.0, 1.0]) / math.sqrt(2.0)
    center = roof + 0.052 * normal + 0.01 * along
    tile = box("tile", 0.1, 0.06, (*center, math.radians(45.5)))
    scenario = scenario_from_text(text([house, tile]))
    flush(scenario)
    pose = scenario.chain.objects[1].pose_chain
    assert pose == pytest.approx([*(center - 0.002 * normal), math.radians(45.0)], abs=1e-9)
    assert scenario.snapping is not None
    (moved,) = scenario.snapping.objects
    assert (moved.name, moved.onto) == ("tile", "'house'")
    assert moved.gap == pytest.approx(0.002)
    assert moved.turn == pytest.approx(math.radians(-0.5))


def test_the_first_object_lies_aside_and_takes_the_chain_frame_along() -> None:
    objects = [box("near", 0.1, 0.08, (0.051, 0.003, 0.0)), box("far", 0.1, 0.08, (0.1502, 0.01, 0.0))]
    scenario = scenario_from_text(text(objects))
    near, far = (obj.pose_chain for obj in scenario.chain.objects)
    assert near == pytest.approx([0.05, 0.0, 0.0], abs=1e-12)
    assert far == pytest.approx([0.15, 0.007, 0.0], abs=1e-12)
    assert scenario.chain.pusher.outline[:, 1].mean() == pytest.approx(-0.003)
    assert (
        dict(rows(scenario))["chain frame"] == "moved by 3 mm sideways, to the middle of the plate's contact"
    )
    assert scenario_from_document(scenario.resolved()) == scenario
    assert "the contact's midpoint at (0, 0.003)" in findings(text(objects, "snap: 2 mm"))[0]


def test_without_snap_what_nearly_touches_is_a_finding() -> None:
    near = box("near", 0.1, 0.08, (0.05, 0.0, 0.0))
    far = box("far", 0.1, 0.08, (0.1504, 0.0, 0.0))
    assert findings(text([near, far], "")) == [
        "objects[1]: 'far' and 'near' do not touch along a line: the gap is 0.4 mm; move an edge onto an edge, "
        "or let snap move measured poses"
    ]
    aside = box("aside", 0.1, 0.08, (0.05, 0.0804, 0.0))
    for snap in ("", "snap: 5 mm"):
        assert findings(text([near, aside], snap)) == [
            "objects[1]: 'aside' and 'near' do not touch, but are only 0.4 mm apart: the least error makes a contact "
            "of it; allowed: at least 1 mm, or a contact"
        ]
    scenario_from_text(text([near, box("aside", 0.1, 0.08, (0.05, 0.081, 0.0))], ""))
