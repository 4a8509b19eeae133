"""Mutation testing: do the tests that fit notice when a formula is changed, in Python or in the core?

Run `python benchmarks/mutants.py [--only mechanics,slip] [--count 200] [--seed 1] [--limit 30]`.
In a copy of the checkout one sign, operator, comparison, transpose, constant, minimum or end of an interval is
changed at a time, the core is built again if it is the core's, and the tests that fit run until one fails.
Prints a line for each change, and how many were noticed. Needs the development environment and g++.
"""

from __future__ import annotations

import argparse
import ast
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
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]

FITTING = {
    "pushplan/geometry": "test_geometry.py test_collision.py scenarios/test_layout.py",
    "pushplan/mechanics/chain": "test_contacts.py test_laws.py scenarios/test_layout.py",
    "pushplan/mechanics/faces": "test_contacts.py several/test_search.py several/test_plan.py",
    "pushplan/mechanics/heights": "sets/test_heights.py",
    "pushplan/mechanics/dynamics": "test_dynamics.py timing/test_margins_with_inertia.py",
    "pushplan/mechanics/intervals": "scenarios/test_intervals.py sets/test_interval_sets.py",
    "pushplan/mechanics/perturb": "test_margins.py test_laws.py",
    "pushplan/mechanics/uncertain": "sets/test_interval_sets.py sets/test_robust.py test_dynamics.py",
    "pushplan/mechanics": "test_friction.py test_contacts.py test_support.py test_laws.py",
    "pushplan/sets/unknown": "sets/test_robust.py sets/test_half_spaces.py sets/test_nesting.py",
    "pushplan/sets/force": "test_force.py",
    "pushplan/sets": "sets/test_boundary.py sets/test_half_spaces.py sets/test_nesting.py",
    "pushplan/scenario/maps": "scenarios/test_map_obstacles.py",
    "pushplan/scenario": "scenarios",
    "pushplan/plans/trajectory": "timing test_laws.py",
    "pushplan/plans": "test_laws.py test_plan.py",
    "pushplan/slip": "slip test_margins.py",
    "pushplan/bench": "bench/test_report.py bench/test_suite.py bench/test_store.py",
    "planners/timing": "timing",
    "planners/multi/row": "several/test_gathering.py",
    "planners/multi/gathering": "several/test_gathering.py",
    "planners/multi": "several/test_rearrangement.py several/test_search.py",
    "planners/infeasible": "test_pocket.py test_diagnosis.py test_lower_bound.py",
    "planners/search": "test_searches.py test_ompl.py",
    "planners": "test_plan.py test_searches.py test_collision.py test_footprint.py",
    "sim/control": "control/test_parts.py control/test_stall.py",
    "sim/identify": "identify",
    "sim/kinematic": "test_plan.py",
    "sim/physics": "test_physics.py several/test_physics.py",
    "sim/follower": "test_follower.py",
    "sim": "test_margins.py slip",
    "logging/verify": "store/test_store.py store/test_forgeries.py",
    "logging": "store/test_store.py store/test_exports.py store/test_rewritten.py",
    "pushplan/core/slip": "test_laws.py slip",
    "pushplan/core/(timing|step_sum|motion_bounds)": "timing",
    "pushplan/core/(contacts|friction|inertia)": "test_friction.py test_contacts.py test_dynamics.py",
    "pushplan/core/(uncertain|centred|robustness)": "sets/test_interval_sets.py sets/test_robust.py test_margins.py",
    "pushplan/core/(boundary|brackets|sphere)": "sets/test_boundary.py sets/test_half_spaces.py",
    "pushplan/core/(driving|reeds|transit)": "several/test_driving.py",
    "pushplan/core/(pushes|samples|sequences)": "several/test_search.py",
    "pushplan/core/(pockets|infeasible)": "test_pocket.py test_diagnosis.py",
    "pushplan/core": "test_collision.py test_searches.py test_polish.py",
}
"""Beginnings of paths, as regular expressions, and the files below `tests` that fit; the longest match counts."""

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
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))

    def place(line: int, column: int) -> int:  # `ast` counts bytes
        text = source[starts[line - 1] : starts[line]].encode()
        return starts[line - 1] + len(text[:column].decode())

    def begin(node: ast.expr) -> int:
        return place(node.lineno, node.col_offset)

    def end(node: ast.expr) -> int:
        return place(node.end_lineno or 0, node.end_col_offset or 0)

    def between(left: ast.expr, operator: ast.AST, right: ast.expr) -> Iterator[Mutant]:
        sign, *others = OPERATORS.get(type(operator), ("",))
        at = source.find(f" {sign} ", end(left), begin(right)) + 1
        if sign and at:
            yield from (Mutant(path, at, at + len(sign), other) for other in others)

    def visit(node: ast.AST) -> Iterator[Mutant]:
        if isinstance(node, ast.Raise | ast.JoinedStr | ast.Import | ast.ImportFrom | ast.AnnAssign):
            children: list[ast.AST] = [node.value] if isinstance(node, ast.AnnAssign) and node.value else []
        elif isinstance(node, ast.FunctionDef):
            children = [*node.body]
        else:
            children = [*ast.iter_child_nodes(node)]
        for child in children:
            yield from visit(child)
        if isinstance(node, ast.BinOp):
            yield from between(node.left, node.op, node.right)
        elif isinstance(node, ast.Compare):
            for left, operator, right in zip(
                [node.left, *node.comparators], node.ops, node.comparators, strict=False
            ):
                yield from between(left, operator, right)
        elif isinstance(node, ast.BoolOp):
            for left, right in zip(node.values, node.values[1:], strict=False):
                yield from between(left, node.op, right)
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not | ast.Invert):
            yield Mutant(path, begin(node), begin(node.operand), "")
        elif isinstance(node, ast.Attribute) and node.attr == "T":
            yield Mutant(path, end(node.value), end(node), "")
        elif isinstance(node, ast.Attribute) and node.attr in NAMES:
            yield Mutant(path, end(node) - len(node.attr), end(node), NAMES[node.attr])
        elif (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Name)
            and node.func.id in ("min", "max", "any", "all")
        ):
            yield Mutant(path, begin(node.func), end(node.func), NAMES[node.func.id])
        elif isinstance(node, ast.Constant) and isinstance(node.value, float):
            yield Mutant(path, begin(node), end(node), repr(1.1 * node.value or 0.1))
        elif isinstance(node, ast.Constant) and type(node.value) is int and node.value in (0, 1):
            yield Mutant(path, begin(node), end(node), str(1 - node.value))

    yield from visit(ast.parse(source))


