"""The page of a run is right at first sight: nothing overlaps or spills on any screen, whatever the run."""

from __future__ import annotations

import base64
import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from boxes import SCREENS, assert_tidy, overlapping, show
from boxes import chromium as started
from pushplan.logging.old.page import write_html
from pushplan.plans.execution import Execution
from pushplan.plans.result import PlanResult, Run

from pushplan.planners.timing.arc_limits import Bounds
from pushplan.planners.timing.exact_timing import time_path
from pushplan.plans.path import PushPath
from pushplan.scenario.builders import box, build_scenario, plate

ELEMENTS = "h1, #facts, #why p, canvas, #legend > *, footer > *"


def _twenty(plan: PlanResult) -> Run:
    """Return a run of twenty objects whose names are as long as may be."""
    names = [f"pallet {k:02d} of hospital supplies for the third floor of ward {k:02d}" for k in range(20)]
    objects = [box(name, 0.1, 0.12, 0.5) for name in names]
    many = build_scenario(
        "Twenty pallets of hospital supplies pushed round the corner", objects, plate(0.2, 0.6), (4.0, 0.3, 0.0),
        floor_friction=0.3, contact_friction=0.5,
    )  # fmt: skip
    path = PushPath(np.zeros(3), np.array([[1.0, 0.0, 0.0]]), np.array([2.0]))
    trajectory = time_path(path, Bounds(many.chain.pusher.limits))
    count, rng = len(trajectory.t), np.random.default_rng(1)
    execution = Execution(
        t=trajectory.t, poses=trajectory.poses, twists=trajectory.twists,
        margins=rng.uniform(0.01, 0.4, (count, 20)), friction_margins=rng.uniform(size=(count, 20)),
        lambdas=rng.uniform(size=(count, 20)), forces=rng.normal(size=(count, 20, 2)),
        loss=None, goal_error=(0.0, 0.0),
    )  # fmt: skip
    planned = dataclasses.replace(plan, path=path, trajectory=trajectory)
    return Run(many, planned, execution, None)


@pytest.fixture(scope="module")
def runs(case: Any) -> dict[str, Run]:
    """Return a run of every kind that looks different."""
    long = "the chain cannot pass: the widest passage from start to goal is 70 mm wide, and the chain needs 101 mm"
    forces = np.random.default_rng(1).normal(size=case.execution.forces.shape)
    execution = dataclasses.replace(case.execution, forces=forces)
    unsolved = dataclasses.replace(case.unsolved().plan, reason=long)
    return {
        "ordinary": Run(case.scenario, case.plan, execution, None),
        "twenty": _twenty(case.plan),
        "unsolved": Run(case.scenario, unsolved, None, None),
        "not executed": Run(case.scenario, case.plan, None, None),
    }


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with started(tmp_path_factory.mktemp("seen")) as found:
        yield found


@pytest.mark.parametrize(("width", "dark"), SCREENS)
@pytest.mark.parametrize("kind", ["ordinary", "twenty", "unsolved", "not executed"])
def test_nothing_overlaps_or_spills(
    kind: str, width: int, dark: bool, runs: dict[str, Run], browser: Any, tmp_path: Path
) -> None:
    write_html(runs[kind], tmp_path / "run.html")
    show(browser, tmp_path / "run.html", width, dark)
    assert_tidy(browser, ELEMENTS, width)
    drawings = "[...document.querySelectorAll('canvas')].filter((one) => one.offsetParent)"
    for canvas in browser.evaluate(f"{drawings}.map((one) => one.id)"):
        written = [label for label in browser.evaluate("pushplan.labels()") if label["canvas"] == canvas]
        room = browser.evaluate(f"document.getElementById('{canvas}').getBoundingClientRect().toJSON()")
        assert overlapping(written, 0.0) == []
        assert all(one["left"] >= 0 and one["right"] <= room["width"] for one in written)
        assert all(one["top"] >= 0 and one["bottom"] <= room["height"] for one in written)


def test_a_phone_on_its_side_shows_room_and_plot_beside_one_another(
    runs: dict[str, Run], browser: Any, tmp_path: Path
) -> None:
    write_html(runs["ordinary"], tmp_path / "run.html")
    show(browser, tmp_path / "run.html", 844, height=390)
    assert_tidy(browser, ELEMENTS, 844)
    assert browser.evaluate("document.documentElement.scrollHeight") <= 390
    assert browser.evaluate("document.getElementById('world').getBoundingClientRect().height") >= 170


