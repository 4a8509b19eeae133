"""Layout of the documentation site on phones and desktops, light and dark.

It needs a built site: `sphinx-build -b html docs SITE`, and PUSHPLAN_SITE=SITE.
"""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from boxes import SCREENS, assert_tidy, chromium, show

DOCS = Path(__file__).resolve().parents[1] / "docs"
SITE = Path(os.environ.get("PUSHPLAN_SITE", "none"))
PAGES = ("index", "own-scenario", "logs", "api", "generated/pushplan.Chain")
PARTS = ("section > h1", "section > h2", "section > p:not(:has(img))", ".table-wrapper", "iframe", "dt.sig")
ELEMENTS = ", ".join([*PARTS, "article pre", "article img"])

pytestmark = pytest.mark.skipif(not (SITE / "index.html").is_file(), reason="needs PUSHPLAN_SITE, a built site")


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with chromium(tmp_path_factory.mktemp("site")) as found:
        yield found


@pytest.mark.parametrize(("width", "dark"), SCREENS)
@pytest.mark.parametrize("page", PAGES)
def test_nothing_overlaps_or_spills(page: str, width: int, dark: bool, browser: Any) -> None:
    show(browser, SITE / f"{page}.html", width, dark)
    assert_tidy(browser, ELEMENTS, width)


def test_no_page_is_wider_than_a_phone(browser: Any) -> None:
    pages = sorted(SITE.glob("*.html"))
    assert {page.stem for page in pages} > {page.stem for page in DOCS.glob("*.md")}
    for page in pages:
        show(browser, page, 390)
        assert browser.evaluate("document.documentElement.scrollWidth") <= 390, page


@pytest.mark.parametrize("width", [390, 1280])
def test_the_index_plays_a_run_without_scrolling(width: int, browser: Any) -> None:
    show(browser, SITE / "index.html", width)
    assert browser.evaluate("document.querySelector('iframe').src").endswith("_static/two-crates.html#playing")
    room = browser.evaluate("document.querySelector('iframe').getBoundingClientRect().toJSON()")
    played = (SITE / "_static" / "two-crates.html").as_uri() + "#playing"
    show(browser, played, int(room["width"]), height=int(room["height"]))
    assert browser.evaluate("document.documentElement.scrollHeight") <= room["height"]