def core_mutants(path: str, source: str) -> Iterator[Mutant]:
    """Yield the changes of a C++ file; comments, texts and templates stay."""
    at, raw = 0, False
    for line in source.splitlines(keepends=True):
        code = line.partition("//")[0]
        if not (raw or "#include" in code or "template" in code or '"' in code):
            for pattern, others in IN_CORE:
                for match in re.finditer(pattern, code):
                    yield from (
                        Mutant(path, at + match.start(), at + match.end(), match.expand(other)) for other in others
                    )
        raw = 'R"(' in code or (raw and ')"' not in code)
        at += len(line)


def fitting(path: str) -> list[str]:
    """Return the tests of a file; none if they are unknown."""
    matches = [key for key in FITTING if re.match(key, path)]
    return [f"tests/{name}" for name in FITTING[max(matches, key=len)].split()] if matches else []


class Checkout:
    """A copy of the checkout in which mutants are tested."""

    def __init__(self, folder: Path, limit: int) -> None:
        self.folder, self.limit = folder, limit
        leave = shutil.ignore_patterns(".*", "__pycache__", "*.egg-info")
        shutil.copytree(ROOT, folder, symlinks=True, ignore=leave)
        self._environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}

    def run(self, *words: str) -> tuple[str, str]:
        """Run Python in the copy; return the outcome of a mutant, and the last line of output."""
        command = [sys.executable, "-W", "ignore", *words]
        done = subprocess.run(
            command, cwd=self.folder, env=self._environment, capture_output=True, text=True, preexec_fn=self._limit
        )
        said = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
        return {0: SURVIVED, -signal.SIGXCPU: STOPPED}.get(done.returncode, NOTICED), "".join(said[-1:])

    def _limit(self) -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (self.limit, self.limit + 5))

    def end_of(self, path: str) -> tuple[str, str]:
        """Return the outcome of the tests of a file, after a build if it is the core's, and the failed test."""
        if "/core/" in path and self.run("building.py")[0] != SURVIVED:
            return NONE, ""
        return self.run("-m", "pytest", "-q", "-x", "-n", "0", "-p", "no:cacheprovider", *fitting(path))

    def end_with(self, mutant: Mutant) -> tuple[str, str]:
        """Return the outcome with a mutant, and restore the file."""
        file = self.folder / mutant.path
        before = file.read_text(encoding="utf-8")
        file.write_text(before[: mutant.begin] + mutant.text + before[mutant.end :], encoding="utf-8")
        try:
            return self.end_of(mutant.path)
        finally:
            file.write_text(before, encoding="utf-8")
            if "/core/" in mutant.path:
                self.run("building.py")


def every_mutant(only: list[str]) -> list[Mutant]:
    """Return all changes of the files with known tests, or of some rooms."""
    found: list[Mutant] = []
    for pattern in ("pushplan/**/*.py", "planners/**/*.py", "sim/**/*.py", "logging/**/*.py", "pushplan/core/*.?pp"):
        for file in sorted(ROOT.glob(pattern)):
            path = str(file.relative_to(ROOT))
            linked = re.match("pushplan/(planners|sim|logging)/", path)
            if not linked and fitting(path) and (not only or any(name in path for name in only)):
                yields = core_mutants if "/core/" in path else python_mutants
                found += yields(path, file.read_text(encoding="utf-8"))
    return found


def main() -> int:
    """Test the changes and print the unnoticed ones."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--only", default="", help="parts of paths, with commas")
    parser.add_argument("--count", type=int, default=200, help="changes that are tried, drawn by the seed")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--limit", type=int, default=30, help="s of CPU for the tests of a mutant")
    options = parser.parse_args()
    every = every_mutant([name for name in options.only.split(",") if name])
    chosen = random.Random(options.seed).sample(every, min(options.count, len(every)))
    ends: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as temporary:
        copy = Checkout(Path(temporary) / "checkout", options.limit)
        for mutant in chosen:
            begun, (end, test) = time.monotonic(), copy.end_with(mutant)
            ends[end] += 1
            source = (copy.folder / mutant.path).read_text(encoding="utf-8")
            line = source.count("\n", 0, mutant.begin)
            sys.stdout.write(
                f"{end} {mutant.path}:{line + 1} [{source[mutant.begin : mutant.end]}] -> [{mutant.text}] "
                f"{time.monotonic() - begun:.0f} s {test}\n    {source.splitlines()[line].strip()}\n"
            )
            sys.stdout.flush()
    tried = sum(ends.values()) - ends[NONE]
    sys.stdout.write(f"{ends[NOTICED]} of {tried} noticed, of {len(every)} possible changes\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
