"""Every output option of every command against files that it could destroy."""

from __future__ import annotations

import json
import os
import stat
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from threading import Thread

from attacking.logs import sound
from attacking.measured import Attack, Row
from output_options import OPTIONS, words


def attacks(folder: Path) -> Iterator[tuple[str, Attack]]:
    """Yield every output option with every target that it could destroy."""
    log = sound(folder)["push"]
    for command, option, suffix in OPTIONS:
        for place in ("link", "pipe", "folder"):
            key = f"{command} {option} {place}"
            yield key, lambda c=command, o=option, s=suffix, p=place: _attack(folder, log, c, o, s, p)
    unshare = ["unshare", "--map-root-user", "--mount"]
    if subprocess.run([*unshare, "true"], check=False).returncode:
        print("  no mount namespace here: devices and file systems are left out")
        return
    where = folder / f"places-{os.getpid()}"
    where.mkdir()
    script = [
        *unshare,
        sys.executable,
        str(Path(__file__).with_name("outputs_in_namespace.py")),
        str(where),
        str(log),
    ]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}  # with the tests, whose options these are
    done = subprocess.run(script, check=True, capture_output=True, text=True, env=environment)
    for place, command, option, code, error, there, others in json.loads(done.stdout):
        kept = not there and not others
        verdict = {0: "written", 2: "refused"}.get(code, "WRONG") if kept else "WRONG"
        row: Row = {"group": place, "verdict": verdict, "error": error}
        yield f"{command} {option} {place}", lambda row=row: row


def _attack(folder: Path, log: Path, command: str, option: str, suffix: str, place: str) -> Row:
    """Run a command whose output has the name of a link, a pipe or a folder; check that this still exists."""
    path, aside = folder / f"{place}{suffix}", folder / f"aside{suffix}"
    for old in (path, aside):
        if old.is_dir() and not old.is_symlink():
            old.rmdir()
        else:
            old.unlink(missing_ok=True)
    kinds = {"link": stat.S_IFLNK, "pipe": stat.S_IFIFO, "folder": stat.S_IFDIR}
    if place == "link":
        aside.write_text("old")
        path.symlink_to(aside.name)
    elif place == "pipe":
        os.mkfifo(path)
        Thread(target=path.read_bytes, daemon=True).start()
    else:
        path.mkdir()
    program = [sys.executable, "-m", "pushplan", *words(command, option, path, log)]
    code = subprocess.run(program, check=False, capture_output=True).returncode
    kept = stat.S_IFMT(os.lstat(path).st_mode) == kinds[place]
    if place == "pipe":  # nobody may have opened it: let its reader go
        os.close(os.open(path, os.O_RDWR))
    verdict = {0: "written", 2: "refused"}.get(code, "WRONG") if kept else "WRONG"
    return {"group": place, "verdict": verdict, "code": code}
