"""The report, the tables, the comparison of versions and its statistics, against known answers."""

import csv
import json
import re
from collections.abc import Callable, Generator, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from boxes import SCREENS, assert_tidy, chromium, show
from conftest import Captured

from pushplan.bench.batch import run_suite
from pushplan.bench.outcome import Outcome
from pushplan.bench.plots import cost_quartiles
from pushplan.bench.report import (
    by_planner,
    by_problem,
    comparisons,
    outcomes,
    render,
    spread,
    write_latex,
    write_report,
)
from pushplan.bench.results import Results, read_results, write_tables
from pushplan.bench.statistics import compare_versions, holm, median_interval, percentiles, rank_test
from pushplan.bench.store import Machine, ResultsFolder
from pushplan.bench.suite import RunSpec, suite_from_text
from pushplan.cli.main import main
from pushplan.plans.execution import wilson

Make = Callable[[RunSpec], Outcome]

SUITE = """\
format: pushplan-suite/1
name: made up
problems: [one-box, two-crates]
planners: [auto, {name: rrt, label: slow}]
seeds: 12
limits: {time: 4 s}
"""


def solved(spec: RunSpec, cost: float, first: float) -> Outcome:
    values = {
        "time": 2.0,
        "first_solution_time": first,
        "solution_length": cost,
        "min_margin": 0.1,
        "total_time": 2.1,
    }
    progress = ((first, 2.0 * cost, 1), (3.0 * first, cost, 2))
    return Outcome(spec.key, "ok", "", values, progress=progress, host="here")


def typical(spec: RunSpec) -> Outcome:
    """`slow` is ten times slower and a tenth costlier; one run is invalid, one crashes, one has no plan."""
    slow = spec.planner.name == "rrt"
    if slow and spec.problem.name == "one-box" and 3 <= spec.seed <= 5:
        spoilt = {"solution_length": 0.5, "first_solution_time": 0.1}
        return {
            3: Outcome(spec.key, "invalid", "it <slips>", spoilt),
            4: Outcome(spec.key, "crash", "killed by SIGSEGV\nFatal <error>"),
            5: Outcome(spec.key, "no plan", "there is none"),
        }[spec.seed]
    noise = 1.0 + 0.01 * spec.seed
    return solved(spec, (3.3 if slow else 3.0) * noise, (0.5 if slow else 0.05) * noise)


def make(folder: Path, outcome: Make = typical, text: str = SUITE) -> Results:
    def engine(specs: Iterable[RunSpec]) -> Generator[Outcome]:
        for spec in specs:
            yield outcome(spec)

    results = ResultsFolder(folder)
    with results.locked():
        run_suite(suite_from_text(text), results, engine, version="1")
    return read_results(folder)


def test_tables_show_the_made_up_results(tmp_path: Path) -> None:
    results = make(tmp_path)
    auto, slow = by_planner(results).rows
    assert auto[:5] == ["auto", "24", "24", "24", "100.0 [86.2, 100.0]"]
    assert slow[:4] == ["slow", "22", "21", "24"]
    assert slow[4].startswith("87.5 [")
    assert auto[5].startswith("53.3 [")
    assert by_planner(results).wrong == [1]
    assert outcomes(results).rows[1] == ["slow", "21", "1", "1", "1", "0", "0", "0", "0"]
    found = {row[0]: row for row in comparisons(results).rows}  # type: ignore[union-attr]
    assert found["first path"][4] == "× 10.000"
    assert found["first path"][6] == found["cost"][6] == "auto"
    assert found["solved"][4:] == ["-12.5 points", "0.250", "–"]


def _ranked(spec: RunSpec) -> Outcome:
    """Return results in which `auto`, and `slow` unless it is called `far`, rank by time; two of three trials
    arrive.
    """
    found = typical(spec)
    by_time = int(spec.label != "far")
    more = {"by_time": by_time, "duration": 20.0, "lower_bound": 10.0 if by_time else 2.0, "trial_success": 2 / 3}
    return replace(found, values={**found.values, **more}) if found.status == "ok" else found


def test_durations_stand_beside_costs_if_all_plans_are_ranked_by_time(tmp_path: Path) -> None:
    timed, mixed = make(tmp_path / "1", _ranked), make(tmp_path / "2", _ranked, SUITE.replace("slow", "far"))
    bounds = [{row[0] for row in spread(results).rows if "bound" in row[0]} for results in (timed, mixed)]
    by_time = {"lower bound of the duration [s]"}
    assert bounds == [by_time, by_time | {"lower bound of the cost [m]"}]
    tables = [(by_planner(results), by_problem(results)) for results in (timed, mixed)]
    assert [["duration, s" in table.head for table in pair] for pair in tables] == [[True] * 2, [False] * 2]
    for table in tables[0]:
        shown = dict(zip(table.head, table.rows[0], strict=True))
        assert shown["duration, s"].startswith("20.00")
        assert shown["trials that arrive, %"] == "66.7"
    compared = [{row[0] for row in comparisons(results).rows} for results in (timed, mixed)]  # type: ignore[union-attr]
    assert compared[0] - compared[1] == {"duration"}


