"""Thousands of files gone wrong: each must be a scenario, a suite or a located message, soon and with little memory.

Run `python benchmarks/mutated_files.py [--files 10000] [--plans 200] [--seed 1]`. The packaged scenarios, the same
with intervals, and for every fifth file small suites, are mutated as text and as documents. Every file is read and
checked as by `pushplan check` and `pushplan bench`; of the valid scenarios the first `--plans` are planned too.
Prints counts, the slowest file and the memory at its peak; exits 1 on anything but a valid file or a message
with its place, on a file that takes longer than 5 s of the processor, or when memory exceeds 500 MB.
"""

from __future__ import annotations

import argparse
import importlib.util
import io
import json
import resource
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from random import Random
from types import ModuleType
from typing import Any, NamedTuple

from pushplan.bench.processes.machine import Machine
from pushplan.bench.suites.file import suite_from_text, suite_text
from pushplan.cli.main import main as pushplan
from pushplan.errors import PushplanError, ScenarioError
from pushplan.plan import plan
from pushplan.scenario.check import check_scenario
from pushplan.scenario.file import example_names, example_text, load_scenario, scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.scenario.source import Source
from pushplan.scenario.template import new_scenario_text

MOST_SECONDS, MOST_MB = 5.0, 500.0
PLANNING = 0.2
"""Time limit of each plan, s; it is taken off what a file may take."""

THROUGH_CLI = 200
"""Files that go through the command line as well, for exit code and streams."""


SUITE = """\
format: pushplan-suite/1
name: small
problems:
  - one-box
  - {scenario: two-crates, name: crates}
  - name: random
    generate: {objects: [1, 2], obstacles: [0, 5], density: 5 %, gap: 2.0, drives: [car], turning_radius: 0.5}
    count: 2
    seed: 3
planners:
  - auto
  - {name: rrt, label: quick, time: 500 ms, iterations: 1000, first: true}
sets: [ecof, cof]
seeds: [3, 7]
limits: {time: 1.5 s, run: 10 s, memory: 500 MB}
"""

INTERVALS = """\
format: pushplan/1
floor: {friction: [0.2, 0.4]}
objects:
  - {name: near, shape: {box: [0.1, 0.08]}, mass: ["700 g", 1.9]}
  - name: far
    shape: {box: [0.1, 0.08]}
    mass: 0.8
    floor_friction: 0.3
    support: {feet: [[-0.04, -0.03, [0.1, 0.4]], [0.04, -0.03, [0, 40 %]],
                     [0.04, 0.03, 0.25], [-0.04, 0.03, [10 %, 0.4]]]}
contacts: {friction: [14 deg, 0.5], between: [{objects: [near, far], friction: [0.3, 0.4]}]}
pusher: {width: 0.2, friction: [0.5, 0.6]}
goal: {pose: [0.8, 0.3, 40 deg]}
stability: {set: ecof}
"""

NOTHING = ("--filter", "seed=99999")
"""No run of a batch, so that a valid suite is read and nothing is planned."""


class File(NamedTuple):
    """A mutated file."""

    is_suite: bool
    text: str


class Verdict(NamedTuple):
    """What became of a file."""

    word: str
    text: str
    seconds: float


