"""The report is right at first sight: nothing overlaps or spills on a phone or a desk, on light and dark ground."""

from pathlib import Path
from typing import Any

from boxes import SCREENS, assert_tidy, chromium, show
from made_up_results import make

from pushplan.bench.report import write_report


def test_nothing_overlaps_or_spills(tmp_path: Path) -> None:
    write_report(make(tmp_path / "results"), tmp_path / "report.html", with_pictures=False)
    with chromium(tmp_path) as browser:
        for width, dark in SCREENS:
            show(browser, tmp_path / "report.html", width, dark)
            assert_tidy(browser, "h1, h2, body > p, .scroll, .note, .plots img, figure, pre", width)
            ground = browser.evaluate("getComputedStyle(document.body).backgroundColor")
            assert ground == ("rgb(23, 25, 28)" if dark else "rgb(255, 255, 255)")
            assert _numbers_stand_right(browser)


def _numbers_stand_right(browser: Any) -> bool:
    """Whether every cell under `total` and none under `planner` stands to the right."""
    found: list[str] = (
        browser.evaluate("""[...document.querySelectorAll('table')].slice(0, 1).flatMap((table) => {
      const heads = [...table.rows[0].cells].map((cell) => cell.textContent);
      return [...table.rows].map((row) => ['planner', 'total', 'share solved']
        .map((name) => getComputedStyle(row.cells[heads.indexOf(name)]).textAlign).join());
    })""")
    )
    return len(found) > 1 and set(found) == {"left,right,right"}
