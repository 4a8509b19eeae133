"""The report of a benchmark: one page that holds everything it shows and asks the network for nothing."""

from __future__ import annotations

import html
import json
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from pushplan.bench.processes.outcome import INVALID
from pushplan.bench.reports import plots, tables
from pushplan.bench.reports.tables import Table
from pushplan.bench.reports.worst import failures, pictures, worst_runs
from pushplan.bench.storage.results import MISSING, Results, RunRow
from pushplan.util.files import write_whole

MOST_FAILURES = 200
"""Failed runs that are listed, at most."""

_STYLE = """\
:root{--ground:#fff;--ink:#2f3338;--faint:#6a7178;--rule:#e4e7ea;--line:#ccd1d6;--head:#f4f6f7;--bad:#b3261e;
--link:#1f5f9b;color-scheme:light}
@media (prefers-color-scheme:dark){:root{--ground:#17191c;--ink:#e8e6e1;--faint:#9aa0a8;--rule:#2c3036;--line:#3c4148;
--head:#22262b;--bad:#ff8a80;--link:#7fb8ee;color-scheme:dark}}
body{font:15px/1.5 system-ui,sans-serif;background:var(--ground);color:var(--ink);max-width:1180px;margin:2em auto;
padding:0 1em;overflow-wrap:anywhere}a{color:var(--link)}
h1{font-size:1.6em;margin-bottom:0}h2{font-size:1.2em;margin:2em 0 .4em;border-bottom:1px solid var(--line)}
table{border-collapse:collapse;font-size:.87em;font-variant-numeric:tabular-nums;margin:.5em 0;overflow-wrap:normal}
th,td{padding:.2em .7em;text-align:left;border-bottom:1px solid var(--rule);vertical-align:top}
th.number,td.number{text-align:right;white-space:nowrap}
th{background:var(--head);position:sticky;top:0}.wrong td,.wrong{color:var(--bad);font-weight:600}
.note{font-size:.85em;color:var(--faint);max-width:75em}.plots{display:flex;flex-wrap:wrap;gap:1em}
figure{margin:0 0 1em}figcaption{font-size:.85em}img{max-width:100%;height:auto;background:#fff;border-radius:6px}
pre{font-size:.8em;white-space:pre-wrap;margin:0}.scroll{overflow-x:auto}
"""

_NUMBER = re.compile(rf"[+-]?\d|x \d|{tables.NOTHING}$")
"""How the text of a number begins, whatever its unit."""


def write_report(results: Results, path: Path, with_pictures: bool = True) -> None:
    """Write the report.

    Args:
        results: What to report.
        path: HTML file to write, in the folder of the results, so that its links lead to the logs.
        with_pictures: Draw the runs most worth a look, which takes about a second each.
    """
    write_whole(path, render(results, with_pictures).encode())


def render(results: Results, with_pictures: bool = True) -> str:
    """Return the report as HTML."""
    title = f"Benchmark {results.about['name']}"
    shown = worst_runs(results)
    drawn = pictures(results, shown) if with_pictures else {}
    sections = [
        _summary(results),
        _section("Planners", _table(tables.by_planner(results)) + _table(tables.outcomes(results))),
        _section("Over time", _plots(results)),
        _section("Differences between planners", _table(tables.comparisons(results))),
        _section("Spread", _table(tables.spread(results))),
        _section("Problems", _table(tables.by_problem(results))),
        _failures(results),
        _section("Runs worth a look", "".join(_figure(run, drawn.get(run.key)) for run in shown)),
        _setup(results),
    ]
    body = f"<h1>{_text(title)}</h1>{''.join(sections)}"
    view = '<meta name="viewport" content="width=device-width, initial-scale=1">'
    head = f'<meta charset="utf-8">{view}<title>{_text(title)}</title><style>{_STYLE}</style>'
    return f'<!DOCTYPE html>\n<html lang="en"><head>{head}</head><body>{body}</body></html>\n'


def _text(value: object) -> str:
    return html.escape(str(value))


def _section(title: str, content: str) -> str:
    return f"<h2>{_text(title)}</h2>{content}" if content else ""


def _table(table: Table | None) -> str:
    if table is None or not table.rows:
        return ""
    numbers = [all(_NUMBER.match(word) for word in column) for column in zip(*table.rows, strict=True)]
    head = _cells("th", table.head, numbers)
    rows = "".join(
        f"<tr{' class=wrong' if i in table.wrong else ''}>{_cells('td', row, numbers)}</tr>"
        for i, row in enumerate(table.rows)
    )
    note = f'<p class="note">{_text(table.note)}</p>' if table.note else ""
    return f'<div class="scroll"><table><tr>{head}</tr>{rows}</table></div>{note}'


