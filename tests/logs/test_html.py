"""The page of a run holds everything it needs, plays, and can be scrubbed."""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from boxes import chromium, show
from pushplan.logging.old.page import MOST_SAMPLES, render, write_html
from pushplan.logging.old.reader import read_run
from pushplan.plans.result import Run

from pushplan.errors import OutputError


def data_of(page: str) -> dict[str, Any]:
    """Return the numbers that a page holds."""
    found = re.search(r'<script id="run" type="application/json">(.*?)</script>', page, re.DOTALL)
    assert found is not None
    data: dict[str, Any] = json.loads(found[1])
    return data


@pytest.fixture(scope="module")
def run(case: Any) -> Run:
    """Return a run whose forces are of a size that can be drawn."""
    forces = np.random.default_rng(1).normal(size=case.execution.forces.shape)
    execution = dataclasses.replace(case.execution, forces=forces)
    return Run(case.scenario, case.plan, execution, None)


def test_a_run_and_its_log_give_the_same_page(case: Any, tmp_path: Path) -> None:
    recorded = read_run(case.write(tmp_path / "run.mcap"))
    assert render(recorded) == render(Run(case.scenario, case.plan, case.execution, None))


def test_the_page_holds_the_run(run: Run) -> None:
    data = data_of(render(run))
    assert run.execution is not None
    samples = data["samples"]
    assert samples["t"][-1] == pytest.approx(run.execution.t[-1], abs=1e-5)
    assert (
        len(samples["t"]) == len(samples["x"]) == len(samples["margins"][0]) == len(samples["forces"][1][0])
    )
    assert min(samples["margins"][0]) == pytest.approx(run.execution.margins[:, 0].min(), abs=1e-5)
    assert [contact["name"] for contact in data["contacts"]] == ["pusher-near", "near-far"]
    assert len(data["obstacles"]) == 2
    xmin, ymin, xmax, ymax = data["window"]
    assert xmin < -0.5 < 2.0 < xmax
    assert ymin < -0.5 < 2.0 < ymax


def test_an_unsolved_run_has_a_page_too(run: Run, case: Any) -> None:
    unsolved = case.unsolved().plan
    data = data_of(render(Run(run.scenario, unsolved, None, None)))
    nearest = "the nearest path ends 0.250 m and 8.2 deg from the goal"
    assert data["why"] == ["no path", "too narrow", "not over", nearest]
    np.testing.assert_allclose(data["nearest"], unsolved.approximate_path.end, atol=1e-5)
    assert data["samples"]["t"] == []


def test_a_name_cannot_break_out_of_the_page(run: Run) -> None:
    name = "</script><script>alert(1)</script>"
    page = render(dataclasses.replace(run, scenario=dataclasses.replace(run.scenario, name=name)))
    assert data_of(page)["name"] == name
    assert page.count("<script") == 2


def test_the_page_refers_to_nothing_outside(run: Run) -> None:
    found: list[tuple[str, str | None]] = []

    class References(HTMLParser):
        def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
            found.extend((tag, value) for key, value in attrs if key in ("src", "href", "action", "data"))

    page = render(run)
    References().feed(page)
    assert found == [("link", "data:,")]
    assert "default-src 'none'" in page
    assert not re.search(r"https?://|@import|url\(", page)


def test_a_long_run_stays_a_small_page(run: Run) -> None:
    assert run.execution is not None
    count = 20 * MOST_SAMPLES
    repeat = np.resize(np.arange(len(run.execution.t)), count)
    names = ("poses", "twists", "margins", "friction_margins", "lambdas", "forces")
    longer = {name: getattr(run.execution, name)[repeat] for name in names}
    execution = dataclasses.replace(run.execution, t=np.arange(count) / 100.0, **longer)
    samples = data_of(render(dataclasses.replace(run, execution=execution)))["samples"]
    assert len(samples["t"]) <= MOST_SAMPLES + 4
    assert samples["t"][-1] == pytest.approx((count - 1) / 100.0)
    assert min(samples["margins"][1]) == pytest.approx(execution.margins[:, 1].min(), abs=1e-5)


