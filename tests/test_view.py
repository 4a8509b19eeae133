"""The window: what is dragged is what is planned and saved, bad poses are told in words, a browser shows it."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import boxes
import numpy as np
import pytest
from interrupts import heed_interrupts

import pushplan
from pushplan.cli.main import main
from pushplan.errors import PlanningError
from pushplan.geometry import se2
from pushplan.scenario.builders import box, build_scenario, plate
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray
from pushplan.util.extras import MissingExtraError
from pushplan.view.answers import Answer, Answers
from pushplan.view.draft import Draft
from pushplan.view.worker import Worker


@pytest.fixture(scope="module", autouse=True)
def _patience() -> Iterator[None]:
    """Let a machine that is a few times slower find and polish a plan, too."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pushplan.view.answers.SEARCH", 2.0)
        patch.setattr("pushplan.view.answers.POLISHING", 6.0)
        yield


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return pushplan.load_scenario("two-crates")


@pytest.fixture(scope="module")
def answers(scenario: Scenario) -> Answers:
    return Answers(scenario)


def test_a_draft_in_which_nothing_moved_is_the_scenario_itself(scenario: Scenario) -> None:
    assert Draft.of(scenario).scenario() == scenario


def test_what_was_dragged_is_where_the_saved_scenario_has_it(scenario: Scenario, tmp_path: Path) -> None:
    start, goal = np.array([-0.1, 0.05, 0.2]), np.array([1.4, 1.2, 1.3])
    draft = Draft.of(scenario).with_start(start).with_goal(goal).with_slide(1, 0.02)
    draft = draft.with_place(0, np.array([0.6, 0.5, 0.3])).with_place(4, np.array([1.6, 0.3, 1.0]))
    file = tmp_path / "saved.yaml"
    file.write_text(draft.to_yaml())
    saved = pushplan.load_scenario(file)
    np.testing.assert_allclose(saved.start, start)
    np.testing.assert_allclose(saved.goal.pose_chain, goal, atol=1e-12)
    assert saved.goal.of == scenario.goal.of
    before, after = (each.chain.objects[1].outline_chain for each in (scenario, saved))
    np.testing.assert_allclose(after - before, np.tile([0.0, 0.02], (len(before), 1)), atol=1e-12)
    wall, moved = (each.obstacles[0] for each in (scenario, saved))
    assert isinstance(wall, pushplan.PolygonObstacle)
    assert isinstance(moved, pushplan.PolygonObstacle)
    middle = wall.outline.mean(axis=0)
    np.testing.assert_allclose(moved.outline, se2.transform_points([0.6, 0.5, 0.3], wall.outline - middle))
    disc = saved.obstacles[4]
    assert isinstance(disc, pushplan.CircleObstacle)
    np.testing.assert_allclose(disc.center, [1.6, 0.3])


def test_what_an_object_carries_slides_along_with_it(scenario: Scenario) -> None:
    np.testing.assert_allclose(Draft.of(scenario).with_slide(0, 0.01).shifts, [[0.0, 0.01], [0.0, 0.01]])
    np.testing.assert_allclose(Draft.of(scenario).with_slide(1, 0.01).shifts, [[0.0, 0.0], [0.0, 0.01]])


@pytest.mark.parametrize("name", ["two-crates", "parallel-stacks"])
@pytest.mark.parametrize("slide", [0.01, -0.02, 0.06])
def test_a_slid_object_moves_in_the_world_with_what_it_carries_and_nothing_else(
    name: str, slide: float
) -> None:
    before = pushplan.load_scenario(name)
    for k, contact in enumerate(before.chain.contacts):
        draft = Draft.of(before).with_slide(k, slide)
        after = draft.scenario()
        pairs = zip(before.chain.outlines_at(before.start), after.chain.outlines_at(after.start), strict=True)
        moved = np.array([now.mean(axis=0) - old.mean(axis=0) for old, now in pairs])
        aside = se2.rotate(before.start[2], draft.shifts)
        np.testing.assert_allclose(moved[-len(aside) :], aside, atol=1e-9)
        np.testing.assert_allclose(moved[: -len(aside)], 0.0, atol=1e-9)
        np.testing.assert_allclose(aside[k], slide * se2.rotate(before.start[2], contact.tangent), atol=1e-12)


