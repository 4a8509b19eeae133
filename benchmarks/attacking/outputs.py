"""Every output option of every command against files that it could destroy.

`unshare --map-root-user --mount python outputs.py FOLDER LOG` writes to a full and a closed file system in a mount
namespace of its own. It prints a JSON list of group, exit code, standard error and remaining files by key.
"""

from __future__ import annotations

import io
import json
import os
import stat
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout, suppress
from functools import partial
from pathlib import Path
from threading import Thread

from attacking.logs import sound
from attacking.measured import Attacks, Row, judged, wrong
from output_options import OPTIONS, words

import pushplan.logging.film as film
from pushplan.cli.main import main

MEANT = {0: "written", 2: "refused"}


def attacks(folder: Path, count: int, seed: int) -> Attacks:
    """Yield every output option with every target that it could destroy."""
    log = sound(folder)["push"]
    for command, option, suffix in OPTIONS:
        for place in ("link", "pipe", "folder"):
            yield f"{command} {option} {place}", partial(_attack, folder, log, command, option, suffix, place)
    unshare = ["unshare", "--map-root-user", "--mount"]
    if subprocess.run([*unshare, "true"], check=False).returncode:
        print("  no mount namespace here: file systems are left out")
        return
    where = folder / f"places-{os.getpid()}"
    where.mkdir()
    script = [*unshare, sys.executable, __file__, str(where), str(log)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}  # with the tests, whose options these are
    done = subprocess.run(script, check=True, capture_output=True, text=True, env=environment)
    for key, place, code, error, left in json.loads(done.stdout):
        row = wrong(f"left: {left}") if left else judged(code, error, MEANT)
        yield key, partial(dict, row, group=place, error=error)


def _attack(folder: Path, log: Path, command: str, option: str, suffix: str, place: str) -> Row:
    """Run a command whose output has the name of a link, a pipe or a folder; check that this still exists."""
    path, aside = folder / f"{place}{suffix}", folder / f"aside{suffix}"
    for old in (path, aside):
        if old.is_dir() and not old.is_symlink():
            old.rmdir()
        else:
            old.unlink(missing_ok=True)
    if place == "link":
        aside.write_text("old")
        path.symlink_to(aside.name)
    elif place == "pipe":
        os.mkfifo(path)
        Thread(target=path.read_bytes, daemon=True).start()
    else:
        path.mkdir()
    kind = stat.S_IFMT(os.lstat(path).st_mode)
    program = [sys.executable, "-m", "pushplan", *words(command, option, path, log)]
    done = subprocess.run(program, check=False, capture_output=True, text=True)
    kept = stat.S_IFMT(os.lstat(path).st_mode) == kind
    if place == "pipe":  # nobody may have opened it: let its reader go
        os.close(os.open(path, os.O_RDWR))
    return {"group": place, **(judged(done.returncode, done.stderr, MEANT) if kept else wrong("it is gone"))}


def make_places(folder: Path) -> dict[str, Path]:
    """Mount a full and a closed file system."""
    places = {name: folder / name for name in ("full", "closed")}
    for place in places.values():
        place.mkdir()
        subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "none", place], check=True)
    with (places["full"] / "filler").open("wb", buffering=0) as filler, suppress(OSError):
        while filler.write(bytes(4096)):
            pass
    subprocess.run(["mount", "-o", "remount,ro", places["closed"]], check=True)
    return places


def in_namespace(folder: Path, log: Path) -> None:
    """Run every output option in this process."""
    film.PICTURES_PER_SECOND = 1  # a short film is a film
    found: list[list[object]] = []
    for place, at in make_places(folder).items():
        for command, option, suffix in OPTIONS:
            errors = io.StringIO()
            with redirect_stderr(errors), redirect_stdout(io.StringIO()):
                code = main(words(command, option, at / f"out{suffix}", log))
            left = sorted(set(os.listdir(at)) - {"filler"})
            found.append([f"{command} {option} {place}", place, code, errors.getvalue(), left])
    print(json.dumps(found))


if __name__ == "__main__":
    in_namespace(Path(sys.argv[1]), Path(sys.argv[2]))
