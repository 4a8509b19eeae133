"""The window: dragged poses are planned and saved, bad poses give a message, a browser shows it."""

import asyncio
import json
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import boxes
import numpy as np
import pytest
from conftest import heed_interrupts, there
from kinds import MULTI, ROW, SWAP, made
from rough import first_plans

import pushplan
from pushplan.drawing import palette
from pushplan.drawing.scene import Scene
from pushplan.geometry import se2
from pushplan.mechanics.chain import BodyKind
from pushplan.plans.plan import Plan
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray
from pushplan.view import answers as answering
from pushplan.view.answers import Answers, Worker
from pushplan.view.draft import Draft
from pushplan.view.tone import of_line

KINDS = ("push", "multi-push", "rearrangement")


@pytest.fixture(scope="module", autouse=True)
def _patience() -> Iterator[None]:
    """Give slow machines enough time to find and polish a plan."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(answering, "SEARCH", dict.fromkeys(KINDS, 20.0))
        patch.setattr(answering, "POLISHING", dict.fromkeys(KINDS, 0.5))
        yield


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return pushplan.load_scenario("two-crates")


@pytest.fixture(scope="module")
def scenarios(scenario: Scenario) -> dict[str, Scenario]:
    texts = {"multi-push": MULTI, "rearrangement": SWAP, "gathering": ROW}
    return {"push": scenario, **{kind: scenario_from_text(text) for kind, text in texts.items()}}


@pytest.fixture(scope="module")
def answers(scenario: Scenario) -> Answers:
    return Answers(scenario)


@pytest.mark.parametrize("kind", KINDS)
def test_an_unchanged_draft_is_the_scenario_itself(kind: str, scenarios: dict[str, Scenario]) -> None:
    assert Draft.of(scenarios[kind]).scenario() == scenarios[kind]


@pytest.mark.parametrize("kind", KINDS)
def test_the_saved_scenario_has_the_dragged_poses(kind: str, scenarios: dict[str, Scenario], tmp_path: Path) -> None:
    draft, aside = Draft.of(scenarios[kind]), np.array([0.05, -0.03, 0.1])
    for key, pose in draft.poses.items():
        if not key.startswith("obstacle/"):
            draft = draft.moved(key, pose + aside)
    file = tmp_path / "saved.yaml"
    file.write_text(draft.to_yaml())
    saved = pushplan.load_scenario(file)
    for key, pose in Draft.of(saved).poses.items():
        np.testing.assert_allclose(pose, draft.poses[key], atol=1e-9, err_msg=key)
    before, after = ([goal for goals in one.goals.values() for goal in goals] for one in (scenarios[kind], saved))
    assert [goal.position_tolerance for goal in before] == [goal.position_tolerance for goal in after]


@pytest.mark.parametrize("kind", [*KINDS, "gathering"])
def test_every_stage_of_an_answer_leads_from_the_dragged_start_to_the_dragged_goal(
    kind: str, scenarios: dict[str, Scenario]
) -> None:
    draft = Draft.of(scenarios[kind])
    key = next(key for key in draft.poses if key.startswith("goal"))
    draft, asked = draft.moved(key, draft.poses[key] + [-0.1, -0.1, 0.0]), Answers(scenarios[kind])
    with first_plans():
        timed = asked.ask(draft, "timed")
        stages = asked.ask(draft, "path"), timed, asked.ask(draft, "polished", lambda: False)
    for answer in stages:
        assert answer.solved, answer.findings
        for load in there(answer.scenario).loads:
            after = there(answer.plan).segments[-1].after
            ends = [goal.pose_chain for goal in there(answer.scenario).goals.get(load.name, ())]
            places = [se2.compose(end, load.chain.objects[0].pose_chain) for end in ends]
            away = [np.hypot(*(after[load.name] - p)[:2]) for p in places]
            assert min(away, default=0.0) < 5e-3
    assert there(timed.plan).robustness is not None
    assert (timed.stable is None) == (kind != "push")


@pytest.mark.parametrize("kind", KINDS)
def test_the_stage_shows_bodies_goals_and_path_of_the_scene(kind: str, scenarios: dict[str, Scenario]) -> None:
    pytest.importorskip("viser")
    from pushplan.view.stage import Stage

    seen, draft = Seen(), Draft.of(scenarios[kind])
    stage, scene = Stage(seen, draft), Scene.of(scenarios[kind])
    stage.draw_bodies(draft, scene)
    meshes = {name: mesh for name, mesh in seen.meshes.items() if not name.startswith("/played")}
    assert len(meshes) == len(scene.bodies) + len(scene.goals)
    wanted = [*scene.outlines(scene.start), *(goal.outline for goal in scene.goals)]
    for (name, (vertices, _)), outline in zip(meshes.items(), wanted, strict=True):
        key = name.removeprefix("/").rpartition("/")[0]
        world = se2.transform_points(draft.poses[key], vertices[:, :2])
        np.testing.assert_allclose(world.min(axis=0), outline.min(axis=0), atol=1e-6)
        np.testing.assert_allclose(world.max(axis=0), outline.max(axis=0), atol=1e-6)
    if kind == "rearrangement":
        plan = made(kind).plan
        drawn = Scene.of(plan.scenario, plan)
        stage.draw_plan(drawn)
        pushed, first = seen.lines["/plan/pushed"], next(line for line in drawn.lines if line.pushes)
        assert len(pushed.points) == sum(len(line.points) - 1 for line in drawn.lines if line.pushes)
        assert tuple(pushed.colors[0, 0]) == of_line(palette.margin_colour(float(first.margins[:2].min())) or "")
        stage.show_played(drawn.end)
        np.testing.assert_allclose(there(stage.played)[:, :2], drawn.end[:, :2], atol=1e-12)
        stage.draw_plan(None)
        assert not pushed.visible


def test_a_body_is_dragged_alone(scenario: Scenario) -> None:
    pytest.importorskip("viser")
    from pushplan.view.stage import Stage

    seen, draft, taken = Seen(), Draft.of(scenario), list[tuple[FloatArray, bool]]()
    stage = Stage(seen, draft)
    stage.handle("/start", draft.poses["start"], lambda pose, dropped: taken.append((pose, dropped)))
    stage.draw_bodies(draft, Scene.of(scenario))
    for phase, end in (("start", (0.1, 0.0)), ("update", (0.2, 0.1)), ("update", (np.nan, 0.0)), ("end", (0.3, 0.1))):
        event = SimpleNamespace(phase=phase, start_position=(0.1, 0.0, 0.04), end_position=(*end, 0.04))
        asyncio.run(seen.drags["/start/body0"](event))
    moves = np.array([pose - draft.poses["start"] for pose, _ in taken])
    np.testing.assert_allclose(moves, [[0.0, 0.0, 0.0], [0.1, 0.1, 0.0], [0.2, 0.1, 0.0]], atol=1e-12)
    assert [dropped for _, dropped in taken] == [False, False, True]


class Seen:
    """Stand-in for viser's scene that records the drawn shapes."""

    def __init__(self) -> None:
        self.meshes: dict[str, tuple[FloatArray, FloatArray]] = {}
        self.lines: dict[str, SimpleNamespace] = {}
        self.colours: dict[str, tuple[int, int, int]] = {}
        self.drags: dict[str, Callable[[Any], Any]] = {}
        self.update: Callable[[Any], Any] = lambda _: None

    def add_mesh_simple(self, name: str, vertices: FloatArray, faces: FloatArray, **look: Any) -> SimpleNamespace:
        self.meshes[name], self.colours[name] = (vertices, faces), look["color"]
        return SimpleNamespace(on_drag=lambda function: self.drags.update({name: function}))

    def add_line_segments(self, name: str, points: FloatArray, colors: FloatArray, **look: Any) -> SimpleNamespace:
        self.lines[name] = SimpleNamespace(points=points, colors=colors, visible=look["visible"])
        return self.lines[name]

    def add_frame(self, name: str, visible: bool = True, **_: object) -> SimpleNamespace:
        return SimpleNamespace(visible=visible, position=(0.0, 0.0, 0.0), wxyz=(1.0, 0.0, 0.0, 0.0))

    def add_transform_controls(self, *_: object, **__: object) -> SimpleNamespace:
        placed = {"position": (0.0, 0.0, 0.0), "wxyz": (1.0, 0.0, 0.0, 0.0)}
        return SimpleNamespace(on_update=lambda function: setattr(self, "update", function), **placed)

    def __getattr__(self, name: str) -> Callable[..., None]:
        return lambda *_, **__: None  # lights and axes


