"""How the compiled core is built. setuptools imports this, by its path in `pyproject.toml`.

Run `python building.py` after a change of the core: it compiles every source by itself, keeps what it has compiled in
`build/core`, and so compiles only what has changed. `pip install -e .` keeps what it has compiled in `build/joined`.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import re
import runpy
import shutil
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import ModuleType

import nanobind
from nanobind.stubgen import StubGen
from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

FLAGS = ["-std=c++17", "-O3", "-g0", "-fvisibility=hidden", "-ffp-contract=off", "-fno-math-errno"]
"""No -march and no contraction to multiply-add: equal seeds give equal plans on every machine."""

CORE = Path(__file__).parent / "pushplan" / "core"
DIGEST_OF = runpy.run_path(str(CORE.parent / "util" / "checkout.py"))["digest_of"]

LIBRARY = Path(nanobind.source_dir())
INCLUDE = [str(CORE), nanobind.include_dir(), str(LIBRARY), str(LIBRARY.parent / "ext" / "robin_map" / "include")]
"""Besides the core: nanobind's headers, and what its own functions, which come as source, are compiled from."""

NANOBIND = '#pragma GCC optimize("Os", "no-strict-aliasing")\n#include <nb_combined.cpp>\n'
"""It reads Python's objects as other types than they were written as, which optimizers take for impossible."""


def units(each: bool) -> list[str]:
    """Return the texts that are compiled: every source by itself, or a few that include all of them.

    Joined, headers are read and nanobind's templates compiled once for many sources: 45 s of CPU instead of 89 s.
    """
    sources = sorted(CORE.glob("*.cpp"), key=lambda path: (path.stat().st_size, path.name))
    binding = [path for path in sources if "nb::module_" in path.read_text(encoding="utf-8")]
    other = [path for path in sources if path not in binding]
    groups = [[path] for path in sources] if each else [binding[::2], binding[1::2], other]
    digest = f'extern const char *const SOURCES;\nconst char *const SOURCES = "{DIGEST_OF(CORE)}";\n'
    joined = ["".join(f'#include "{path.name}"\n' for path in group) for group in groups]
    return [*joined, NANOBIND, f"namespace pushplan {{\n{digest}}}\n"]


def expanded(text: str) -> str:
    """Return a text and all files of the core that it includes."""
    names = re.findall(r'^#include "(.+)"', text, re.MULTILINE)
    return text + "".join(expanded((CORE / name).read_text(encoding="utf-8")) for name in names)


def write_stubs(library: Path, folder: Path) -> None:
    """Write a stub for each module of a compiled core, with its docstrings."""
    sys.modules["pushplan"] = ModuleType("pushplan")  # what the package itself imports is not installed yet
    spec = importlib.util.spec_from_file_location("pushplan.core", library)
    assert spec is not None
    assert spec.loader is not None
    core = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(core)
    folder.mkdir(parents=True, exist_ok=True)
    for stub in folder.glob("*.pyi"):
        stub.unlink()
    generator = StubGen(core, recursive=True, output_file=folder / "__init__.pyi")
    generator.put(core)
    (folder / "__init__.pyi").write_text(generator.get(), encoding="utf-8")


class BuildCore(build_ext):
    """Builds the core on all processors, with the digest of its sources compiled in, and its stubs."""

    def run(self) -> None:
        """Build, and describe what was built."""
        super().run()
        path = Path(self.get_ext_fullpath("pushplan.core"))
        if "-fsanitize" not in os.environ.get("PUSHPLAN_CORE_FLAGS", ""):  # Python cannot load such a core as it is
            write_stubs(path, path.parent / "core")

    def build_extensions(self) -> None:
        """Build, or take a core that was built of the same sources; without a compiler, say what is missing."""
        if built := os.environ.get("PUSHPLAN_CORE"):
            path = Path(self.get_ext_fullpath("pushplan.core"))
            path.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(built, path)
        else:
            try:
                super().build_extensions()
            except Exception as error:
                raise SystemExit(
                    f"pushplan's core could not be compiled: {error}\n"
                    "A C++17 compiler and Python's headers are needed: on Debian and Ubuntu `apt install g++ "
                    "python3-dev`; an installation from a wheel needs none."
                ) from error

    def build_extension(self, ext: Extension) -> None:
        """Compile what is not compiled yet, and link."""
        more = os.environ.get("PUSHPLAN_CORE_FLAGS", "").split()  # those of sanitizers, see .ci/sanitize
        kept = os.environ.get("PUSHPLAN_CORE_OBJECTS")
        folder = Path(kept or ("build/joined" if self.editable_mode else self.build_temp))
        folder.mkdir(parents=True, exist_ok=True)

        def compiled(unit: str) -> str:
            of = (expanded(unit), FLAGS, more, nanobind.__version__, sys.version)
            source = folder / f"{hashlib.sha256(repr(of).encode()).hexdigest()[:16]}.cpp"
            (target,) = self.compiler.object_filenames([str(source)], output_dir=str(folder))
            if not Path(target).exists():
                source.write_text(unit, encoding="utf-8")
                Path(target).parent.mkdir(parents=True, exist_ok=True)
                self.compiler.compile(
                    [str(source)], output_dir=str(folder), include_dirs=INCLUDE, extra_postargs=[*FLAGS, *more]
                )
            return str(target)

        pool = ThreadPoolExecutor(os.cpu_count())
        try:
            ext.extra_objects = list(pool.map(compiled, units(each=bool(kept))))
        finally:
            pool.shutdown(cancel_futures=True)  # what is wrong is said at once
        ext.extra_link_args = more
        self.force = self.compiler.force = True  # kept objects may be older than what was linked from others
        super().build_extension(ext)


if __name__ == "__main__":
    os.environ.setdefault("PUSHPLAN_CORE_OBJECTS", "build/core")
    setup(script_args=["--quiet", "build_ext", "--inplace"])