def test_a_page_that_cannot_be_written_is_an_error_with_its_path(run: Run, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"no/page\.html: there is no folder"):
        write_html(run, tmp_path / "no" / "page.html")


# --- in a browser -----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def browser(run: Run, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Return a browser that shows the page."""
    folder = tmp_path_factory.mktemp("page")
    write_html(run, folder / "run.html")
    with chromium(folder) as browser:
        show(browser, folder / "run.html", 1200)
        yield browser


@pytest.fixture
def page(browser: Any) -> Any:
    """Return a browser that shows the beginning of the run, paused."""
    browser.evaluate("window.pushplan.play(false); document.getElementById('speed').value = '1'")
    browser.evaluate("window.pushplan.seek(0)")
    return browser


def place(page: Any, name: str) -> dict[str, float]:
    """Return where an element of the page is, in pixels."""
    box = page.evaluate(f"JSON.stringify(document.getElementById('{name}').getBoundingClientRect())")
    found: dict[str, float] = json.loads(box)
    return found


def picture(page: Any) -> str:
    """Return the drawing of the world."""
    drawn: str = page.evaluate("document.getElementById('world').toDataURL()")
    return drawn


WAIT = "new Promise((done) => setTimeout(done, 400))"
UNTIL = """new Promise((done, fail) => {{
  const end = performance.now() + 60000;
  const look = () => {{
    if ({0}) done();
    else if (performance.now() > end) fail(new Error("waited in vain"));
    else setTimeout(look, 10);
  }};
  look();
}})"""
"""Waits until something of the page is so."""
FRAMES = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"


def test_the_page_plays_and_pauses(page: Any, run: Run) -> None:
    button = place(page, "play")
    middle = (button["x"] + 10, button["y"] + 10)
    before = picture(page)
    page.drag(middle, middle)
    page.evaluate(UNTIL.format("window.pushplan.state.time > 0.1"))
    assert page.evaluate("document.getElementById('play').textContent") == "Pause"
    assert picture(page) != before
    page.drag(middle, middle)
    paused = page.evaluate("window.pushplan.state.time")
    page.evaluate(WAIT)
    assert page.evaluate("window.pushplan.state.time") == paused
    assert page.evaluate("document.getElementById('play').textContent") == "Play"


def test_the_plot_scrubs_the_animation(page: Any, run: Run) -> None:
    assert run.execution is not None
    last, plot = run.execution.t[-1], place(page, "plot")
    y = plot["y"] + plot["height"] / 2
    page.drag((plot["x"] + 60, y), (plot["x"] + plot["width"] - 1, y))
    assert page.evaluate("window.pushplan.state.time") == pytest.approx(last, abs=1e-4)
    shown = page.evaluate("window.pushplan.poseAt(window.pushplan.state.time)")
    np.testing.assert_allclose(shown, run.execution.poses[-1], atol=2e-5)
    assert float(page.evaluate("document.getElementById('time').value")) == pytest.approx(last, abs=1e-4)


def test_the_slider_scrubs_the_animation(page: Any, run: Run) -> None:
    slider = place(page, "time")
    y = slider["y"] + slider["height"] / 2
    before = picture(page)
    page.drag((slider["x"] + slider["width"] / 2, y), (slider["x"] + slider["width"] / 2, y))
    assert run.execution is not None
    time = page.evaluate("window.pushplan.state.time")
    assert time == pytest.approx(run.execution.t[-1] / 2, rel=0.05)
    assert picture(page) != before
    assert f"{time:.2f} / " in page.evaluate("document.getElementById('clock').textContent")