@pytest.mark.parametrize(("change", "words"), [
    (lambda draft: draft.moved("start", np.array([0.55, 0.4, 0.0])), "obstacle"),
    (lambda draft: draft.moved("goal", np.array([9.0, 9.0, 0.0])), "workspace"),
    (lambda draft: draft.slid(1, 0.5), "touch"),
    (lambda draft: draft.moved("goal", draft.poses["start"]), "goal"),
])  # fmt: skip
def test_a_bad_pose_gives_a_message(
    scenario: Scenario, answers: Answers, change: Callable[[Draft], Draft], words: str
) -> None:
    answer = answers.ask(change(Draft.of(scenario)), "path")
    assert not answer.solved
    assert any(words in finding for finding in answer.findings), answer.findings
    assert answers.ask(Draft.of(scenario), "path").solved


def test_a_worker_answers_only_the_newest_question() -> None:
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


def test_the_command_prints_its_address_as_json_and_ends_quietly_with_ctrl_c() -> None:
    pytest.importorskip("viser")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    words = [sys.executable, *f"-m pushplan view one-box --json --no-browser --port {port}".split()]
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=heed_interrupts
    ) as process:
        told = json.loads(there(process.stdout).readline())
        process.send_signal(signal.SIGINT)
        rest, _ = process.communicate(timeout=60)
    assert told == {"scenario": "one-box", "url": f"http://localhost:{port}"}
    assert (rest, process.returncode) == ("", 0)


