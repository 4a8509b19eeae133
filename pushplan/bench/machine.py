"""Which machine and which software produced results."""

from __future__ import annotations

import os
import platform
import socket
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from pushplan.logging.metadata import git_commit

_SOFTWARE = ("pushplan", "numpy", "scipy", "shapely", "ompl", "ruckig", "mcap")


@dataclass(frozen=True)
class Machine:
    """The machine that this process runs on.

    Attributes:
        host: Its name.
        text: Processor, number of processors that may be used, memory, operating system.
        versions: Of Python and of the packages that results depend on.
    """

    host: str
    text: str
    versions: dict[str, str]

    @property
    def words(self) -> str:
        """What benchmarks print first: processor, memory, operating system, and Python."""
        return f"{self.text}, Python {self.versions['python']}"

    @classmethod
    def this(cls) -> Machine:
        """Return this machine."""
        versions = {"python": platform.python_version(), **{name: version(name) for name in _SOFTWARE}}
        return cls(socket.gethostname(), _description(), versions)


def package_version() -> str:
    """Return the package's version and, in a checkout, its commit: results of different code are different."""
    commit = git_commit()
    return version("pushplan") + (f"+g{commit[:10]}" if commit else "")


def _description() -> str:
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
    processors = len(os.sched_getaffinity(0))
    return f"{_processor()}, {processors} processors, {memory:.0f} GB, {platform.system()} {platform.release()}"


def _processor() -> str:
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.machine())