def main() -> int:
    """Read, check and plan; return the exit code."""
    options = _options()
    random = Random(options.seed)
    _warm_up()
    verdicts: list[Verdict] = []
    plans = 0
    for file in _files(random, options.files):
        verdict = _judge(file, plans < options.plans)
        plans += verdict.word in ("planned", "no plan")
        verdicts.append(verdict)
    wrong = [v for v in verdicts if v.word == "WRONG"] + _through_the_command_line(random)
    return _report(verdicts, wrong)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--files", type=int, default=10_000)
    parser.add_argument("--plans", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    return parser.parse_args()


def _files(random: Random, count: int) -> Iterator[File]:
    """Yield mutated texts and documents in turn, every fifth a suite."""
    mutators = _mutators()
    scenarios = [*map(example_text, example_names()), new_scenario_text("new")]
    suites = [suite_text("smoke"), suite_text("paper"), SUITE]
    resolved = [load_scenario(name).resolved() for name in example_names()]
    widened = [_widened(document, random) for document in resolved]
    scenarios += [INTERVALS] * 3 + [json.dumps(document, indent=1) for document in widened]
    documents = {
        False: [_document(text) for text in scenarios] + resolved,
        True: [_document(text) for text in suites],
    }
    for i in range(count):
        is_suite = i % 5 == 0
        if i % 2:
            text = mutators.mutated_text(random.choice(suites if is_suite else scenarios), random)
        else:
            text = json.dumps(mutators.mutated_document(random.choice(documents[is_suite]), random))
        yield File(is_suite, text)


def _widened(document: Any, random: Random) -> Any:
    """Return a document with half of its masses, frictions and loads of feet as intervals."""
    document = json.loads(json.dumps(document))
    holders = [document["floor"], document["pusher"], document["contacts"], *document["objects"]]
    holders += document["contacts"].get("between", [])
    found = [(h, key) for h in holders for key in ("friction", "floor_friction", "mass") if h.get(key)]
    for obj in document["objects"]:
        if isinstance(obj.get("support"), dict):
            found += [(foot, 2) for foot in obj["support"].get("feet", []) if len(foot) == 3]
    for holder, key in found:
        if random.random() < 0.5:
            holder[key] = [round(0.9 * holder[key], 6), round(1.1 * holder[key], 6)]
    return document


def _document(text: str) -> Any:
    return Source(text.encode()).root.plain()


def _judge(file: File, may_plan: bool) -> Verdict:
    begin = time.process_time()
    planning = 0.0
    try:
        word, scenario = _read(file)
        if scenario is not None and may_plan:
            planning = PLANNING
            word = _planned(scenario)
        what = ""
    except ScenarioError as error:
        word, what = "refused", ""
        if not all(finding.line and finding.what for finding in error.findings):
            word, what = "WRONG", f"a message without a place: {error}"
    except Exception as error:
        word, what = "WRONG", f"{type(error).__name__}: {error}"
    seconds = time.process_time() - begin
    if seconds - planning > MOST_SECONDS:
        word, what = "WRONG", f"takes {seconds:.1f} s"
    return Verdict(word, f"{what}\n{file.text[:3000]}" if what else "", seconds)


def _read(file: File) -> tuple[str, Scenario | None]:
    """Return what the file is, and the scenario if it can be planned."""
    if file.is_suite:
        suite_from_text(file.text, "f.yaml")
        return "valid suite", None
    scenario = scenario_from_text(file.text, "f.yaml")
    findings = check_scenario(scenario)
    if not findings:
        return "valid", scenario
    if not all(finding.line and finding.what for finding in findings):
        raise AssertionError(f"a finding without a place: {findings}")
    return "not pushable", None


def _planned(scenario: Scenario) -> str:
    try:
        return "planned" if plan(scenario, time_limit=PLANNING).solved else "no plan"
    except PushplanError:
        return "no plan"


def _through_the_command_line(random: Random) -> list[Verdict]:
    """Return what goes wrong when files are given to `pushplan check` or `pushplan bench`."""
    wrong = []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "f.yaml"
        for is_suite, text in _files(random, THROUGH_CLI):
            file.write_text(text, encoding="utf-8", errors="surrogatepass")
            words = (
                ["bench", str(file), "-o", f"{folder}/out", *NOTHING] if is_suite else ["check", str(file)]
            )
            with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
                code = pushplan([*words, "--json"])
            if code not in (0, 2):
                wrong.append(Verdict("WRONG", f"exit code {code}\n{text[:3000]}", 0.0))
    return wrong


def _report(verdicts: list[Verdict], wrong: list[Verdict]) -> int:
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    slowest = max(verdict.seconds for verdict in verdicts)
    for verdict in wrong[:10]:
        sys.stderr.write(f"--- {verdict.text}\n")
    counts = ", ".join(f"{number} {word}" for word, number in Counter(v.word for v in verdicts).most_common())
    sys.stderr.write(
        f"{len(verdicts)} files: {counts}; {len(wrong)} wrong\n"
        f"slowest {slowest:.2f} s, memory at its peak {peak:.0f} MB\n"
        f"{Machine.this().words}\n"
    )
    return int(bool(wrong) or peak > MOST_MB)


def _warm_up() -> None:
    """Load and compile, so that the first file is not charged for it."""
    scenario = load_scenario("free-space")
    check_scenario(scenario)
    plan(scenario, time_limit=PLANNING)


def _mutators() -> ModuleType:
    path = Path(__file__).parents[1] / "tests" / "mutators.py"
    spec = importlib.util.spec_from_file_location("mutators", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


if __name__ == "__main__":
    sys.exit(main())