def _cells(tag: str, words: Sequence[str], numbers: Sequence[bool]) -> str:
    """Return the cells of a row; columns of numbers stand to the right."""
    return "".join(
        f"<{tag}{' class=number' if is_number else ''}>{_text(word)}</{tag}>"
        for word, is_number in zip(words, numbers, strict=True)
    )


def _summary(results: Results) -> str:
    counts = Counter(run.outcome for run in results.runs)
    done = len(results.runs) - counts[MISSING]
    parts = [f"{done} of {len(results.runs)} runs done"]
    for outcome, count in counts.items():
        word = f"{count} {_text(outcome)}"
        parts.append(f'<span class="wrong">{word}</span>' if outcome == INVALID else word)
    about = results.about
    where = (
        f"{about['machine']}; pushplan {about['version']}; begun {about['started']}, {about['seconds']:.0f} s"
    )
    return f"<p>{', '.join(parts)}</p><p class=note>{_text(where)}</p>"


def _plots(results: Results) -> str:
    if not any(run.solved for run in results.runs):
        return "<p>No run has a valid path.</p>"
    drawn = (
        (plots.draw_success, "Success"),
        (plots.draw_cost, "Cost: median and quartiles"),
        (plots.draw_first_times, "First path: quartiles, 5 to 95 %, runs"),
        (plots.draw_margins, "Margin against cost"),
    )
    images = (f'<img alt="{title}" src="{plots.picture(draw, results, title)}">' for draw, title in drawn)
    return f'<div class="plots">{"".join(images)}</div>'


def _link(run: RunRow) -> str:
    words = f"{run.problem}, {run.planner}, seed {run.seed}"
    if run.log is None:
        return _text(words)
    return f'<a href="{_text(run.log)}">{_text(words)}</a>'


def _failures(results: Results) -> str:
    runs = failures(results)
    rows = "".join(_failure(run) for run in runs[:MOST_FAILURES])
    more = f"<p>and {len(runs) - MOST_FAILURES} more</p>" if len(runs) > MOST_FAILURES else ""
    head = "<tr><th>run</th><th>key</th><th>outcome</th><th>message</th></tr>"
    return _section(
        "Failures", f'<div class="scroll"><table>{head}{rows}</table></div>{more}' if runs else ""
    )


def _failure(run: RunRow) -> str:
    mark = ' class="wrong"' if run.outcome == INVALID else ""
    first, _, rest = run.message.partition("\n")
    message = (
        f"<details><summary>{_text(first)}</summary><pre>{_text(rest)}</pre></details>"
        if rest
        else _text(first)
    )
    return f"<tr{mark}><td>{_link(run)}</td><td>{run.key}</td><td>{_text(run.outcome)}</td><td>{message}</td></tr>"


def _figure(run: RunRow, image: str | None) -> str:
    cost = f", cost {run.cost:.4g} m" if run.solved else f": {run.message.partition(chr(10))[0]}"
    mark = ' class="wrong"' if run.outcome == INVALID else ""
    caption = f"<figcaption{mark}>{_link(run)} ({run.key}): {_text(run.outcome)}{_text(cost)}</figcaption>"
    shown = f'<img alt="{_text(run.problem)}" src="{image}" width="760">' if image else ""
    return f"<figure>{caption}{shown}</figure>"


def _setup(results: Results) -> str:
    about = results.about
    versions = json.loads(str(about["versions"]))
    seeds = sorted({run.seed for run in results.runs})
    hosts = sorted({run.host for run in results.runs if run.host})
    rows: Sequence[Sequence[str]] = [
        ("machine", str(about["machine"])),
        ("runs done on", ", ".join(hosts) or tables.NOTHING),
        ("versions", ", ".join(f"{name} {version}" for name, version in versions.items())),
        ("seeds", _ranges(seeds)),
    ]
    source = about["source"]
    text = source.decode("utf-8") if isinstance(source, bytes) else str(source)
    return _section("Set-up", _table(Table(("", ""), rows)) + f"<pre>{_text(text)}</pre>")


def _ranges(numbers: Sequence[int]) -> str:
    """Return increasing numbers as ranges, e.g. `1-10, 12`."""
    parts: list[list[int]] = []
    for n in numbers:
        if parts and n == parts[-1][1] + 1:
            parts[-1][1] = n
        else:
            parts.append([n, n])
    return ", ".join(str(low) if low == high else f"{low}-{high}" for low, high in parts)
