"""How the compiled core is built; only setuptools imports this, by its path in `pyproject.toml`."""

from __future__ import annotations

import runpy
from pathlib import Path

from pybind11 import get_include
from pybind11.setup_helpers import ParallelCompile
from setuptools.command.build_ext import build_ext

FLAGS = ["-std=c++17", "-O2", "-g0", "-fvisibility=hidden", "-ffp-contract=off", "-fno-math-errno"]
"""No -march and no contraction to multiply-add: equal seeds give equal plans on every machine."""


CORE = Path(__file__).parent / "pushplan" / "core"
DIGEST_OF = runpy.run_path(str(CORE.parent / "util" / "checkout.py"))["digest_of"]


class BuildCore(build_ext):
    """Builds the core on all processors, with the digest of its sources compiled in."""

    def build_extensions(self) -> None:
        """Build; without a compiler, say what is missing in one sentence."""
        sources = DIGEST_OF(CORE)
        for extension in self.extensions:
            extension.include_dirs.append(get_include())
            extension.extra_compile_args += [*FLAGS, f'-DPUSHPLAN_SOURCES="{sources}"']
        try:
            with ParallelCompile(default=0):
                super().build_extensions()
        except Exception as error:
            raise SystemExit(
                f"pushplan's core could not be compiled: {error}\n"
                "A C++17 compiler and Python's headers are needed: on Debian and Ubuntu `apt install g++ "
                "python3-dev`; an installation from a wheel needs none."
            ) from error
