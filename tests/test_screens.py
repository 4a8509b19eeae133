"""Appearance of every kind of run in picture, page, film and window, on phones and desktops, light and dark.

Nothing overlaps or overflows, no console has an error, and each thing has the same colour everywhere. One browser
shows everything. `PUSHPLAN_SCREENS=FOLDER` saves all pictures.
"""

import json
import re
import time
from collections.abc import Iterator
from contextlib import closing
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from boxes import SCREENS, assert_tidy, boxes, chromium, keep, overlapping, show
from conftest import Patch, there
from kinds import KINDS, made
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.text import Text
from test_view import Seen

from pushplan.drawing import palette
from pushplan.drawing.floor import draw_scene, set_view, view_of
from pushplan.drawing.scene import Scene
from pushplan.logging.film import Film, Still
from pushplan.logging.page import render, write_html
from pushplan.logging.scene import scene as messages_of
from pushplan.logging.shown import steps_of as run_steps
from pushplan.plans.run import Run
from pushplan.view import tone

EVERY = pytest.mark.parametrize("kind", KINDS)


def film_of(run: Run) -> Still:
    return Still(run) if run.execution is None else Film(run, run.execution)


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with chromium(tmp_path_factory.mktemp("screens")) as found:
        yield found


@EVERY
def test_a_page_is_tidy_on_every_screen(kind: str, browser: Any, tmp_path: Path) -> None:
    run = made(kind)
    write_html(run, tmp_path / "run.html")
    for width, dark in SCREENS:
        show(browser, tmp_path / "run.html", width, dark)
        assert browser.evaluate("pushplan.state.playing") == (run.execution is not None)
        for share in (0.0, 0.35, 1.0):
            browser.evaluate(f"pushplan.play(false), pushplan.seek({share} * (pushplan.last ?? 0))")
            written = browser.evaluate("pushplan.labels()")
            for canvas in ("world", "plot"):
                assert overlapping([one for one in written if one["canvas"] == canvas]) == []
            keep(browser, f"page {kind} {width} {'dark' if dark else 'light'} {share:.0%}")
        browser.evaluate("document.getElementById('notes').open = true")
        keep(browser, f"page {kind} {width} {'dark' if dark else 'light'} notes")
        assert_tidy(browser, "h1, #facts, #notes, #why, #event, canvas, #legend > *, footer > *", width)
        assert browser.evaluate("document.documentElement.scrollHeight") <= 1300


def test_the_page_answers_an_operator_s_questions(browser: Any, tmp_path: Path) -> None:
    run = made("rearrangement")
    write_html(run, tmp_path / "run.html")
    show(browser, tmp_path / "run.html", 1280, False)
    end = there(run.execution)
    said = browser.evaluate("document.getElementById('steps').innerText")
    first = there(there(run.plan).pushes[0].load).names[0]
    assert re.search(rf"drive [\d.]+ m to the \w+ face of {first}, push {first} [\d.]+ m to the goal", said)
    assert said.startswith("2 steps.")
    assert f"The run takes {end.t[-1]:.1f} s." in said
    least = np.nanmin(end.margins)
    assert f"margin {least:.3f}." in said
    assert f"ends at x {end.poses[-1, 0]:.2f} m, y {end.poses[-1, 1]:.2f} m" in said
    browser.evaluate("document.querySelectorAll('#steps li')[1].click()")
    assert browser.evaluate("pushplan.state.time") == pytest.approx(run_steps(run)[1].begin, abs=0.02)


@EVERY
def test_texts_of_a_film_do_not_overlap(kind: str) -> None:
    film = film_of(made(kind))
    film.picture()
    figure: Figure = film.canvas.figure
    written = [one for one in figure.findobj(Text) if isinstance(one, Text) and one.get_text().strip()]
    beyond = [one for one in film.plot.get_xticklabels() if one.get_position()[0] > film.plot.get_xlim()[1]]
    written = [one for one in written if one.axes is not film.floor and one not in beyond]  # none of them is drawn
    extents = [one.get_window_extent() for one in written if one.get_visible()]
    assert len(extents) >= 2
    assert not any(one.overlaps(other) for one, other in combinations(extents, 2))
    assert all(0.0 <= box.x0 <= box.x1 <= 1280.0 and 0.0 <= box.y0 <= box.y1 <= 960.0 for box in extents)


