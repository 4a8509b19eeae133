"""How the compiled core is built; only setuptools imports this, by its path in `pyproject.toml`."""

from __future__ import annotations

import os
import runpy
import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import nanobind
from setuptools import Extension
from setuptools.command.build_ext import build_ext

FLAGS = ["-std=c++17", "-O3", "-g0", "-fvisibility=hidden", "-ffp-contract=off", "-fno-math-errno"]
"""No -march and no contraction to multiply-add: equal seeds give equal plans on every machine."""

LIBRARY = Path(nanobind.source_dir())
INCLUDE = [nanobind.include_dir(), str(LIBRARY), str(LIBRARY.parent / "ext" / "robin_map" / "include")]
"""nanobind's headers, and the source and headers of what `core/nanobind.cpp` compiles of it."""

CORE = Path(__file__).parent / "pushplan" / "core"
DIGEST_OF = runpy.run_path(str(CORE.parent / "util" / "checkout.py"))["digest_of"]


class BuildCore(build_ext):
    """Builds the core on all processors, with the digest of its sources compiled in."""

    def build_extensions(self) -> None:
        """Build, or take a core that was built of the same sources; without a compiler, say what is missing."""
        if built := os.environ.get("PUSHPLAN_CORE"):
            path = Path(self.get_ext_fullpath("pushplan.core"))
            path.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(built, path)
            return
        try:
            super().build_extensions()
        except Exception as error:
            raise SystemExit(
                f"pushplan's core could not be compiled: {error}\n"
                "A C++17 compiler and Python's headers are needed: on Debian and Ubuntu `apt install g++ "
                "python3-dev`; an installation from a wheel needs none."
            ) from error

    def build_extension(self, ext: Extension) -> None:
        """Compile all sources beside one another, and link them anew."""
        more = os.environ.get("PUSHPLAN_CORE_FLAGS", "").split()  # those of sanitizers, see .ci/sanitize
        flags = [*FLAGS, *more, f'-DPUSHPLAN_SOURCES="{DIGEST_OF(CORE)}"']
        for source in ext.sources:
            Path(self.build_temp, source).parent.mkdir(parents=True, exist_ok=True)

        def compiled(source: str) -> str:
            (made,) = self.compiler.compile(
                [source], output_dir=self.build_temp, include_dirs=INCLUDE, extra_postargs=flags
            )
            return str(made)

        pool = ThreadPoolExecutor(os.cpu_count())
        try:
            ext.extra_objects = list(pool.map(compiled, ext.sources))
        finally:
            pool.shutdown(cancel_futures=True)  # what is wrong is said at once
        ext.sources, ext.extra_link_args, self.force = [], more, True
        super().build_extension(ext)