def test_every_stage_of_an_answer_leads_from_the_dragged_start_to_the_dragged_goal(
    scenario: Scenario, answers: Answers
) -> None:
    goal = np.array([1.5, 1.3, 1.5])
    draft = Draft.of(scenario).with_goal(goal)
    timed = answers.timed(draft)
    for answer in (answers.path(draft), timed, answers.polished(timed, lambda: False)):
        assert answer.solved, answer.findings
        assert answer.result is not None
        assert answer.result.path is not None
        np.testing.assert_allclose(answer.result.path.end, goal, atol=2e-3)
    assert timed.result is not None
    assert timed.result.robustness is not None


def test_another_chain_has_another_stable_set_and_the_first_one_its_own_again(
    scenario: Scenario, answers: Answers
) -> None:
    draft = Draft.of(scenario)

    def cone(draft: Draft) -> list[list[float]]:
        answer = answers.path(draft)
        assert answer.stable is not None
        found = answer.stable.translation_cone()
        assert found is not None
        return [list(row) for row in found]

    first = cone(draft)
    assert cone(draft.with_slide(1, 0.03)) != first
    assert cone(draft) == first


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda draft: draft.with_start(np.array([0.55, 0.4, 0.0])), "obstacle"),
        (lambda draft: draft.with_goal(np.array([9.0, 9.0, 0.0])), "workspace"),
        (lambda draft: draft.with_slide(1, 0.5), "touch"),
        (lambda draft: draft.with_goal(draft.start), "goal"),
    ],
)
def test_a_bad_pose_is_told_in_words(
    scenario: Scenario, answers: Answers, change: Callable[[Draft], Draft], words: str
) -> None:
    answer = answers.path(change(Draft.of(scenario)))
    assert not answer.solved
    assert any(words in finding for finding in answer.findings), answer.findings
    assert answers.path(Draft.of(scenario)).solved


def test_a_worker_drops_what_was_asked_before_the_newest_question() -> None:
    begun, go, answered = threading.Event(), threading.Event(), list[int]()

    def answer(question: int, outdated: Callable[[], bool]) -> None:
        begun.set()
        go.wait(30.0)
        answered.append(question)

    worker = Worker(answer)
    worker.ask(0)
    begun.wait(30.0)
    for question in range(1, 5):
        worker.ask(question)
    assert worker.outdated()
    begun.clear()
    go.set()
    begun.wait(30.0)
    worker.end()
    assert answered == [0, 4]


def test_a_failure_in_the_work_is_kept_for_the_user() -> None:
    def answer(question: int, outdated: Callable[[], bool]) -> None:
        raise ZeroDivisionError(question)

    worker = Worker(answer)
    worker.ask(1)
    while worker.alive:
        time.sleep(0.01)
    assert isinstance(worker.failure, ZeroDivisionError)


def test_several_pushes_are_refused_in_words() -> None:
    several = build_scenario(
        "several",
        [box("crate", 0.2, 0.2, 1.0)],
        plate(0.2, 0.5),
        (1.0, 0.0, 0.0),
        floor_friction=0.3,
        robot={"start": [-0.5, 0.0, 0.0]},
    )
    with pytest.raises(PlanningError, match="several pushes"):
        Draft.of(several)


def test_without_viser_the_command_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "viser", None)
    assert main(["view", "two-crates"]) != 0
    assert "pip install 'pushplan[view]'" in capsys.readouterr().err
    assert issubclass(MissingExtraError, pushplan.PushplanError)