def test_the_worst_six_contacts_are_named(runs: dict[str, Run], browser: Any, tmp_path: Path) -> None:
    write_html(runs["twenty"], tmp_path / "run.html")
    show(browser, tmp_path / "run.html", 1280)
    told = browser.evaluate("[...document.querySelectorAll('#legend > span')].map(e => e.textContent)")
    execution, chain = runs["twenty"].execution, runs["twenty"].scenario.chain
    assert execution is not None
    worst = sorted(np.argsort(execution.margins.min(axis=0))[:6])
    assert told[1:] == [*(chain.contact_name(k) for k in worst), "and 14 with larger margins"]


def test_an_unsolved_run_shows_why_and_how_near(runs: dict[str, Run], browser: Any, tmp_path: Path) -> None:
    write_html(runs["unsolved"], tmp_path / "run.html")
    show(browser, tmp_path / "run.html", 1280)
    told = browser.evaluate("document.getElementById('why').innerText")
    assert "the widest passage from start to goal is 70 mm" in told
    assert "the nearest path ends 0.250 m and 8.2 deg from the goal" in told
    assert browser.evaluate("document.getElementById('tree').checked")
    assert browser.evaluate("document.getElementById('play').checkVisibility()") is False
    assert _pixels(browser, (180, 95, 6)) > 50  # the nearest path and its ghost


def test_arrows_are_no_longer_than_an_object_however_small(
    runs: dict[str, Run], browser: Any, tmp_path: Path
) -> None:
    """Arrows are counted as the pixels that they add; at a quarter of the size they cover a sixteenth, or so."""
    write_html(runs["ordinary"], tmp_path / "run.html")
    show(browser, tmp_path / "run.html", 1280)
    covered = []
    for zoom in (4.0, 1.0):
        browser.evaluate(
            f"pushplan.view.zoom = {zoom}; [pushplan.view.x, pushplan.view.y] = pushplan.poseAt(1.0)"
        )
        pictures = []
        for on in ("true", "false"):
            browser.evaluate(f"document.getElementById('forces').checked = {on}; pushplan.seek(1.0)")
            pictures.append(_drawn(browser))
        covered.append(int(np.any(pictures[0] != pictures[1], axis=2).sum()))
    assert covered[0] > 4 * covered[1] > 0


def test_wheel_and_fingers_zoom_and_the_view_follows(
    runs: dict[str, Run], browser: Any, tmp_path: Path
) -> None:
    write_html(runs["ordinary"], tmp_path / "run.html")
    show(browser, tmp_path / "run.html", 390)
    middle = {"x": 195, "y": 250}
    browser.call("Input.dispatchMouseEvent", type="mouseWheel", deltaX=0, deltaY=-400, **middle)
    wheeled = browser.evaluate("pushplan.view.zoom")
    assert wheeled > 1.5
    for spread, kind in ((20, "touchStart"), (30, "touchMove"), (60, "touchMove"), (60, "touchEnd")):
        points = [{"x": 195 + side * spread, "y": 250, "id": k} for k, side in enumerate((-1, 1))]
        fingers = points if kind != "touchEnd" else []
        browser.call("Input.dispatchTouchEvent", type=kind, touchPoints=fingers)
    assert browser.evaluate("pushplan.view.zoom") > 1.5 * wheeled
    browser.evaluate("document.getElementById('follow').click(); pushplan.seek(1.0)")
    pose = browser.evaluate("pushplan.poseAt(1.0)")
    assert browser.evaluate("[pushplan.view.x, pushplan.view.y]") == pytest.approx(pose[:2])
    browser.evaluate("document.getElementById('fit').click()")
    assert browser.evaluate("pushplan.view.zoom") == 1.0
    assert browser.evaluate("getComputedStyle(document.getElementById('world')).touchAction") == "pan-y"


def _drawn(browser: Any) -> Any:
    """Return the pixels (h, w, 4) of the drawing of the room."""
    numbers = browser.evaluate("""(() => {
      const c = document.getElementById('world'), d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
      let text = ''; for (let k = 0; k < d.length; k += 1) text += String.fromCharCode(d[k]);
      return [c.height, c.width, btoa(text)]; })()""")
    return np.frombuffer(base64.b64decode(numbers[2]), np.uint8).reshape(*numbers[:2], 4)


def _pixels(browser: Any, colour: tuple[int, int, int]) -> int:
    near = np.abs(_drawn(browser)[..., :3].astype(int) - colour).max(axis=2) < 40
    return int(near.sum())
