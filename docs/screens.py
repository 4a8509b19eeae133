"""Take the screenshots of the page on viewers anew: `python docs/screens.py`, with Chromium installed."""

from __future__ import annotations

import base64
import importlib.util
import shutil
import tempfile
import time
from pathlib import Path
from types import ModuleType
from typing import Any

from refresh import content
from stamp import stamp

import pushplan
from pushplan.logging.page import write_html
from pushplan.view.window import Window

ROOT = Path(__file__).parents[1]
TIME = 6.0
"""Of the run, that is shown, s."""
FADING = 12.0
"""For which the scene fades in, s; more than it takes with software rendering."""
POLISHED = "document.querySelector('#pushplan-answer')?.dataset.stage === 'polished'"


def main() -> None:
    """Plan, and photograph the page that plays the run."""
    program = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if program is None:
        raise SystemExit("there is no Chromium to take screenshots with")
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        scenario = pushplan.load_scenario("two-crates")
        pushplan.run(scenario, log=folder / "run.mcap", iterations=130_000, time_limit=600.0)
        recorded = pushplan.load_run(folder / "run.mcap")
        write_html(recorded, folder / "run.html")
        with _browser().chromium(program, folder / "profile") as browser:
            browser.open(folder / "run.html")
            browser.evaluate(f"pushplan.play(false), pushplan.seek({TIME})")
            _photograph(browser, ROOT / "docs" / "player.png", 1100, 700)
        with _browser().chromium(program, folder / "profile") as browser:
            _photograph_window(browser)


def _photograph_window(browser: Any) -> None:
    """Photograph `pushplan view` when its plan is polished."""
    window = Window(pushplan.load_scenario("two-crates"))
    try:
        _resize(browser, 1200, 760)  # before the camera is placed
        browser.open(window.url)
        while not browser.evaluate(POLISHED):
            time.sleep(0.1)
        time.sleep(FADING)
        browser.evaluate("document.querySelectorAll('.mantine-Notification-root').forEach(e => e.remove())")
        _photograph(browser, ROOT / "docs" / "view.png", 1200, 760)
    finally:
        window.close()


def _photograph(browser: Any, path: Path, width: int, height: int) -> None:
    _resize(browser, width, height)
    browser.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    path.write_bytes(base64.b64decode(browser.call("Page.captureScreenshot", format="png")["data"]))
    stamp(path, content("two-crates.png"))


def _resize(browser: Any, width: int, height: int) -> None:
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
    browser.call("Emulation.setDeviceMetricsOverride", **size)


def _browser() -> ModuleType:
    """Return the tests' driver of Chromium."""
    spec = importlib.util.spec_from_file_location("browser", ROOT / "tests" / "browser.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


if __name__ == "__main__":
    main()
