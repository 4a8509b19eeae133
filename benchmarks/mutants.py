"""Mutation testing of the core: do the tests notice when a formula in C++ is changed?

Run `python benchmarks/mutants.py [--files friction.cpp,contacts.cpp] [--count 40] [--seed 1] [--jobs 2]`.
In a copy of the checkout one operator, comparison or number is changed at a time, the core is built again as far as
it depends on the file, and the tests run until one fails. Prints a line for each change, and how many were noticed.
Needs the development environment, nanobind and g++.
"""

from __future__ import annotations

import argparse
import os
import random
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))
from building import FLAGS, INCLUDE  # noqa: E402

FILES = "friction.cpp,contacts.cpp,inertia.hpp,sphere.cpp,uncertain.cpp,centred.cpp,scene.cpp,steering.cpp"
TESTS = (
    "tests/test_contacts.py tests/test_friction.py tests/test_support.py tests/test_dynamics.py tests/sets "
    "tests/test_collision.py tests/test_searches.py tests/golden"
)
CHANGES = (
    (r" \+ ", (" - ",)),
    (r" - ", (" + ",)),
    (r" \* ", (" / ",)),
    (r" / ", (" * ",)),
    (r" < ", (" <= ", " > ")),
    (r" > ", (" >= ", " < ")),
    (r" <= ", (" < ", " > ")),
    (r" >= ", (" > ", " < ")),
    (r" && ", (" || ",)),
    (r" \|\| ", (" && ",)),
    (r"\b0\.5\b", ("0.6",)),
    (r"\b1\.0\b", ("1.1",)),
    (r"\b2\.0\b", ("2.1",)),
    (r"std::min\(", ("std::max(",)),
    (r"std::max\(", ("std::min(",)),
)
"""What is looked for in a line, and what takes its place."""


class Checkout:
    """A copy of the checkout whose core is built file by file."""

    def __init__(self, folder: Path, jobs: int) -> None:
        self.folder, self.jobs = folder, jobs
        leave = shutil.ignore_patterns(".*", "__pycache__", "*.egg-info", "build", "dist", "*.so")
        shutil.copytree(ROOT, folder, symlinks=True, ignore=leave)
        # Beside the package, as if installed: a core of other sources than those that lie in it is refused.
        self.core, self.objects = folder / "core", folder / "objects"
        (folder / "pushplan" / "core").rename(self.core)
        self.objects.mkdir()
        project = tomllib.loads((folder / "pyproject.toml").read_text("utf-8"))
        (extension,) = project["tool"]["setuptools"]["ext-modules"]
        self.sources = [self.core / Path(name).name for name in extension["sources"]]
        include = [f"-I{folder}" for folder in (*INCLUDE, sysconfig.get_path("include"))]
        self._compile = ["g++", *FLAGS, "-fPIC", "-MMD", *include, "-c"]

    def build(self, sources: list[Path]) -> bool:
        """Compile some sources and link; return whether that went well."""

        def compiled(source: Path) -> int:
            target = self.objects / f"{source.stem}.o"
            return subprocess.run(
                [*self._compile, str(source), "-o", str(target)], stderr=subprocess.DEVNULL
            ).returncode

        with ThreadPoolExecutor(self.jobs) as pool:
            if any(pool.map(compiled, sources)):
                return False
        library = self.folder / "pushplan" / f"core{sysconfig.get_config_var('EXT_SUFFIX')}"
        parts = [str(self.objects / f"{source.stem}.o") for source in self.sources]
        return subprocess.run(["g++", "-shared", "-o", str(library), *parts]).returncode == 0

    def depending_on(self, name: str) -> list[Path]:
        """Return the sources that include a file, or are it."""
        word = re.compile(rf"/{re.escape(name)}\b")
        return [
            source for source in self.sources if word.search((self.objects / f"{source.stem}.d").read_text("utf-8"))
        ]

    def notices(self, tests: list[str]) -> bool:
        """Return whether a test fails."""
        environment = {**os.environ, "PYTHONPATH": str(self.folder)}
        command = [sys.executable, "-m", "pytest", "-q", "-x", "-n", "0", "-p", "no:cacheprovider", *tests]
        try:
            done = subprocess.run(command, cwd=self.folder, env=environment, capture_output=True, timeout=600.0)
        except subprocess.TimeoutExpired:
            return True
        return done.returncode != 0


def mutants(text: str) -> list[tuple[int, str, str]]:
    """Return line number, line and changed line of every change of a source; comments stay as they are."""
    found: list[tuple[int, str, str]] = []
    for number, line in enumerate(text.splitlines()):
        code = line.partition("//")[0]
        if "#include" in code or "template" in code or '"' in code:
            continue
        for pattern, others in CHANGES:
            for match in re.finditer(pattern, code):
                begin, end = line[: match.start()], line[match.end() :]
                found += [(number, line, begin + other + end) for other in others]
    return found


def main() -> int:
    """Try the changes and print which of them nobody noticed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--files", default=FILES, help="of the core, with commas")
    parser.add_argument("--count", type=int, default=40, help="changes that are tried, drawn by the seed")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2, help="compilers at a time")
    parser.add_argument("--tests", default=TESTS)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        copy = Checkout(Path(temporary) / "checkout", options.jobs)
        if not copy.build(copy.sources) or copy.notices(options.tests.split()):
            sys.stdout.write("the core does not build, or tests fail without any change\n")
            return 1
        every = [
            (name, *one)
            for name in options.files.split(",")
            for one in mutants((copy.core / name).read_text("utf-8"))
        ]
        chosen = random.Random(options.seed).sample(every, min(options.count, len(every)))
        noticed = 0
        for name, number, line, changed in chosen:
            path, before = copy.core / name, (copy.core / name).read_text("utf-8")
            lines = before.splitlines()
            lines[number] = changed
            path.write_text("\n".join(lines) + "\n", "utf-8")
            seen = not copy.build(copy.depending_on(name)) or copy.notices(options.tests.split())
            noticed += seen
            path.write_text(before, "utf-8")
            copy.build(copy.depending_on(name))
            word = "noticed" if seen else "SURVIVED"
            sys.stdout.write(f"{word} {name}:{number + 1}\n  {line.strip()}\n  {changed.strip()}\n")
            sys.stdout.flush()
        sys.stdout.write(f"{noticed} of {len(chosen)} noticed, of {len(every)} possible changes\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