def test_latex_has_three_tables_with_equal_digits_in_a_column(tmp_path: Path) -> None:
    write_latex(make(tmp_path, _ranked), tmp_path / "tables.tex")
    text = (tmp_path / "tables.tex").read_text()
    assert re.findall(r"\\label\{(.*?)\}", text) == ["tab:planners", "tab:problems", "tab:comparisons"]
    assert text.count(f"(planning limit 4 s; {Machine.this().text})".replace("_", r"\_")) == 3
    problems = text.split(r"\midrule")[2].split(r"\bottomrule")[0]
    cells = [line.removesuffix(r" \\").split(" & ")[3:] for line in problems.strip().splitlines()]
    for column in zip(*cells, strict=True):
        assert len({len(cell.partition(".")[2]) for cell in column if cell != "–"}) == 1


def test_median_costs_over_time_begin_once_half_of_the_runs_have_a_path(tmp_path: Path) -> None:
    results = make(tmp_path)
    times = np.array([0.01, 0.04, 0.052, 0.2, 3.0])
    low, middle, high = cost_quartiles(results, "auto", times)
    assert np.isinf(middle[:2]).all()
    assert np.isinf([low[2], middle[2], high[2]]).all()
    assert middle[3] == pytest.approx(1.07 / 1.01, rel=0.02)
    assert low[3] <= middle[3] <= high[3]
    assert cost_quartiles(results, "nobody", times).shape == (3, 5)


def test_the_page_is_self_contained_and_marks_invalid_runs(tmp_path: Path) -> None:
    results = make(tmp_path)
    (tmp_path / "figures").mkdir()
    text = render(results, tmp_path / "figures")
    addresses = re.findall(r'(?:src|href)="(.*?)"', text)
    assert all(a.startswith(("data:image/", "logs/", "figures/", "#")) for a in addresses)
    assert all((tmp_path / a).stat().st_size > 1000 for a in addresses if a.startswith("figures/"))
    assert {a[1:] for a in addresses if a.startswith("#")} == set(re.findall(r'<h2 id="(.*?)"', text))
    assert sum(a.startswith("data:image/svg+xml") for a in addresses) == 4
    assert "http" not in re.sub(r"data:image/[^\"]*", "", text)
    assert '<span class="wrong">1 invalid</span>' in text
    assert re.search(r'<tr class="wrong"><td>one-box, slow, seed 3</td>.*?<td>it &lt;slips&gt;</td>', text)
    assert "<summary>killed by SIGSEGV</summary><pre>Fatal &lt;error&gt;</pre>" in text
    assert "1-12" in text
    assert "name: made up" in text


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
    """Return outcomes with scaled costs and times, in which the first seeds fail."""

    def outcome(spec: RunSpec) -> Outcome:
        if spec.seed <= fail:
            return Outcome(spec.key, "no plan")
        noise = 1.0 + 0.01 * (spec.seed * 7 % 12)
        return solved(spec, 3.0 * cost * noise, 0.05 * first * noise)

    return outcome


@pytest.mark.parametrize(("change", "better", "worse", "regression"), [
    ({}, 0, 0, False), ({"cost": 0.9}, 2, 0, False), ({"cost": 1.2}, 0, 2, True), ({"cost": 1.02}, 0, 2, False),
    ({"first": 2.0, "cost": 0.9}, 2, 2, True), ({"fail": 8}, 0, 6, True),
])  # fmt: skip
def test_regressions_exceed_chance_and_threshold(
    change: dict[str, float], better: int, worse: int, regression: bool, tmp_path: Path
) -> None:
    old, new = make(tmp_path / "old", _scaled()), make(tmp_path / "new", _scaled(**change))  # type: ignore[arg-type]
    found = compare_versions(old, new)
    assert (len(found.better), len(found.worse), found.is_regression) == (better, worse, regression)
    assert compare_versions(old, new, threshold=10.0).is_regression is ("fail" in change)


