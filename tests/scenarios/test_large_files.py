"""Thousands of obstacles: files load, or are refused with words, by work that grows as they do (no clock is read)."""

from collections.abc import Callable
from functools import partial

import pytest
from work import calls_of

from pushplan.errors import ScenarioError
from pushplan.scenario import room
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.room import MOST_TOLD

HEAD = """\
format: pushplan/1
name: many
floor: {friction: 0.35}
objects: [{name: box, shape: {box: [0.3, 0.4]}, mass: 6.0}]
pusher: {width: 0.5, friction: 0.5}
goal: {pose: [2.2, 1.2, 60 deg]}
obstacles:
"""

FORMS = {
    "circle": "  - {{circle: 0.05, center: [{x:.4f}, {y:.4f}]}}\n",
    "box": "  - {{box: [0.05, 0.04], pose: [{x:.4f}, {y:.4f}, 10 deg]}}\n",
    "polygon": "  - {{polygon: [[{x:.4f}, {y:.4f}], [{u:.4f}, {y:.4f}], [{x:.4f}, {v:.4f}]]}}\n",
}


def _text(form: str, count: int, spacing: float, begin: float) -> str:
    """Return a scenario with obstacles in rows of a hundred."""
    places = [(begin + spacing * (i % 100), begin + spacing * (i // 100)) for i in range(count)]
    return HEAD + "".join(FORMS[form].format(x=x, y=y, u=x + 0.05, v=y + 0.05) for x, y in places)


def _free(form: str, count: int) -> str:
    return _text(form, count, 0.2, 5.0)


def _met(form: str, count: int) -> str:
    """Return a scenario whose box has every obstacle in it at the start."""
    return _text(form, count, 1e-4, 0.1)


def _refusal(text: str) -> ScenarioError:
    with pytest.raises(ScenarioError) as caught:
        scenario_from_text(text)
    return caught.value


def test_as_many_obstacles_as_a_file_may_hold_are_read() -> None:
    assert len(scenario_from_text(_free("polygon", 7_000)).obstacles) == 7_000


@pytest.mark.parametrize("form", FORMS)
def test_a_body_amid_thousands_has_a_few_sentences(form: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """How deep it is in each takes long to find, and nobody reads thousands of lines."""
    looked: list[str] = []
    too_near = room._too_near

    def counted(*args: object) -> str:
        looked.append(str(args[2]))
        return too_near(*args)  # type: ignore[arg-type]

    monkeypatch.setattr(room, "_too_near", counted)
    findings = [finding.what for finding in _refusal(_met(form, 2_000)).findings]
    near = [what for what in findings if "'box'" in what]
    assert len(near) == MOST_TOLD + 1
    assert near[0].startswith("at the start, 'box' overlaps obstacles[0] by ")
    assert near[-1] == (
        f"at the start, 'box' is as near to more obstacles than these {MOST_TOLD}, which are not listed"
    )
    assert looked.count("obstacles[20]") <= 2 * 2  # of box and pusher, at start and goal
    assert len(looked) <= 4 * (MOST_TOLD + 1)


@pytest.mark.parametrize(("form", "make"), [("circle", _free), ("polygon", _met)])
def test_work_grows_as_the_file_does(form: str, make: Callable[[str, int], str]) -> None:
    few, many = (calls_of(partial(scenario_from_text, make(form, count))) for count in (200, 400))
    assert many < 2.2 * few


def test_large_files_are_not_read_by_the_parser_in_python(monkeypatch: pytest.MonkeyPatch) -> None:
    """It takes fifteen times as long."""
    yaml = pytest.importorskip("yaml")
    if not hasattr(yaml, "CSafeLoader"):
        pytest.skip("PyYAML was built without LibYAML")
    monkeypatch.setattr(yaml, "SafeLoader", None)
    assert len(scenario_from_text(_free("circle", 3_000)).obstacles) == 3_000
