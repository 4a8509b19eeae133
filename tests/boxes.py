"""Check a page for overlaps and overflow, from the boxes of its elements in a headless Chromium."""

import os
import shutil
from base64 import b64decode
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import combinations
from pathlib import Path
from typing import Any

import pytest
from browser import chromium as started

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")

SCREENS = [(width, dark) for width in (390, 1280) for dark in (False, True)]
"""Widths of a phone and a desktop, pixels; light and dark."""

KEPT = os.environ.get("PUSHPLAN_SCREENS")
"""Folder for pictures of the pages; without it, none are saved."""

_ERRORS = ("Runtime.exceptionThrown", "Runtime.consoleAPICalled", "Log.entryAdded")

_LEAVES = """(() => {
  const shown = (e) => e.checkVisibility({ visibilityProperty: true, opacityProperty: true });
  const found = [...document.querySelectorAll(SELECTOR)].filter(shown);
  const named = (e) => (e.textContent || e.id || e.tagName).trim().slice(0, 40);
  return found.map((e) => ({ text: named(e), box: e.getBoundingClientRect() }))
    .filter(({ box }) => box.width > 0 && box.height > 0)
    .map(({ text, box }) => ({ text, left: box.left, right: box.right, top: box.top, bottom: box.bottom }));
})()"""


@contextmanager
def chromium(folder: Path) -> Iterator[Any]:
    """Return a browser; skip the test without one."""
    if CHROMIUM is None:
        pytest.skip("needs chromium")
    with started(CHROMIUM, folder / "profile") as browser:
        yield browser


def show(browser: Any, page: Path | str, width: int, dark: bool = False, height: int = 800) -> None:
    """Open a file in a window of some size."""
    theme = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
    browser.call("Emulation.setEmulatedMedia", features=theme)
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500}
    browser.call("Emulation.setDeviceMetricsOverride", **size)
    browser.events.clear()
    browser.open(page)
    browser.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def keep(browser: Any, name: str) -> None:
    """Save a picture of the page if pictures are requested."""
    if KEPT is None:
        return
    if browser.evaluate("document.querySelector('#pushplan-answer') !== null"):  # its scene fades in
        browser.evaluate("new Promise((done) => setTimeout(done, 5000))")
        browser.evaluate("document.querySelectorAll('.mantine-Notification-root').forEach((e) => e.remove())")
    picture = browser.call("Page.captureScreenshot", format="png", captureBeyondViewport=True)["data"]
    path = Path(KEPT) / f"{name.replace(' ', '-')}.png"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b64decode(picture))


def boxes(browser: Any, selector: str) -> list[dict[str, Any]]:
    """Return the boxes of the visible elements that a selector finds, pixels."""
    found: list[dict[str, Any]] = browser.evaluate(_LEAVES.replace("SELECTOR", repr(selector)))
    return found


def overlapping(found: list[dict[str, Any]], slack: float = 0.5) -> list[tuple[str, str]]:
    """Return the pairs of boxes that overlap by more than `slack` pixels."""
    return [
        (a["text"], b["text"])
        for a, b in combinations(found, 2)
        if a["left"] + slack < b["right"]
        and b["left"] + slack < a["right"]
        and a["top"] + slack < b["bottom"]
        and b["top"] + slack < a["bottom"]
    ]


def assert_tidy(browser: Any, selector: str, width: int) -> None:
    """Assert that no element overlaps another or overflows to the side, and that the console has no error."""
    found = boxes(browser, selector)
    assert len(found) > 2
    assert overlapping(found) == [], overlapping(found)
    assert [one["text"] for one in found if one["left"] < 0.0 or one["right"] > width + 0.5] == []
    assert browser.evaluate("document.documentElement.scrollWidth") <= width
    assert browser.told(*_ERRORS) == []
