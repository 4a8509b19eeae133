"""How the compiled core is built; only setuptools imports this, by its path in `pyproject.toml`."""

from __future__ import annotations

import os
import runpy
import shutil
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
        """Build, or take a core that was built of the same sources; without a compiler, say what is missing."""
        if built := os.environ.get("PUSHPLAN_CORE"):
            path = Path(self.get_ext_fullpath("pushplan.core"))
            path.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(built, path)
            return
        sources = DIGEST_OF(CORE)
        for extension in self.extensions:
            extension.include_dirs.append(get_include())
            more = os.environ.get("PUSHPLAN_CORE_FLAGS", "").split()  # those of sanitizers, see .ci/sanitize
            extension.extra_compile_args += [*FLAGS, *more, f'-DPUSHPLAN_SOURCES="{sources}"']
            extension.extra_link_args += more
        try:
            with ParallelCompile(default=0):
                super().build_extensions()
        except Exception as error:
            raise SystemExit(
                f"pushplan's core could not be compiled: {error}\n"
                "A C++17 compiler and Python's headers are needed: on Debian and Ubuntu `apt install g++ "
                "python3-dev`; an installation from a wheel needs none."
            ) from error
