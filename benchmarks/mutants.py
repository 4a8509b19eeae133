"""Mutation testing: do the tests that fit notice when a formula is changed, in Python or in the core?

Run `python benchmarks/mutants.py [--only mechanics,slip] [--count 200] [--seed 1] [--map build/mutants]`.
In a copy of the checkout one sign, operator, comparison, transpose, constant, minimum or end of an interval is
changed at a time. A change of Python is tried by the tests that run its line, one of the core by the test files
that fit (`FITTING`), after a build; the quickest tests come first, for `--limit` s in all. Which tests run which line
is measured once, by coverage, and kept in the folder `--map`. Each mutant is tried in a process forked from one that
has imported the libraries. Prints a line for each change, and how many were noticed. Needs the development
environment, coverage and g++.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import importlib
import json
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from itertools import accumulate, pairwise
from pathlib import Path
from typing import NamedTuple

import coverage
import pytest

ROOT = Path(__file__).parents[1]

SOURCES = "pushplan/**/*.py", "planners/**/*.py", "sim/**/*.py", "logging/**/*.py", "pushplan/core/*.?pp"
LEFT_OUT = re.compile("pushplan/(planners|sim|logging|cli|drawing|view)/|logging/(page|film|shown|rviz)")
"""Links, and what is there to be looked at."""

NOT_MAPPED = (
    "test_cli test_cli_plan test_screens test_view test_view_server test_interruption test_core_calls test_package "
    "test_docs test_docs_seen test_outputs test_extensions test_silly_inputs bench/test_batch bench/test_cluster "
    "bench/test_suite "
    "store/test_hostile recipes"
)
"""Tests of processes, browsers and documents: too long for one mutant, or coverage does not see what they run."""

FITTING = {
    "slip": "slip test_laws test_margins",
    "timing|step_sum|motion_bounds": "timing test_laws",
    "contacts|friction|inertia": "test_friction test_contacts test_dynamics sets",
    "uncertain|centred": "sets test_margins test_laws test_force",
    "robustness": "test_margins test_laws",
    "boundary|border|brackets|sphere": "sets test_friction",
    "driving|reeds|transit|shortening": "several/test_driving several/test_search several/test_gathering",
    "pushes|samples|sequences": "several/test_search several/test_rearrangement several/test_gathering",
    "pockets|infeasible": "test_pocket test_diagnosis",
    "": "test_collision test_searches test_polish test_plan test_ompl test_lower_bound test_footprint",
}
"""Beginnings of names in the core, and what fits below `tests`; the first match counts."""

LIBRARIES = "numpy scipy.optimize scipy.stats scipy.spatial shapely yaml pydantic hypothesis ompl.base mcap"

OPERATORS = {
    ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "/"), ast.Div: ("/", "*"),
    ast.Lt: ("<", "<=", ">"), ast.Gt: (">", ">=", "<"), ast.LtE: ("<=", "<", ">="), ast.GtE: (">=", ">", "<="),
    ast.Eq: ("==", "!="), ast.NotEq: ("!=", "=="), ast.And: ("and", "or"), ast.Or: ("or", "and"),
}  # fmt: skip
"""What stands for an operator, and what takes its place."""

NAMES = {
    "min": "max", "minimum": "maximum", "low": "high", "lower": "upper", "any": "all", "sin": "cos", "xmin": "xmax",
    "ymin": "ymax", "left": "right", "fmin": "fmax", "argmin": "argmax", "start": "goal", "floor": "ceil",
}  # fmt: skip
NAMES |= {other: one for one, other in NAMES.items()}
"""Functions and attributes that are taken for one another."""

IN_CORE = (
    (r" \+ ", (" - ",)), (r" - ", (" + ",)), (r" \* ", (" / ",)), (r" / ", (" * ",)),
    (r" < ", (" <= ", " > ")), (r" > ", (" >= ", " < ")), (r" <= ", (" < ", " >= ")), (r" >= ", (" > ", " <= ")),
    (r" && ", (" || ",)), (r" \|\| ", (" && ",)), (r"([(=?:,] )-(?=\w)", (r"\1",)),
    (r"\b0\.5\b", ("0.6",)), (r"\b1\.0\b", ("1.1",)), (r"\b2\.0\b", ("2.1",)),
    (r"std::min\(", ("std::max(",)), (r"std::max\(", ("std::min(",)),
    (r"\.low\b", (".high",)), (r"\.high\b", (".low",)), (r"\.x\b", (".y",)), (r"\.y\b", (".x",)),
)  # fmt: skip
"""What is looked for in a line of C++, and what takes its place."""


NOTICED, SURVIVED, STOPPED, NONE = "noticed", "SURVIVED", "STOPPED", "no mutant: it does not compile"
"""How a mutant ends; one that was stopped in time passed all tests until then."""


class Mutant(NamedTuple):
    """A change of a file: the replacement of the text from `begin` to `end`."""

    path: str
    begin: int
    end: int
    text: str


def python_mutants(path: str, source: str) -> Iterator[Mutant]:
    """Yield the changes of a Python file; texts and raised errors stay."""
    lines = source.splitlines(keepends=True)
    starts = [0, *accumulate(map(len, lines))]

    def place(line: int, column: int) -> int:  # `ast` counts bytes
        return starts[line - 1] + len(lines[line - 1].encode()[:column].decode())

    def span(node: ast.expr) -> tuple[int, int]:
        return place(node.lineno, node.col_offset), place(node.end_lineno or 0, node.end_col_offset or 0)

    def visit(node: ast.AST) -> Iterator[Mutant]:
        match node:
            case ast.Raise() | ast.JoinedStr() | ast.Import() | ast.ImportFrom():
                children: list[ast.AST] = []
            case ast.AnnAssign():
                children = [node.value] if node.value else []
            case ast.FunctionDef():
                children = [*node.body]
            case _:
                children = [*ast.iter_child_nodes(node)]
        for child in children:
            yield from visit(child)
        yield from (Mutant(path, *change) for change in _changes(node, source, span))

    yield from visit(ast.parse(source))


def _changes(
    node: ast.AST, source: str, span: Callable[[ast.expr], tuple[int, int]]
) -> Iterator[tuple[int, int, str]]:
    """Yield begin, end and replacement of the changes of one node."""
    operators: list[tuple[ast.expr, ast.AST, ast.expr]] = []
    match node:
        case ast.BinOp():
            operators = [(node.left, node.op, node.right)]
        case ast.Compare():
            operators = [*zip([node.left, *node.comparators], node.ops, node.comparators, strict=False)]
        case ast.BoolOp():
            operators = [(left, node.op, right) for left, right in pairwise(node.values)]
        case ast.UnaryOp(op=ast.USub() | ast.Not() | ast.Invert()):
            yield span(node)[0], span(node.operand)[0], ""
        case ast.Attribute(attr="T"):
            yield span(node.value)[1], span(node)[1], ""
        case ast.Attribute() if node.attr in NAMES:
            yield span(node)[1] - len(node.attr), span(node)[1], NAMES[node.attr]
        case ast.Call(func=ast.Name(id="min" | "max" | "any" | "all" as name)):
            yield *span(node.func), NAMES[name]
        case ast.Constant(value=float(value)):
            yield *span(node), repr(1.1 * value or 0.1)
        case ast.Constant(value=0 | 1) if type(node.value) is int:
            yield *span(node), str(1 - node.value)
    for left, operator, right in operators:
        sign, *others = OPERATORS.get(type(operator), ("",))
        at = source.find(f" {sign} ", span(left)[1], span(right)[0]) + 1
        if sign and at:
            yield from ((at, at + len(sign), other) for other in others)


def core_mutants(path: str, source: str) -> Iterator[Mutant]:
    """Yield the changes of a C++ file; comments, texts and templates stay."""
    at, raw = 0, False
    for line in source.splitlines(keepends=True):
        code = line.partition("//")[0]
        for pattern, others in () if raw or re.search('#include|template|"', code) else IN_CORE:
            for match in re.finditer(pattern, code):
                begin, end = at + match.start(), at + match.end()
                yield from (Mutant(path, begin, end, match.expand(other)) for other in others)
        raw = 'R"(' in code or (raw and ')"' not in code)
        at += len(line)


class Tests:
    """Which tests fit a line, the quickest first.

    Attributes:
        seconds: What each test takes.
        lines: Tests that run a line, by path and line, as coverage saw them.
    """

    def __init__(self, folder: Path, checkout: Path) -> None:
        files = [file for pattern in SOURCES for file in sorted(checkout.glob(pattern))]
        digest = hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()
        known = folder / "seconds.json"
        if not known.exists() or json.loads(known.read_text())["digest"] != digest:
            folder.mkdir(parents=True, exist_ok=True)
            if in_fork(checkout, lambda: measure(folder.resolve(), checkout, digest)) > 1:
                raise SystemExit("the tests did not run to their end")
        stated = json.loads(known.read_text())
        self.seconds: dict[str, float] = stated["seconds"]
        self._data = coverage.CoverageData(str(folder / "lines"))
        self._data.read()
        self._paths = {str(Path(file).relative_to(stated["root"])): file for file in self._data.measured_files()}
        self._kept: dict[str, dict[int, list[str]]] = {}

    def of_line(self, path: str, line: int) -> list[str]:
        """Return the tests that run a line; those of the file where it is run when it is imported."""
        if path not in self._kept:
            found = self._data.contexts_by_lineno(self._paths.get(path, path))
            self._kept[path] = {k: names for k, tests in found.items() if (names := [test for test in tests if test])}
        lines = self._kept[path]
        at = next((k for k in range(line, line - 6, -1) if k in lines), None)  # statements may go on for some lines
        return self.quickest(lines[at] if at is not None else [test for tests in lines.values() for test in tests])

    def of_core(self, path: str) -> list[str]:
        """Return the tests that fit a file of the core."""
        names = next(names for key, names in FITTING.items() if re.match(key, Path(path).name)).split()
        return self.quickest(test for test in self.seconds if any(test.startswith(f"tests/{name}") for name in names))

    def quickest(self, tests: Iterable[str]) -> list[str]:
        """Return tests in the order of their times."""
        return sorted(set(tests), key=lambda test: self.seconds.get(test, 0.0))


def in_fork(folder: Path, work: Callable[[], int], cpu: int = 0, output: Path | None = None) -> int:
    """Return the exit code, or minus the signal, of some work in a folder in a process forked from this one."""
    child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if cpu:
        resource.setrlimit(resource.RLIMIT_CPU, (cpu, cpu + 5))
        signal.alarm(10 * cpu)
    if output is not None:
        file = os.open(output, os.O_CREAT | os.O_TRUNC | os.O_WRONLY)
        os.dup2(file, 1)
        os.dup2(file, 2)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.chdir(folder)
    sys.path.insert(0, str(folder))
    code = 3
    with suppress(BaseException):
        code = work()
    os._exit(code)


def measure(folder: Path, checkout: Path, digest: str) -> int:
    """Run the tests and write which lines each of them runs, and how long it takes."""
    seconds: dict[str, float] = {}
    package = [str(checkout.resolve() / name) for name in ("pushplan", "planners", "sim", "logging")]
    lines = coverage.Coverage(data_file=str(folder / "lines"), source=package, config_file=False)

    class Watch:
        @pytest.hookimpl(wrapper=True)
        def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
            lines.switch_context(item.nodeid)
            began = time.process_time()
            try:
                return (yield)
            finally:
                seconds[item.nodeid] = time.process_time() - began
                lines.switch_context("")

        @pytest.hookimpl(tryfirst=True)
        def pytest_sessionfinish(self) -> None:
            lines.stop()
            lines.save()
            (folder / "seconds.json").write_text(
                json.dumps({"digest": digest, "root": str(checkout.resolve()), "seconds": seconds})
            )

    left_out = (f"tests/{name}" for name in NOT_MAPPED.split())
    ignored = [f"--ignore={name}" if (checkout / name).is_dir() else f"--ignore={name}.py" for name in left_out]
    lines.erase()
    lines.start()
    return int(pytest.main(["-q", "-n", "0", "-p", "no:cacheprovider", "tests", *ignored], plugins=[Watch()]))


class Checkout:
    """A copy of the checkout in which mutants are tested."""

    def __init__(self, folder: Path, limit: float) -> None:
        self.folder, self.limit = folder, limit
        shutil.copytree(ROOT, folder, symlinks=True, ignore=shutil.ignore_patterns(".*", "*.egg-info"))
        self._output = folder.with_name("output")
        self._build()
        self._core = next((folder / "pushplan").glob("core.*.so"))
        shutil.copy2(self._core, folder.with_name("core"))

    def _build(self) -> bool:
        return subprocess.run([sys.executable, "building.py"], cwd=self.folder, capture_output=True).returncode == 0

    def end_with(self, mutant: Mutant, tests: Tests) -> tuple[str, str]:
        """Return how a mutant ends, and the test that failed."""
        file, core = self.folder / mutant.path, "/core/" in mutant.path
        before, times = file.read_text(encoding="utf-8"), file.stat()
        line = before.count("\n", 0, mutant.begin) + 1
        fitting = tests.of_core(mutant.path) if core else tests.of_line(mutant.path, line)
        spent = accumulate(tests.seconds.get(test, 0.0) for test in fitting)
        chosen = [test for k, (test, by) in enumerate(zip(fitting, spent, strict=True)) if k == 0 or by <= self.limit]
        if not chosen:
            return SURVIVED, "no test runs it"
        file.write_text(before[: mutant.begin] + mutant.text + before[mutant.end :], encoding="utf-8")
        try:
            if core and not self._build():
                return NONE, ""
            return self.end_of(chosen)
        finally:
            file.write_text(before, encoding="utf-8")
            os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns))  # what Python has compiled is still right
            if core:
                shutil.copy2(self.folder.with_name("core"), self._core)

    def end_of(self, tests: list[str]) -> tuple[str, str]:
        """Return how some tests end, which run in this order, and the one that failed."""
        order = {test: k for k, test in enumerate(tests)}

        class InOrder:
            @pytest.hookimpl(wrapper=True)
            def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> Iterator[None]:
                yield  # all others sort them before
                items.sort(key=lambda item: order.get(item.nodeid, 0))

        words = ["-q", "-x", "-n", "0", "-p", "no:cacheprovider", *tests]
        cpu = 30 + int(3.0 * self.limit)
        code = in_fork(self.folder, lambda: int(pytest.main(words, plugins=[InOrder()])), cpu, self._output)
        output = self._output.read_text(errors="replace")
        said = [line for line in output.splitlines() if line.startswith(("FAILED", "ERROR"))]
        if code in (pytest.ExitCode.USAGE_ERROR, pytest.ExitCode.NO_TESTS_COLLECTED) and not said:
            raise SystemExit(output)
        stopped = code in (-signal.SIGXCPU, -signal.SIGALRM)
        end = STOPPED if stopped else NOTICED if code else SURVIVED
        return end, said[-1][:150] if said else f"{len(tests)} tests"


def every_mutant(only: list[str]) -> list[Mutant]:
    """Return all changes of the sources, or of some rooms."""
    found: list[Mutant] = []
    for file in sorted(file for pattern in SOURCES for file in ROOT.glob(pattern)):
        path = str(file.relative_to(ROOT))
        if not LEFT_OUT.match(path) and (not only or any(name in path for name in only)):
            yields = core_mutants if "/core/" in path else python_mutants
            found += yields(path, file.read_text(encoding="utf-8"))
    return found


def main() -> int:
    """Test the changes and print the unnoticed ones."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--only", default="", help="parts of paths, with commas")
    parser.add_argument("--count", type=int, default=200, help="changes that are tried, drawn by the seed")
    parser.add_argument("--begin", type=int, default=0, help="number of the first of them")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--limit", type=float, default=30.0, help="s of CPU for the tests of a mutant")
    parser.add_argument("--map", type=Path, default=ROOT / "build" / "mutants", help="folder of what tests run")
    options = parser.parse_args()
    os.environ |= {"OPENBLAS_NUM_THREADS": "1", "PUSHPLAN_RUNS": tempfile.gettempdir()}
    for name in LIBRARIES.split():
        importlib.import_module(name)
    every = every_mutant([name for name in options.only.split(",") if name])
    chosen = random.Random(options.seed).sample(every, min(options.begin + options.count, len(every)))
    ends: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as temporary:
        copy = Checkout(Path(temporary) / "checkout", options.limit)
        tests = Tests(options.map, copy.folder)
        for number, mutant in enumerate(chosen[options.begin :], options.begin):
            begun, (end, test) = time.monotonic(), copy.end_with(mutant, tests)
            ends[end] += 1
            source = (copy.folder / mutant.path).read_text(encoding="utf-8")
            line = source.count("\n", 0, mutant.begin)
            sys.stdout.write(
                f"{number} {end} {mutant.path}:{line + 1} [{source[mutant.begin : mutant.end]}] -> [{mutant.text}] "
                f"{time.monotonic() - begun:.0f} s {test}\n    {source.splitlines()[line].strip()}\n"
            )
            sys.stdout.flush()
    tried = sum(ends.values()) - ends[NONE]
    sys.stdout.write(
        f"{ends[NOTICED]} of {tried} noticed, {ends[STOPPED]} stopped, of {len(every)} possible changes\n"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
