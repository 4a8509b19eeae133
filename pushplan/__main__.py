"""Entry point of the command line. Ctrl-C while it loads ends it without a traceback."""

from __future__ import annotations

import gc
import os
from typing import NoReturn

from pushplan.util.interruption import leaving_at_once

# The matrices are small, so several OpenBLAS threads only wait for each other. Identification from a few logs takes
# 11 s of CPU with one thread and 70 s with two.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# pushplan uses no pydantic plugins. Without this setting, pydantic searches every installed package for them.
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")

# Garbage collection after every 700 objects takes an eighth of the time of a short command and finds almost no
# cycles. Such a command creates up to 110,000 objects, or 210,000 with a picture.
gc.set_threshold(300_000)


def entry() -> NoReturn:
    """Load the command line, run it, and end the process with its exit code."""
    with leaving_at_once():
        from pushplan.cli.main import entry as run
    run()


if __name__ == "__main__":
    entry()
