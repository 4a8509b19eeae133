"""Runs every output option against a full and a closed file system, in a mount namespace of its own.

Run as `unshare --map-root-user --mount python outputs_in_namespace.py FOLDER LOG`; prints a JSON list of
[place, command, option, exit code, standard error, whether it is there afterwards, what else is].
"""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

from output_options import OPTIONS, words

import pushplan.logging.film as film
from pushplan.cli.main import main


def mount(*how: str) -> None:
    subprocess.run(["mount", *how], check=True)


def make_places(folder: Path) -> dict[str, Path]:
    places = {name: folder / name for name in ("full", "closed")}
    for place in places.values():
        place.mkdir()
        mount("-t", "tmpfs", "-o", "size=64k", "none", str(place))
    with (places["full"] / "filler").open("wb", buffering=0) as filler:
        try:
            while filler.write(bytes(4096)):
                pass
        except OSError:
            pass
    mount("-o", "remount,ro", str(places["closed"]))
    return places


def run(folder: Path, log: Path) -> list[list[object]]:
    found: list[list[object]] = []
    for place, at in make_places(folder).items():
        for command, option, suffix in OPTIONS:
            path = at / f"out{suffix}"
            errors = io.StringIO()
            with redirect_stderr(errors), redirect_stdout(io.StringIO()):
                code = main(words(command, option, path, log))
            leftovers = sorted(set(os.listdir(at)) - {"filler"})
            found.append([place, command, option, code, errors.getvalue(), path.exists(), leftovers])
    return found


if __name__ == "__main__":
    film.PICTURES_PER_SECOND = 1  # a short film is a film
    print(json.dumps(run(Path(sys.argv[1]), Path(sys.argv[2]))))
