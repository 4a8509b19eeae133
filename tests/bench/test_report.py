"""The report, the tables and the comparison of versions, from results made up so that the answers are known."""

import csv
import html.parser
import json
import re
from pathlib import Path

import numpy as np
import pytest
from made_up_results import Make, make, solved

from pushplan.bench.executor import isolated
from pushplan.bench.outcome import Outcome
from pushplan.bench.report import (
    by_planner,
    comparisons,
    cost_quartiles,
    outcomes,
    render,
    write_latex,
    write_report,
)
from pushplan.bench.statistics import compare_versions
from pushplan.bench.store import write_tables
from pushplan.bench.suite import RunSpec
from pushplan.cli.main import main

Captured = pytest.CaptureFixture[str]


class Page(html.parser.HTMLParser):
    """Collects addresses, and checks that tags are closed in order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self.open: list[str] = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.addresses += [value for name, value in attributes if name in ("src", "href") and value]
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_tables_say_what_was_made_up(tmp_path: Path) -> None:
    results = make(tmp_path)
    auto, slow = by_planner(results).rows
    assert auto[:5] == ["auto", "24", "24", "24", "100.0 % [86.2 %, 100.0 %]"]
    assert slow[:4] == ["slow", "22", "21", "24"]
    assert slow[4].startswith("87.5 % [")
    assert auto[5].startswith("53.5 ms [")
    assert by_planner(results).wrong == [1]
    assert outcomes(results).rows[1] == ["slow", "21", "1", "1", "1", "0", "0", "0", "0"]
    found = {row[0]: row for row in comparisons(results).rows}  # type: ignore[union-attr]
    assert found["first path"][4] == "x 10"
    assert found["first path"][6] == found["cost"][6] == "auto"
    assert found["solved"][4:] == ["-12.5 points", "0.25", "–"]


def test_costs_over_time_begin_when_half_of_the_runs_have_a_path(tmp_path: Path) -> None:
    results = make(tmp_path)
    times = np.array([0.01, 0.04, 0.052, 0.2, 3.0])
    low, middle, high = cost_quartiles(results, "auto", times)
    assert np.isinf(middle[:2]).all()
    assert np.isinf([low[2], middle[2], high[2]]).all()
    assert middle[3] == pytest.approx(1.07 / 1.01, rel=0.02)
    assert low[3] <= middle[3] <= high[3]
    assert cost_quartiles(results, "nobody", times).shape == (3, 5)


def test_the_page_holds_all_it_shows_and_marks_what_is_invalid(tmp_path: Path) -> None:
    results = make(tmp_path)
    text = render(results)
    page = Page(text)
    assert all(a.startswith(("data:image/", "logs/")) for a in page.addresses)
    assert sum(a.startswith("data:image/svg+xml") for a in page.addresses) == 4
    assert "http" not in re.sub(r"data:image/[^\"]*", "", text)
    assert '<span class="wrong">1 invalid</span>' in text
    assert re.search(r'<tr class="wrong"><td>one-box, slow, seed 3</td>.*?<td>it &lt;slips&gt;</td>', text)
    assert "<summary>killed by SIGSEGV</summary><pre>Fatal &lt;error&gt;</pre>" in text
    assert "1-12" in text
    assert "name: made up" in text


def test_pictures_and_links_lead_to_the_logs(tmp_path: Path) -> None:
    results = make(
        tmp_path, isolated, "format: pushplan-suite/1\nproblems: [one-box]\nseeds: 1\nlimits: {time: 1}\n"
    )
    write_report(results, tmp_path / "report.html")
    addresses = Page((tmp_path / "report.html").read_text()).addresses
    assert any(a.startswith("data:image/png") for a in addresses)
    (link,) = {a for a in addresses if a.startswith("logs/")}
    assert (tmp_path / link).is_file()


def test_tables_for_a_paper_are_latex_with_the_report_s_numbers(tmp_path: Path) -> None:
    results = make(tmp_path)
    write_latex(results, tmp_path / "tables.tex")
    text = (tmp_path / "tables.tex").read_text()
    assert text.count(r"\begin{tabular}") == text.count(r"\end{tabular}") >= 2
    assert not re.search(r"(?<!\\)[%_#$]", re.sub(r"(?m)^%.*$", "", text))
    for row in by_planner(results).rows:
        assert row[0].replace("_", r"\_") in text
    widths = {line.count(" & ") for line in text.partition(r"\end{tabular}")[0].splitlines() if " & " in line}
    assert widths == {len(by_planner(results).head) - 1}


def test_tables_for_other_programs_hold_every_run(tmp_path: Path) -> None:
    results = make(tmp_path)
    write_tables(results, tmp_path)
    with (tmp_path / "runs.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 48
    assert rows[0]["problem"] == "one-box"
    assert float(rows[0]["solution_length"]) == results.runs.cost[0]
    assert rows[0]["solution_clearance"] == ""
    assert {row["outcome"] for row in rows} == {"ok", "invalid", "crash", "no plan"}
    with (tmp_path / "progress.csv").open(newline="") as file:
        assert len(list(csv.DictReader(file))) == len(results.progress) > 48


def _scaled(cost: float = 1.0, first: float = 1.0, fail: int = 0) -> Make:
    """Return outcomes with costs and times multiplied, of which the first seeds fail."""

    def outcome(spec: RunSpec) -> Outcome:
        if spec.seed <= fail:
            return Outcome(spec.key, "no plan")
        noise = 1.0 + 0.01 * (spec.seed * 7 % 12)
        return solved(spec, 3.0 * cost * noise, 0.05 * first * noise)

    return outcome


@pytest.mark.parametrize(
    ("change", "better", "worse", "regression"),
    [
        ({}, 0, 0, False),
        ({"cost": 0.9}, 2, 0, False),
        ({"cost": 1.2}, 0, 2, True),
        ({"cost": 1.02}, 0, 2, False),
        ({"first": 2.0, "cost": 0.9}, 2, 2, True),
        ({"fail": 8}, 0, 6, True),
    ],
)
def test_versions_are_compared_beyond_chance_and_threshold(
    change: dict[str, float], better: int, worse: int, regression: bool, tmp_path: Path
) -> None:
    old, new = make(tmp_path / "old", _scaled()), make(tmp_path / "new", _scaled(**change))  # type: ignore[arg-type]
    found = compare_versions(old, new)
    assert (len(found.better), len(found.worse), found.is_regression) == (better, worse, regression)
    assert compare_versions(old, new, threshold=10.0).is_regression is ("fail" in change)


def test_a_run_that_is_invalid_now_is_a_regression(tmp_path: Path) -> None:
    def one_invalid(spec: RunSpec) -> Outcome:
        if (spec.problem.name, spec.planner.name, spec.seed) == ("one-box", "rrt", 7):
            return Outcome(spec.key, "invalid", "it slips")
        return _scaled()(spec)

    old, new = make(tmp_path / "old", _scaled()), make(tmp_path / "new", one_invalid)
    found = compare_versions(old, new, threshold=10.0)
    assert list(found.newly_invalid.seed) == [7]
    assert found.is_regression
    assert not compare_versions(new, new).is_regression
    assert not compare_versions(new, old).is_regression


def test_the_command_tells_regressions_with_exit_code_4(tmp_path: Path, capsys: Captured) -> None:
    make(tmp_path / "old", _scaled())
    make(tmp_path / "new", _scaled(cost=1.2, first=0.5))
    words = ["bench", "--compare", str(tmp_path / "old"), str(tmp_path / "new")]
    assert main(words) == 4
    out = capsys.readouterr().out
    assert re.search(r"^better: auto, first path: x 0\.5 in 24 runs \(p = ", out, re.MULTILINE)
    assert re.search(r"^worse: slow, cost: x 1\.2 in 24 runs \(p = ", out, re.MULTILINE)
    assert out.endswith("a regression: worse by more than 5 %, or invalid now\n")
    assert main([*words, "--threshold", "30"]) == 0
    assert capsys.readouterr().out.endswith("no regression: nothing is worse by more than 30 %\n")
    assert main([*words, "--json"]) == 4
    document = json.loads(capsys.readouterr().out)
    assert document["regression"] is True
    assert len(document["comparisons"]) == 6
    assert main(["bench", "--compare", str(tmp_path / "old"), str(tmp_path / "old")]) == 0
    assert capsys.readouterr().out == "nothing has changed beyond chance\n"
    assert main(["bench", "--compare", str(tmp_path / "old"), str(tmp_path / "nowhere")]) == 2
    capsys.readouterr()
    make(tmp_path / "failing", _scaled(fail=9))
    assert main(["bench", "--compare", str(tmp_path / "old"), str(tmp_path / "failing"), "--json"]) == 4
    comparisons = json.loads(capsys.readouterr().out)["comparisons"]
    assert [one["effect"] for one in comparisons if one["respect"] == "cost"] == [None, None]