def test_the_command_says_where_it_is_in_json_and_ends_quietly_with_ctrl_c() -> None:
    pytest.importorskip("viser")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    words = [
        sys.executable,
        "-m",
        "pushplan",
        "view",
        "one-box",
        "--json",
        "--no-browser",
        "--port",
        str(port),
    ]
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=heed_interrupts
    ) as process:
        assert process.stdout is not None
        told = json.loads(process.stdout.readline())
        process.send_signal(signal.SIGINT)
        rest, _ = process.communicate(timeout=60)
    assert told == {"scenario": "one-box", "url": f"http://localhost:{port}"}
    assert (rest, process.returncode) == ("", 0)


@dataclass(frozen=True)
class Visit:
    """What somebody saw who opened the window.

    Attributes:
        good: The answer after the goal was dragged to a free place.
        saved: The text of the file that the button YAML gave then.
        played: Poses (k, 3) in which the chain was seen after the button Play.
        bad: The answer after the start was dragged into a wall while the plan was played.
        told: What the page said of it.
    """

    good: Answer
    saved: str
    played: FloatArray
    bad: Answer
    told: str


@pytest.fixture(scope="module")
def visit(scenario: Scenario, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Visit]:
    pytest.importorskip("viser")
    import viewed

    from pushplan.view.window import Window

    downloads = tmp_path_factory.mktemp("downloads")
    with boxes.chromium(tmp_path_factory.mktemp("view")) as browser:
        window = Window(scenario, 8473)
        try:
            viewed.open_window(browser, window)
            begin, end = window.draft.goal, window.draft.goal + np.array([-0.1, -0.1, 0.0])
            viewed.drag(browser, window, begin, end)
            viewed.shown_after(browser, "timed")
            viewed.wait_for(
                browser, "document.querySelector('#pushplan-answer').dataset.stage === 'polished'"
            )
            good = window.answer
            browser.call("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(downloads))
            viewed.click(browser, "YAML")
            saved = viewed.downloaded(downloads)
            viewed.click(browser, "Play")
            played = [pose for _ in range(40) if (pose := viewed.next_played(window)) is not None]
            viewed.drag(browser, window, window.draft.start, window.draft.start + np.array([0.55, 0.3, 0.0]))
            viewed.wait_for(browser, "document.body.innerText.includes('no plan')")
            bad = window.answer
            assert viewed.next_played(window) is None
            assert good is not None
            assert bad is not None
            told = browser.evaluate("document.querySelector('#pushplan-answer').innerText")
            yield Visit(good, saved, np.array(played), bad, told)
        finally:
            window.close()


def test_a_goal_dragged_by_the_mouse_is_planned_to(scenario: Scenario, visit: Visit) -> None:
    assert visit.good.solved
    moved = visit.good.draft.goal - scenario.goal.pose_chain
    np.testing.assert_allclose(moved, [-0.1, -0.1, 0.0], atol=0.03)


def test_the_button_saves_the_scenario_that_was_dragged(visit: Visit, tmp_path: Path) -> None:
    file = tmp_path / "saved.yaml"
    file.write_text(visit.saved)
    saved = pushplan.load_scenario(file)
    np.testing.assert_allclose(saved.goal.pose_chain, visit.good.draft.goal, atol=1e-12)


def test_the_button_plays_the_plan_on_its_way_and_in_its_time(visit: Visit) -> None:
    result = visit.good.result
    assert result is not None
    assert result.trajectory is not None  # its corners are blended: off the path by more than a millimetre
    on_the_way = result.trajectory.sample(1000.0).poses[:, :2]
    assert len(visit.played) > 10
    apart = np.linalg.norm(visit.played[:, None, :2] - on_the_way[None], axis=2)
    assert apart.min(axis=1).max() < 1e-3
    assert np.all(np.diff(apart.argmin(axis=1)) >= 0)
    assert apart.argmin(axis=1)[-1] > apart.argmin(axis=1)[0]


def test_a_start_dragged_into_a_wall_is_told_on_the_page_and_ends_the_play(visit: Visit) -> None:
    assert not visit.bad.solved
    assert visit.bad.findings[0][:40] in visit.told
