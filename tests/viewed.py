"""The window in a headless Chromium: screen positions of its handles, and its answers."""

import time
from pathlib import Path
from typing import Any

import numpy as np

from pushplan.geometry import se2
from pushplan.util.arrays import FloatArray
from pushplan.view.window import Window

SIZE = (1200, 800)
"""Size of the page, pixels."""

_GRIP = 1.0 / 7.0 + 0.225 / 2.0
"""Middle of the square that drags in the plane, as a share of an arrow's length, along both axes."""

_WATCH = """window.painted = 0;
(function paint() { window.painted += 1; requestAnimationFrame(paint); })()"""


def open_window(browser: Any, window: Window) -> None:
    """Open a window and wait until its plan is polished."""
    size = {"width": SIZE[0], "height": SIZE[1], "deviceScaleFactor": 1, "mobile": False}
    browser.call("Emulation.setDeviceMetricsOverride", **size)
    browser.open(window.url)
    wait_for(browser, "document.querySelector('#pushplan-answer')?.dataset.stage === 'polished'")
    browser.evaluate(_WATCH)
    painted(browser, 5)


def painted(browser: Any, frames: int = 2) -> None:
    """Wait for new frames, because the window updates the hovered object only in the next one."""
    wait_for(browser, f"window.painted >= {int(browser.evaluate('window.painted')) + frames}")


def wait_for(browser: Any, condition: str, seconds: float = 60.0) -> None:
    """Wait until an expression of JavaScript is true."""
    end = time.monotonic() + seconds
    while not browser.evaluate(condition):
        if time.monotonic() > end:
            seen = browser.evaluate("document.body.innerText.slice(0, 500)")
            raise AssertionError(f"waited in vain for {condition}; the page says {seen!r}")
        time.sleep(0.05)


def drag(browser: Any, window: Window, begin: FloatArray, end: FloatArray, steps: int = 3) -> None:
    """Drag a handle from its pose (3,) to another with the same heading, in steps; try again if nothing was grabbed.
    The mouse rests for two frames before the release, or releases the handle in the last move.
    """
    draft = window.draft
    browser.evaluate("window.before = Number(document.querySelector('#pushplan-answer').dataset.number)")
    for _ in range(3):
        _drag(browser, window, begin, end, steps)
        for _ in range(100):
            time.sleep(0.05)
            if window.draft is not draft:
                return


def _drag(browser: Any, window: Window, begin: FloatArray, end: FloatArray, steps: int) -> None:
    size = _GRIP * window.stage.handle_size
    points = [se2.compose(pose, [size, size, 0.0])[:2] for pose in np.linspace(begin, end, steps + 1)]
    places = [on_screen(window, point) for point in points]
    kinds = ["mouseMoved", "mousePressed", *["mouseMoved"] * steps, "mouseReleased"]
    for i, (kind, (x, y)) in enumerate(zip(kinds, [places[0], *places, places[-1]], strict=True)):
        browser.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=min(i, 1), clickCount=1)
        painted(browser)


def click(browser: Any, label: str) -> None:
    """Click the button of the panel with a label."""
    button = f"[...document.querySelectorAll('button')].find((it) => it.textContent.trim() === {label!r})"
    wait_for(browser, f"{button} && !{button}.disabled")
    browser.evaluate(f"{button}.click()")


def downloaded(folder: Path, seconds: float = 30.0) -> str:
    """Return the text of the only file that a browser saves in a folder, once it is complete."""
    end = time.monotonic() + seconds
    while not (found := [file for file in folder.iterdir() if file.suffix != ".crdownload"]):
        assert time.monotonic() < end, "waited in vain for a download"
        time.sleep(0.05)
    return found[0].read_text()


def next_played(window: Window, seconds: float = 0.05) -> FloatArray | None:
    """Return the next pose of the played chain; None if nothing is played."""
    time.sleep(seconds)
    return window.stage.played


def on_screen(window: Window, point: FloatArray) -> tuple[float, float]:
    """Return the page position of a floor point (2,), pixels, through the camera of the only viewer."""
    (client,) = window.server.get_clients().values()
    camera = client.camera
    w, x, y, z = camera.wxyz
    axes = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    right, down, depth = axes.T @ (np.array([*point, 0.0]) - camera.position)
    scale = 0.5 * SIZE[1] / np.tan(0.5 * camera.fov)
    return 0.5 * SIZE[0] + scale * right / depth, 0.5 * SIZE[1] + scale * down / depth


def shown_after(browser: Any, stage: str) -> None:
    """Wait until the answer to the last drag has reached a stage."""
    answer = "document.querySelector('#pushplan-answer').dataset"
    wait_for(browser, f"Number({answer}.number) > window.before && {answer}.stage === {stage!r}")
