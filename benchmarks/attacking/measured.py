"""Runs an attack in its own process and measures its time, memory, child processes and files elsewhere."""

from __future__ import annotations

import contextlib
import io
import json
import os
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from threading import Timer
from typing import Any

from pushplan.cli.main import main

Row = dict[str, Any]
Attacks = Iterator[tuple[str, Callable[[], Row]]]
"""Key and function of each attack; its row has a `group` and a `verdict`."""

MOST_MB, MOST_SECONDS = 500.0, 10.0
"""Largest memory of an attack, and largest CPU time beyond its time limit."""

TAKEN: list[float] = []
"""CPU time of each command in this process, s."""

_STARTS = {"subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.spawn", "os.fork", "os.forkpty"}
_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT


def wrong(why: str) -> Row:
    """Return the row of an attack that ended as it must not."""
    return {"verdict": "WRONG", "why": why}


def measured(work: Callable[[Path], Row], limit: float = 0.0, **fields: Any) -> Row:
    """Do an attack in a child and an empty folder; return its row, with time, memory and a verdict.

    Args:
        work: Gets the folder, which is the working directory, too; its row has a `verdict`.
        limit: Time limit of its search, s.
        fields: Further fields of the row.
    """
    reading, writing = os.pipe()
    with tempfile.TemporaryDirectory(prefix="attack-") as folder:
        child = os.fork()
        if child == 0:
            os.close(reading)
            _attacked(work, Path(folder), writing)
        os.close(writing)
        watch = Timer(30.0 * (MOST_SECONDS + limit), os.kill, (child, signal.SIGKILL))
        watch.start()
        with os.fdopen(reading) as pipe:
            told = pipe.read()
        _, status, used = os.wait4(child, 0)
        watch.cancel()
    row: Row = fields | (json.loads(told) if told else wrong(f"ended by status {status}") | {"mb": 0.0})
    row.setdefault("seconds", used.ru_utime + used.ru_stime)
    why = [row.get("why"), row.get("outside")]
    why += [f"{row['mb']:.0f} MB"] * (row["mb"] > MOST_MB)
    why += [f"{row['seconds']:.1f} s"] * (row["seconds"] > limit + MOST_SECONDS)
    return row | wrong("; ".join(filter(None, why))) if any(why) else row


def _attacked(work: Callable[[Path], Row], folder: Path, writing: int) -> None:
    """Run the attack in the child, report the row, and end."""
    outside: list[str] = []

    def hook(event: str, args: tuple[Any, ...]) -> None:
        before = len(outside)
        if event in _STARTS:
            outside.append(f"{event} {args[:2]}")
        elif event == "open" and isinstance(args[0], str | bytes) and (args[2] or 0) & _WRITES:
            path = os.path.realpath(os.fsdecode(args[0]))
            if not path.startswith((os.path.realpath(folder), "/dev/null")):
                outside.append(f"wrote {path}")
        if len(outside) > before:
            raise PermissionError(outside[-1])  # told, and not done

    os.chdir(folder)
    os.environ["PUSHPLAN_RUNS"] = str(folder / "runs")
    resource.setrlimit(resource.RLIMIT_AS, (8 << 30, 8 << 30))
    sys.addaudithook(hook)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    try:
        row = work(folder)
    except BaseException:
        row = wrong(traceback.format_exc()[-1500:])
    taken = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    row |= {"seconds": max(TAKEN)} if TAKEN else {}
    row |= {"mb": taken / 1024.0, "outside": "; ".join(outside)[:300]}
    os.write(writing, json.dumps(row).encode())
    os._exit(0)


def commanded(*words: object) -> tuple[int, str, str]:
    """Run a command of pushplan in this process; return its exit code, its output and its errors."""
    out, err = io.StringIO(), io.StringIO()
    began = time.process_time()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main([str(word) for word in words])
    TAKEN.append(time.process_time() - began)
    return code, out.getvalue(), err.getvalue()


def judged(code: int, errors: str, meant: Mapping[int, str]) -> Row:
    """Return the row of a command's exit code: one of those that are meant, or wrong."""
    return {"verdict": meant[code]} if code in meant else wrong(f"exit code {code}: {errors[-800:]}")
