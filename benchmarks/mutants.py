"""Mutation testing of the mechanics: do the tests notice when a formula is changed?

Run `python benchmarks/mutants.py [--modules chain,contacts/friction] [--jobs 1] [--keep FOLDER]`.
mutmut changes one operator,
number, name or argument at a time in a copy of the checkout and runs the tests that reach it, fastest first. mutmut
leaves decorated functions alone, so in the copy numba's decorators are taken out, its kernels run as plain Python,
and properties are made of plain functions. Texts and types of numbers stay as they are. Prints a line for each module
and the difference for each survivor.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[1]
MODULES = (
    "chain",
    "contacts/carried",
    "contacts/contact_kernel",
    "contacts/contact_state",
    "contacts/friction",
    "dynamics/admissible_speeds",
    "dynamics/contact_dynamics",
    "friction/closed_form",
    "friction/kernel",
    "friction/packed",
    "friction/series",
    "inertia",
    "sphere",
    "support",
    "support_csv",
    "uncertain",
    "uncertain_kernel",
)
"""Modules of `pushplan.mechanics` that the quasi-static and dynamic conditions rest on."""

TESTS = (
    "tests/test_support.py",
    "tests/test_contacts.py",
    "tests/test_feet.py",
    "tests/test_friction.py",
    "tests/test_friction_series.py",
    "tests/test_dynamics.py",
    "tests/test_carried.py",
    "tests/test_chain.py",
    "tests/test_load_area.py",
    "tests/test_sphere.py",
    "tests/test_transmitted.py",
)
"""Tests of these modules that are quick without compiled code."""

CONFIGURATION = """
[tool.mutmut]
source_paths = ["pushplan"]
only_mutate = [{modules}]
also_copy = ["planners", "sim", "logging", "tests", "benchmarks", "examples", "README.md"]
pytest_add_cli_args = ["--import-mode=importlib", "-p", "no:cacheprovider", "-p", "no:randomly"]
pytest_add_cli_args_test_selection = [{tests}]
timeout_multiplier = 2.0
timeout_constant = 5.0
do_not_mutate_patterns = ['raise \\w+', 'f?"[^"]*"', 'dtype=np.\\w+', 'strict=True']
"""
DECORATORS = re.compile(r"^@(njit\(.*\)|compiled|no_refcount|inlined)\n", re.MULTILINE)
PROPERTIES = re.compile(
    r"^    @(property|cached_property)\n(    def (\w+)\(.*\n(?:\n?(?: {5,}.*)\n)*)", re.MULTILINE
)
LEFT_ALONE = re.compile(r'(?<=[(,]) ?(f?"(?!"")[^"\n]+"|dtype=np\.\w+|strict=True)')
"""Words in brackets that mutmut is told to leave alone; it leaves the whole line, so each gets a line of its own."""


def main() -> int:
    """Make the copy, run mutmut on it and print what survived."""
    options = _options()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(options.keep or temporary) / "checkout"
        if not folder.exists():
            _copy(folder, options.modules.split(","))
        environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
        command = [sys.executable, "-m", "mutmut", "run", "--max-children", str(options.jobs)]
        code = subprocess.run(command, cwd=folder, env=environment).returncode
        _report(folder)
    return code


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--modules", default=",".join(MODULES), help="of pushplan.mechanics, with commas")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument(
        "--keep", metavar="FOLDER", help="work there; a second run goes on where the first ended"
    )
    return parser.parse_args()


def _copy(folder: Path, modules: list[str]) -> None:
    """Copy the checkout, in the modules without decorators and with a line for each word left alone."""
    leave = shutil.ignore_patterns(".*", "__pycache__", "*.egg-info", "build", "dist", "docs")
    shutil.copytree(ROOT, folder, symlinks=True, ignore=leave)
    paths = [f"pushplan/mechanics/{module}.py" for module in modules]
    for path in paths:
        source = folder / path
        text = DECORATORS.sub("", source.read_text("utf-8"))
        text = PROPERTIES.sub(r"\2\n    \3 = \1(\3)\n", text)
        source.write_text(LEFT_ALONE.sub(r"\n\1\n", text), "utf-8")
    quoted = [", ".join(f'"{word}"' for word in words) for words in (paths, TESTS)]
    with (folder / "pyproject.toml").open("a", encoding="utf-8") as project:
        project.write(CONFIGURATION.format(modules=quoted[0], tests=quoted[1]))


def _report(folder: Path) -> None:
    """Print the counts by module, and what each survivor changes."""
    results = _mutmut(folder, "results", "--all", "true").splitlines()
    verdicts = dict(line.strip().split(": ") for line in results if ": " in line)
    counts = Counter((".".join(name.split(".")[2:-1]), verdict) for name, verdict in verdicts.items())
    for module in sorted({module for module, _ in counts}):
        row = {verdict: number for (name, verdict), number in sorted(counts.items()) if name == module}
        sys.stdout.write(f"{module}: {sum(row.values())} mutants, {row}\n")
    sys.stdout.write(f"all: {len(verdicts)} mutants, {dict(Counter(verdicts.values()))}\n")
    for name, verdict in sorted(verdicts.items()):
        if verdict not in ("killed", "timeout", "caught by type check"):
            sys.stdout.write(f"\n{verdict}: {_mutmut(folder, 'show', name)}")


def _mutmut(folder: Path, *words: str) -> str:
    command = [sys.executable, "-m", "mutmut", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout


if __name__ == "__main__":
    sys.exit(main())