@EVERY
def test_each_thing_has_the_same_colour_everywhere(kind: str) -> None:
    run = made(kind)
    scene = Scene.of(run.scenario, run.plan, run.execution, run.events)
    expected = {body.name: body.colour for body in scene.bodies}
    axes = Figure().add_subplot()
    set_view(axes, view_of(scene.window))
    draw_scene(axes, scene)
    drawn = {to_hex(patch.get_facecolor()) for patch in axes.patches}
    moving = {body.name for body, moves in zip(scene.bodies, scene.moved, strict=True) if moves}
    assert {expected[name] for name in moving or expected} <= drawn
    film = film_of(run)
    if isinstance(film, Film):
        shown = [to_hex(one.get_facecolor()) for one in film.floor.patches if isinstance(one, Polygon)]
        assert shown[-len(scene.bodies) :] == [body.colour for body in scene.bodies]
    found = there(re.search(r'application/json">(.*?)</script>', render(run), re.DOTALL))
    page = json.loads(found[1])
    assert {body["name"]: body["colour"] for body in page["bodies"]} == expected
    assert [one["colour"] for one in page["obstacles"]] == [one.colour for one in scene.obstacles]
    assert page["colours"]["goal"] == palette.GOAL
    if kind == "unsolved":
        assert [one.colour for one in scene.obstacles] == [palette.BLOCKING, palette.OBSTACLE]
    for entity in messages_of(run.scenario).entities:
        name = entity.id.removeprefix("object/")
        if name in expected and entity.triangles:
            paint = entity.triangles[0].color
            rgb = tuple(round(255 * part) for part in (paint.r, paint.g, paint.b))
            assert rgb == palette.red_green_blue(expected[name])
    pytest.importorskip("viser")
    from pushplan.view.draft import Draft
    from pushplan.view.stage import Stage
    from pushplan.view.tone import of_body

    seen, draft = Seen(), Draft.of(run.scenario)
    stage = Stage(seen, draft)
    stage.draw_bodies(draft, Scene.of(run.scenario))
    played = [seen.colours[f"/played/{k}/body"] for k in range(len(scene.bodies))]
    assert played == [of_body(body.colour) for body in scene.bodies]


def test_colours_in_the_window_appear_as_in_the_palette() -> None:
    """Through the filmic curve of three.js, which is repeated here."""

    def seen(linear: Any) -> Any:
        v = tone.INTO @ (np.asarray(linear) / 0.6)
        v = (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081)
        mapped = np.clip(tone.OUT @ v, 0.0, 1.0)
        return 255.0 * np.where(mapped < 0.0031308, 12.92 * mapped, 1.055 * mapped ** (1.0 / 2.4) - 0.055)

    for colour in (*palette.OBJECTS, *palette.NAMED.values(), palette.ROBOT, palette.PLATE, palette.BLOCKING):
        told = np.array(tone.of_body(colour)) / 255.0
        lit = tone.LIGHT * np.where(told < 0.04045, told / 12.92, ((told + 0.055) / 1.055) ** 2.4)
        np.testing.assert_allclose(seen(lit), palette.red_green_blue(colour), atol=3.0)
    for colour in (palette.PATH, palette.GOAL, palette.ALONE, palette.WALL, *(c for _, c in palette.MARGINS)):
        told = np.array(tone.of_line(colour)) / 255.0
        np.testing.assert_allclose(seen(told), palette.red_green_blue(colour), atol=5.0)


@pytest.mark.parametrize("kind", ["push", "rearrangement", "unsolved"])
def test_the_window_is_tidy_on_every_screen(kind: str, browser: Any, monkeypatch: Patch) -> None:
    """A push on all screens; other kinds, which have other panels, on a dark phone and a light desktop."""
    pytest.importorskip("viser")
    from pushplan.view import answers
    from pushplan.view.window import Window

    kinds, solved = ("push", "multi-push", "rearrangement"), kind != "unsolved"
    monkeypatch.setattr(answers, "SEARCH", dict.fromkeys(kinds, 20.0 if solved else 0.2))
    monkeypatch.setattr(answers, "POLISHING", dict.fromkeys(kinds, 0.2))
    with closing(Window(made(kind).scenario, 8493)) as window:
        for width, dark in SCREENS if kind == "push" else SCREENS[1:3]:
            show(browser, window.url, width, dark)
            said = wait_for_answer(browser)
            assert browser.evaluate(GROUND).startswith("rgb(255") != dark
            assert ("no plan" in said) == (not solved)
            assert browser.evaluate("document.body.innerText").count("Drag ") == 1
            found = boxes(browser, "#pushplan-answer, button, svg#pushplan-set")
            assert len(found) >= 3
            assert overlapping(found) == []
            assert [one["text"] for one in found if one["left"] < 0.0 or one["right"] > width + 0.5] == []
            assert browser.evaluate("document.documentElement.scrollWidth") <= width
            told = browser.told("Runtime.exceptionThrown", "Runtime.consoleAPICalled", "Log.entryAdded")
            keep(browser, f"view {kind} {width} {'dark' if dark else 'light'}")
            levels = [one["params"].get("type") or one["params"].get("entry", {}).get("level") for one in told]
            assert "error" not in levels, told
            assert "exceptionDetails" not in json.dumps(told)


GROUND = "getComputedStyle(document.querySelector('canvas').closest('[style*=background]')).backgroundColor"


def wait_for_answer(browser: Any) -> str:
    """Return the text of the panel once the answer is timed or there is no plan."""
    end = time.monotonic() + 60.0
    stage = "document.querySelector('#pushplan-answer')?.dataset.stage"
    while browser.evaluate(stage) not in ("timed", "polished"):
        assert time.monotonic() < end, "waited in vain for an answer"
        time.sleep(0.05)
    said: str = browser.evaluate("document.querySelector('#pushplan-answer').innerText")
    return said