def test_dragged_poses_in_a_browser_are_planned_saved_played_or_refused(scenario: Scenario, tmp_path: Path) -> None:
    pytest.importorskip("viser")
    import viewed

    from pushplan.view.window import Window

    downloads, file = tmp_path / "downloads", tmp_path / "saved.yaml"
    downloads.mkdir()
    with boxes.chromium(tmp_path / "view") as browser, closing(Window(scenario, 8473)) as window:
        viewed.open_window(browser, window)
        goal, start = window.draft.poses["goal"], window.draft.poses["start"]
        viewed.drag(browser, window, goal, goal + np.array([-0.1, -0.1, 0.0]))
        viewed.shown_after(browser, "polished")
        good = there(window.answer)
        browser.call("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(downloads))
        viewed.click(browser, "YAML")
        file.write_text(viewed.downloaded(downloads))
        viewed.click(browser, "Play")
        played = np.array([pose for _ in range(25) if (pose := viewed.next_played(window)) is not None])
        viewed.drag(browser, window, start, start + np.array([0.3, -0.35, 0.0]))  # into an obstacle
        viewed.wait_for(browser, "document.body.innerText.includes('no plan')")
        assert viewed.next_played(window) is None
        bad = there(window.answer)
        told = browser.evaluate("document.querySelector('#pushplan-answer').innerText")
    assert good.solved
    np.testing.assert_allclose(good.draft.poses["goal"] - goal, [-0.1, -0.1, 0.0], atol=0.03)
    saved = pushplan.load_scenario(file)
    np.testing.assert_allclose(saved.goal.pose_chain, good.draft.poses["goal"], atol=1e-12)
    assert_played(there(good.plan), played)
    assert not bad.solved
    assert bad.findings[0][:40] in told


def assert_played(plan: Plan, played: FloatArray) -> None:
    """Check that poses (k, b, 3) of the bodies are on the plan's path, in its order."""
    on_the_way = there(plan.trajectory).sample(1000.0).poses[:, :2]
    plate = [body.kind for body in Scene.of(plan.scenario).bodies].index(BodyKind.PLATE)
    assert len(played) > 10
    apart = np.linalg.norm(played[:, plate, None, :2] - on_the_way[None], axis=2)
    assert apart.min(axis=1).max() < 1e-3
    assert np.all(np.diff(apart.argmin(axis=1)) >= 0)
    assert apart.argmin(axis=1)[-1] > apart.argmin(axis=1)[0]