def test_unsolved_runs_have_the_largest_rank() -> None:
    """An infinite value ranks like any value above all others, on both sides."""
    first, second = np.array([1.0, 1.1, 1.2, 3.0, 1.4, 1.5]), np.array([2.0, 1.0, 1.9, 1.0, 1.8, 2.9])
    for side in (first, second):
        for lost in (0, 3):
            side[lost], kept = np.inf, side[lost]
            infinite = rank_test(first, second)
            side[lost] = 1e6
            assert infinite == rank_test(first, second)
            side[lost] = kept
    assert rank_test(first, second) == rank_test(second, first)
    assert rank_test(np.ones(6), np.arange(2.0, 8.0)) < rank_test(first, second)
    first[1], second[2] = np.inf, np.inf
    assert rank_test(first, second) == rank_test(second, first)


def test_regressions_give_exit_code_4(tmp_path: Path, capsys: Captured) -> None:
    for name, change in (("old", {}), ("new", {"cost": 1.2, "first": 0.5}), ("failing", {"fail": 9})):
        make(tmp_path / name, _scaled(**change))

    def compared(name: str, *words: str) -> tuple[int, str]:
        code = main(["bench", "--compare", str(tmp_path / "old"), str(tmp_path / name), *words])
        return code, capsys.readouterr().out

    code, out = compared("new")
    assert code == 4
    assert re.search(r"^better: auto, first path: × 0\.500 in 24 runs \(p = ", out, re.MULTILINE)
    assert re.search(r"^worse: slow, cost: × 1\.200 in 24 runs \(p = ", out, re.MULTILINE)
    assert compared("new", "--threshold", "30")[0] == 0
    assert compared("old") == (0, "no significant change\n")
    assert compared("nowhere")[0] == 2
    code, out = compared("failing", "--json")
    document = json.loads(out)
    assert (code, document["regression"]) == (4, True)
    assert [one["effect"] for one in document["comparisons"] if one["respect"] == "cost"] == [None, None]


def test_nothing_overlaps_or_spills(tmp_path: Path) -> None:
    write_report(make(tmp_path / "results"), tmp_path / "report.html", with_pictures=False)
    with chromium(tmp_path) as browser:
        for width, dark in SCREENS:
            show(browser, tmp_path / "report.html", width, dark)
            assert_tidy(browser, "h1, h2, body > p, .scroll, .note, .plots img, figcaption, pre", width)
            ground = browser.evaluate("getComputedStyle(document.body).backgroundColor")
            assert ground == ("rgb(23, 25, 28)" if dark else "rgb(255, 255, 255)")


@pytest.mark.parametrize("count", [1, 2, 7, 12])
def test_percentiles_are_those_of_numpy_and_infinite_between_a_number_and_infinity(count: int) -> None:
    values, which = np.random.default_rng(count).normal(size=count), (0, 5, 25, 50, 75, 95, 100)
    assert percentiles(values, which) == pytest.approx(np.percentile(values, which))
    assert median_interval([values])[0] == pytest.approx(np.median(values))
    ordered = np.sort(values)
    for finite in range(count + 1):
        partly = np.where(np.arange(count) < finite, ordered, np.inf)
        expected = [np.inf if p / 100 * (count - 1) > finite - 1 else np.percentile(values, p) for p in which]
        assert percentiles(partly, which) == pytest.approx(expected)
        assert median_interval([partly])[0] == pytest.approx(expected[3])


def test_bootstrap_intervals_have_their_nominal_coverage() -> None:
    """Medians of 60 exponential times, with a fixed seed."""
    rng = np.random.default_rng(1)
    hits = 0
    for _ in range(200):
        _, low, high = median_interval([rng.exponential(size=30), rng.exponential(size=30)])
        hits += low <= np.log(2.0) <= high
    assert 0.90 <= hits / 200 <= 0.99


@pytest.mark.parametrize(("successes", "count"), [(16, 16), (0, 16), (12, 16), (90, 240)])
def test_intervals_of_shares_are_those_of_the_score_test(successes: int, count: int) -> None:
    """Only at its ends p, the share is 1.96 standard deviations of p away (Wilson's definition)."""
    low, high = wilson(successes, count)
    assert 0.0 <= low < high <= 1.0
    share = successes / count
    for p in (low, high):
        if 0.0 < p < 1.0:
            assert abs(share - p) / np.sqrt(p * (1.0 - p) / count) == pytest.approx(1.959964, rel=1e-6)
    if successes == count:
        assert low == pytest.approx(1.0 / (1.0 + 1.959964**2 / count), rel=1e-6)
        assert high == 1.0


def test_holm_s_correction_matches_his_example() -> None:
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.9, 0.8]) == [1.0, 1.0]
    assert holm([]) == []