def test_a_click_on_the_slider_while_it_plays_seeks(page: Any, run: Run) -> None:
    assert run.execution is not None
    slider, last = place(page, "time"), run.execution.t[-1]
    y = slider["y"] + slider["height"] / 2
    for share in (0.75, 0.25):
        page.evaluate("document.getElementById('speed').value = '0.25'; window.pushplan.seek(0)")
        page.evaluate("window.pushplan.play(true)")
        page.evaluate(FRAMES)
        there = (slider["x"] + share * slider["width"], y)
        page.drag(there, there)
        page.evaluate(FRAMES)
        assert page.evaluate("window.pushplan.state.time") == pytest.approx(share * last, abs=0.05 * last)
        assert page.evaluate("window.pushplan.state.playing") is False


def test_a_bar_tells_the_scale(page: Any, run: Run) -> None:
    bar = page.evaluate("window.pushplan.state.scale")
    world, (xmin, ymin, xmax, ymax) = place(page, "world"), data_of(render(run))["window"]
    pixels_per_metre = 0.96 * min(world["width"] / (xmax - xmin), world["height"] / (ymax - ymin))
    assert bar["pixels"] == pytest.approx(bar["length"] * pixels_per_metre)
    assert 48.0 <= bar["pixels"] <= 120.0
    (text,) = [label["text"] for label in labels(page) if label["canvas"] == "world"]
    number, unit = text.split()
    assert float(number) * {"m": 1.0, "cm": 0.01, "mm": 0.001}[unit] == pytest.approx(bar["length"])


def labels(page: Any) -> list[dict[str, Any]]:
    """Return what is written in the drawings, with its place."""
    found: list[dict[str, Any]] = page.evaluate("window.pushplan.labels()")
    return found


def test_keys_play_and_step(page: Any) -> None:
    page.evaluate("window.pushplan.seek(1.0); document.activeElement.blur()")
    page.key("ArrowRight")
    assert page.evaluate("window.pushplan.state.time") == pytest.approx(1.1)
    page.key("ArrowLeft")
    assert page.evaluate("window.pushplan.state.time") == pytest.approx(1.0)
    page.key(" ")
    assert page.evaluate("window.pushplan.state.playing") is True
    page.key(" ")
    assert page.evaluate("window.pushplan.state.playing") is False


def test_it_stops_at_the_end_and_starts_again(page: Any, run: Run) -> None:
    page.evaluate("window.pushplan.seek(1e9)")
    assert page.evaluate("window.pushplan.play(true); window.pushplan.state.time") == 0.0
    page.evaluate("document.getElementById('speed').value = '10'; window.pushplan.seek(0)")
    page.evaluate(UNTIL.format("!window.pushplan.state.playing"))
    assert run.execution is not None
    assert page.evaluate("window.pushplan.state.time") == pytest.approx(run.execution.t[-1], abs=1e-4)


def test_the_page_showed_no_error_and_made_no_request(page: Any) -> None:
    assert page.told("Runtime.exceptionThrown", "Runtime.consoleAPICalled", "Log.entryAdded") == []
    asked = {e["params"]["request"]["url"] for e in page.told("Network.requestWillBeSent")}
    assert {url.split(":")[0] for url in asked} <= {"file", "data"}
    assert len([url for url in asked if url.startswith("file")]) == 1


def test_embedded_in_another_page_it_plays_by_itself_and_over_again(run: Run, tmp_path: Path) -> None:
    write_html(run, tmp_path / "run.html")
    with chromium(tmp_path) as page:
        page.call("Page.navigate", url=(tmp_path / "run.html").as_uri() + "#playing")
        page.evaluate(UNTIL.format("window.pushplan && pushplan.state.time > 0"))
        assert page.evaluate("pushplan.state.playing")
        end = page.evaluate("pushplan.seek(1e9); pushplan.state.time")
        page.evaluate(UNTIL.format(f"0 < pushplan.state.time && pushplan.state.time < {end}"))
        assert page.evaluate("pushplan.state.playing")
