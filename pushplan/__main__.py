"""Where the program begins: Ctrl-C while it loads ends it without a traceback."""

from __future__ import annotations

import gc
import os
from typing import NoReturn

from pushplan.util.interruption import leaving_at_once

# Matrices here are small: OpenBLAS's threads would only wait for one another. Identification of a few logs takes
# 11 s of CPU with one of them, and 70 s with two.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Nothing here has plugins of pydantic, which it would look for in every package that is installed.
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")

# Looking for cycles after every 700 objects takes an eighth of the time of a short command, and finds next to none;
# such a command makes up to 110,000, and 210,000 with a picture.
gc.set_threshold(300_000)


def entry() -> NoReturn:
    """Load the command line, run it, and end the process with its exit code."""
    with leaving_at_once():
        from pushplan.cli.main import entry as run
    run()


if __name__ == "__main__":
    entry()
